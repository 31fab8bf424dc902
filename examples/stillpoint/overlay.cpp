// SPDX-License-Identifier: BSD-2-Clause
#include "overlay.hpp"

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <opencv2/imgproc.hpp>

#include "stillpoint/core/distortion.hpp"
#include "stillpoint/core/error.hpp"

namespace stillpoint::cli {
namespace {

const cv::Scalar kGreen(80, 220, 60), kRed(60, 60, 240), kYellow(40, 230, 255);
constexpr int kStrip = 26;

int write(cv::Mat& image, int x, const std::string& words, const cv::Scalar& color) {
  const int baseline = image.rows - 9;
  int ignored = 0;
  cv::putText(image, words, {x, baseline}, cv::FONT_HERSHEY_SIMPLEX, 0.42, color, 1, cv::LINE_AA);
  return x + cv::getTextSize(words, cv::FONT_HERSHEY_SIMPLEX, 0.42, 1, &ignored).width;
}

}  // namespace

cv::Mat draw_overlay(const cv::Mat& color, const DynamicMask& mask,
                     const std::vector<cv::Point2f>& kept, const std::vector<cv::Point2f>& removed,
                     double timestamp) {
  cv::Mat image(color.rows + kStrip, color.cols, CV_8UC3, cv::Scalar(30, 30, 30));
  cv::Mat view = image.rowRange(0, color.rows);
  if (color.channels() == 1)
    cv::cvtColor(color, view, cv::COLOR_GRAY2BGR);
  else
    color.copyTo(view);
  double share = 0;
  if (!mask.image.empty()) {
    share = mask.coverage();
    cv::Mat tinted;
    cv::addWeighted(view, 0.75, cv::Mat(view.size(), CV_8UC3, kYellow), 0.25, 0, tinted);
    tinted.copyTo(view, mask.image);
    std::vector<std::vector<cv::Point>> contours;
    cv::findContours(mask.image.clone(), contours, cv::RETR_CCOMP, cv::CHAIN_APPROX_NONE);
    cv::drawContours(view, contours, -1, kYellow, 1, cv::LINE_8);
  }
  for (const cv::Point2f& p : removed) cv::circle(view, p, 2, kRed, cv::FILLED, cv::LINE_AA);
  for (const cv::Point2f& p : kept) cv::circle(view, p, 2, kGreen, cv::FILLED, cv::LINE_AA);
  char words[64];
  std::snprintf(words, sizeof words, "t = %.3f s", timestamp);
  const cv::Scalar white(235, 235, 235);
  int x = write(image, 8, words, white) + 18;
  // A narrow image has no room for the legend.
  if (image.cols >= 480) {
    x = write(image, x, "kept " + std::to_string(kept.size()), kGreen) + 14;
    x = write(image, x, "removed " + std::to_string(removed.size()), kRed) + 14;
    std::snprintf(words, sizeof words, "mask %.1f %%", 100 * share);
    write(image, x, words, kYellow);
  }
  return image;
}

void draw_objects(cv::Mat& overlay, const std::vector<DynamicObject>& objects,
                  const Camera& camera) {
  constexpr double kAheadS = 0.5, kLeastSpeed = 0.1, kLeastDepthM = 0.2;
  const cv::Scalar white(255, 255, 255), black(0, 0, 0);
  cv::Mat view = overlay.rowRange(0, overlay.rows - kStrip);
  const auto pixel = [&](const Eigen::Vector3d& p) {
    const Eigen::Vector2d at = distort_pixel(camera, camera.project(p));
    return cv::Point(cvRound(at.x()), cvRound(at.y()));
  };
  for (const DynamicObject& object : objects) {
    const std::string name =
        std::to_string(object.id) + (object.class_name.empty() ? "" : " " + object.class_name);
    const cv::Point at(object.box.x + 3, std::max(12, object.box.y + 12));
    cv::putText(view, name, at, cv::FONT_HERSHEY_SIMPLEX, 0.42, black, 3, cv::LINE_AA);
    cv::putText(view, name, at, cv::FONT_HERSHEY_SIMPLEX, 0.42, white, 1, cv::LINE_AA);
    if (!object.in_camera || object.in_camera->velocity_m_s.norm() < kLeastSpeed) continue;
    const Eigen::Vector3d from = object.in_camera->centroid_m;
    const Eigen::Vector3d to = from + kAheadS * object.in_camera->velocity_m_s;
    if (!(from.z() > kLeastDepthM && to.z() > kLeastDepthM)) continue;
    cv::arrowedLine(view, pixel(from), pixel(to), black, 4, cv::LINE_AA, 0, 0.25);
    cv::arrowedLine(view, pixel(from), pixel(to), white, 2, cv::LINE_AA, 0, 0.25);
  }
}

cv::Mat draw_stages(const RgbdFrame& frame, const cv::Mat& truth,
                    const std::vector<std::pair<std::string, cv::Mat>>& stages,
                    const DynamicMask& mask, const std::vector<cv::Point2f>& kept) {
  const cv::Size cell(frame.color.cols / 2, frame.color.rows / 2 + kStrip);
  const int columns = 3, rows = (static_cast<int>(stages.size()) + 2 + columns - 1) / columns;
  cv::Mat sheet(rows * cell.height, columns * cell.width, CV_8UC3, cv::Scalar(30, 30, 30));
  cv::Mat color = frame.color;
  if (color.channels() == 1) cv::cvtColor(frame.color, color, cv::COLOR_GRAY2BGR);
  int next = 0;
  const auto place = [&](const cv::Mat& image, const std::string& words) {
    cv::Mat part =
        sheet({next % columns * cell.width, next / columns * cell.height, cell.width, cell.height});
    cv::Mat view = part.rowRange(0, cell.height - kStrip);
    cv::resize(image, view, view.size(), 0, 0, cv::INTER_AREA);
    write(part, 8, words, cv::Scalar(235, 235, 235));
    ++next;
  };
  char words[96];
  std::snprintf(words, sizeof words, "t = %.3f s", frame.timestamp);
  place(color, words);
  cv::Mat gray;
  cv::cvtColor(color, gray, cv::COLOR_BGR2GRAY);
  cv::cvtColor(gray, gray, cv::COLOR_GRAY2BGR);
  for (const auto& [name, stage] : stages) {
    cv::Mat tints = gray.clone();
    tints.setTo(kGreen, stage & truth);
    tints.setTo(kRed, truth & ~stage);
    tints.setTo(cv::Scalar(255, 120, 40), stage & ~truth);
    cv::Mat image;
    cv::addWeighted(gray, 0.5, tints, 0.5, 0, image);
    const double right = cv::countNonZero(stage & truth), all = cv::countNonZero(truth),
                 said = cv::countNonZero(stage);
    std::snprintf(words, sizeof words, "%s: recall %.2f precision %.2f", name.c_str(),
                  all > 0 ? right / all : 1, said > 0 ? right / said : 1);
    place(image, words);
  }
  cv::Mat last = draw_overlay(color, mask, kept, {}, frame.timestamp);
  place(last.rowRange(0, color.rows), "kept keypoints: " + std::to_string(kept.size()));
  return sheet;
}

std::string data_uri(const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) throw Error(file + ": cannot be read");
  const std::string bytes{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  static const char* const alphabet =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  const bool png = file.size() > 4 && file.compare(file.size() - 4, 4, ".png") == 0;
  std::string out = png ? "data:image/png;base64," : "data:image/jpeg;base64,";
  out.reserve(out.size() + (bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    unsigned block = 0;
    for (std::size_t k = 0; k < 3; ++k)
      block = block << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0u);
    for (std::size_t k = 0; k < 4; ++k)
      out += i + k <= bytes.size() ? alphabet[block >> (18 - 6 * k) & 63u] : '=';
  }
  return out;
}

}  // namespace stillpoint::cli
