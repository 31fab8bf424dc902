// SPDX-License-Identifier: BSD-2-Clause
#include "overlay.hpp"

#include <cstdio>
#include <fstream>
#include <iterator>
#include <opencv2/imgproc.hpp>

#include "stillpoint/core/error.hpp"

namespace stillpoint::cli {
namespace {

const cv::Scalar kGreen(80, 220, 60), kRed(60, 60, 240), kYellow(40, 230, 255);
constexpr int kStrip = 26;

int write(cv::Mat& picture, int x, const std::string& words, const cv::Scalar& color) {
  const int baseline = picture.rows - 9;
  int ignored = 0;
  cv::putText(picture, words, {x, baseline}, cv::FONT_HERSHEY_SIMPLEX, 0.42, color, 1, cv::LINE_AA);
  return x + cv::getTextSize(words, cv::FONT_HERSHEY_SIMPLEX, 0.42, 1, &ignored).width;
}

}  // namespace

cv::Mat draw_overlay(const cv::Mat& color, const DynamicMask& mask,
                     const std::vector<cv::Point2f>& kept, const std::vector<cv::Point2f>& removed,
                     double timestamp) {
  cv::Mat picture(color.rows + kStrip, color.cols, CV_8UC3, cv::Scalar(30, 30, 30));
  cv::Mat view = picture.rowRange(0, color.rows);
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
  int x = write(picture, 8, words, white) + 18;
  // A narrow picture has no room for the legend.
  if (picture.cols >= 480) {
    x = write(picture, x, "kept " + std::to_string(kept.size()), kGreen) + 14;
    x = write(picture, x, "removed " + std::to_string(removed.size()), kRed) + 14;
    std::snprintf(words, sizeof words, "mask %.1f %%", 100 * share);
    write(picture, x, words, kYellow);
  }
  return picture;
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
