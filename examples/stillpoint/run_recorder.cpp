// SPDX-License-Identifier: BSD-2-Clause
#include "run_recorder.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <opencv2/imgproc.hpp>

#include "overlay.hpp"
#include "statistics.hpp"
#include "stillpoint/core/error.hpp"
#include "stillpoint/io/picture_file.hpp"

namespace stillpoint::cli {
namespace {

using Json = nlohmann::ordered_json;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

cv::Mat gray_of(const cv::Mat& color) {
  if (color.channels() == 1) return color;
  cv::Mat gray;
  cv::cvtColor(color, gray, cv::COLOR_BGR2GRAY);
  return gray;
}

/// Variance of the Laplacian; low for a blurred picture.
double sharpness(const cv::Mat& gray) {
  cv::Mat laplacian;
  cv::Laplacian(gray, laplacian, CV_16S);
  cv::Scalar mean, deviation;
  cv::meanStdDev(laplacian, mean, deviation);
  return deviation[0] * deviation[0];
}

double ratio(double part, double whole) { return whole > 0 ? part / whole : kNaN; }

}  // namespace

FrameWriter::FrameWriter(const RunOutputs& outputs) : outputs_(outputs) {
  if (!outputs_.masks_dir.empty()) make_folder(outputs_.masks_dir);
  if (!outputs_.overlays_dir.empty()) make_folder(outputs_.overlays_dir);
  if (outputs_.keypoints_csv.empty()) return;
  csv_.reset(std::fopen(outputs_.keypoints_csv.string().c_str(), "w"));
  if (!csv_) throw Error(outputs_.keypoints_csv.string() + ": cannot be written");
  std::fputs("timestamp,x,y,probability,kept\n", csv_.get());
}

void FrameWriter::write(const Pipeline& pipeline, const RgbdFrame& frame, const std::string& stem,
                        std::size_t index) {
  const Selection& selection = pipeline.selection();
  if (!outputs_.masks_dir.empty()) {
    cv::Mat mask = pipeline.mask().image;
    if (mask.empty()) mask = cv::Mat::zeros(frame.color.size(), CV_8UC1);
    write_picture(outputs_.masks_dir / (stem + ".png"), mask);
  }
  if (csv_)
    for (std::size_t i = 0; i < selection.size(); ++i) {
      const cv::Point2f p = pipeline.keypoints()[i].pt;
      std::fprintf(csv_.get(), "%.6f,%.2f,%.2f,%.4f,%d\n", frame.timestamp,
                   static_cast<double>(p.x), static_cast<double>(p.y),
                   static_cast<double>(selection.probability[i]), selection.is_kept(i) ? 1 : 0);
    }
  const auto& stems = outputs_.overlay_stems;
  const bool wanted = (outputs_.overlay_every > 0 && index % outputs_.overlay_every == 0) ||
                      std::find(stems.begin(), stems.end(), stem) != stems.end();
  if (outputs_.overlays_dir.empty() || !wanted) return;
  const cv::Mat overlay =
      draw_overlay(frame.color, pipeline.mask(), pipeline.keypoints(), selection, frame.timestamp);
  write_picture(outputs_.overlays_dir / (stem + (outputs_.overlays_jpeg ? ".jpg" : ".png")),
                overlay);
}

void FrameWriter::finish() {
  if (csv_ && (std::fflush(csv_.get()) != 0 || std::ferror(csv_.get()) != 0))
    throw Error(outputs_.keypoints_csv.string() + ": could not be written to its end (disk full?)");
}

RunRecorder::RunRecorder(std::filesystem::path truth_dir, const FrontEndSettings& front_end)
    : truth_dir_(std::move(truth_dir)),
      judge_(front_end.probability),
      use_probability_(front_end.use_probability),
      extractor_(cv::ORB::create(1000)) {}

RunRecorder::Counts RunRecorder::compare(const cv::Mat& mask, const cv::Mat& truth) {
  Counts c;
  const double total = static_cast<double>(truth.total());
  const double people = cv::countNonZero(truth);
  if (mask.empty()) {
    c.missed = people, c.left = total - people;
    return c;
  }
  const double claimed = cv::countNonZero(mask);
  c.hit = cv::countNonZero(mask & truth);
  c.false_alarm = claimed - c.hit;
  c.missed = people - c.hit;
  c.left = total - c.hit - c.false_alarm - c.missed;
  return c;
}

void RunRecorder::add(const Pipeline& pipeline, const RgbdFrame& frame, const std::string& stem) {
  Record r;
  r.timestamp = frame.timestamp;
  r.times = pipeline.times();
  r.tracked = pipeline.pose().has_value();
  r.keypoints = static_cast<int>(pipeline.keypoints().size());
  r.kept = static_cast<int>(pipeline.selection().kept.size());
  const cv::Mat gray = gray_of(frame.color);
  r.sharpness = sharpness(gray);
  if (pipeline.uses_front_end()) {
    const FrameStats& stats = pipeline.stats();
    r.status = stats.status;
    r.restored = stats.restored;
    r.mask_share = stats.mask_share;
    if (segmenter_error_.empty()) segmenter_error_ = stats.segmenter_error;
  }

  const std::filesystem::path truth_file = truth_dir_ / (stem + ".png");
  std::error_code ignored;
  if (!truth_dir_.empty() && std::filesystem::exists(truth_file, ignored)) {
    cv::Mat truth = detail::read_picture(truth_file, cv::IMREAD_GRAYSCALE, "ground-truth mask") > 0;
    if (truth.size() != frame.color.size())
      throw Error("ground-truth mask " + truth_file.string() + ": expected the picture's size " +
                  detail::size_text(frame.color) + ", found " + detail::size_text(truth));
    any_truth_ = r.has_truth = true;
    DynamicMask people;
    people.image = truth;
    r.true_share = people.coverage();
    for (int i : pipeline.selection().kept) {
      const cv::Point2f p = pipeline.keypoints()[static_cast<std::size_t>(i)].pt;
      r.kept_on_people += people.dynamic_at(p.x, p.y);
    }
    if (pipeline.uses_front_end()) {
      r.before = compare(pipeline.front_end().raw_mask(), truth);
      r.after = compare(pipeline.front_end().undilated_mask(), truth);
      // The tracker looks for keypoints outside the mask only; what the filter decides is judged on
      // keypoints of the whole picture.
      std::vector<cv::KeyPoint> keypoints;
      extractor_->detect(gray, keypoints);
      const Selection& judged = judge_.filter(keypoints, pipeline.mask(), use_probability_);
      for (std::size_t i = 0; i < keypoints.size(); ++i) {
        const bool dynamic = people.dynamic_at(keypoints[i].pt.x, keypoints[i].pt.y);
        const bool removed = !judged.is_kept(i);
        ++(dynamic   ? removed ? r.judged.hit : r.judged.missed
           : removed ? r.judged.false_alarm
                     : r.judged.left);
      }
    }
  }
  records_.push_back(r);
}

std::size_t RunRecorder::tracked() const {
  return static_cast<std::size_t>(
      std::count_if(records_.begin(), records_.end(), [](const Record& r) { return r.tracked; }));
}

std::vector<double> RunRecorder::timestamps() const {
  std::vector<double> times;
  for (const Record& r : records_) times.push_back(r.timestamp);
  return times;
}

void RunRecorder::summarize(Json& stats, bool front_end) const {
  const auto collect = [&](auto value) {
    std::vector<double> values;
    for (const Record& r : records_) values.push_back(static_cast<double>(value(r)));
    return values;
  };
  const auto sum = [&](auto value) {
    double total = 0;
    for (double v : collect(value)) total += v;
    return total;
  };

  Json& times = stats["times_ms"];
  const std::pair<const char*, double StageTimes::*> stages[] = {
      {"segmentation", &StageTimes::segmentation},
      {"compensation", &StageTimes::compensation},
      {"depth", &StageTimes::depth},
      {"probability", &StageTimes::probability},
      {"extraction", &StageTimes::extraction},
      {"tracking", &StageTimes::tracking},
      {"total", &StageTimes::total}};
  for (const auto& [name, member] : stages) {
    const auto values = collect([m = member](const Record& r) { return r.times.*m; });
    times[name] = {{"median", quantile(values, 0.5)}, {"p95", quantile(values, 0.95)}};
  }

  std::map<std::string, int> status;
  for (const Record& r : records_)
    for (const std::string& name : status_names(r.status)) ++status[name];
  stats["status"] = Json::object();
  for (const auto& [name, count] : status) stats["status"][name] = count;
  if (!segmenter_error_.empty()) stats["segmenter_error"] = segmenter_error_;

  Json& keypoints = stats["keypoints"];
  keypoints = {{"extracted", mean(collect([](const Record& r) { return r.keypoints; }))},
               {"kept", mean(collect([](const Record& r) { return r.kept; }))}};
  if (any_truth_) {
    keypoints["kept_on_people"] =
        ratio(sum([](const Record& r) { return r.has_truth ? r.kept_on_people : 0; }),
              sum([](const Record& r) { return r.has_truth ? r.kept : 0; }));
    if (front_end) {
      const double hit = sum([](const Record& r) { return r.judged.hit; });
      const double wrong = sum([](const Record& r) { return r.judged.false_alarm; });
      const double missed = sum([](const Record& r) { return r.judged.missed; });
      const double left = sum([](const Record& r) { return r.judged.left; });
      keypoints["precision"] = ratio(hit, hit + wrong);
      keypoints["recall"] = ratio(hit, hit + missed);
      keypoints["f1"] = ratio(2 * hit, 2 * hit + wrong + missed);
      keypoints["static_kept"] = ratio(left, left + wrong);
    }
  }

  if (!front_end) return;
  stats["mask_share"] = mean(collect([](const Record& r) { return r.mask_share; }));
  stats["restored_objects"] = sum([](const Record& r) { return r.restored; });
  if (!any_truth_) return;
  // Frames without people and without a mask have no IoU and are left out of its mean.
  std::vector<double> sharp;
  for (const Record& r : records_)
    if (r.has_truth) sharp.push_back(r.sharpness);
  const double blurred_below = quantile(sharp, 1.0 / 3);
  Json masks;
  masks["frames"] = sharp.size();
  for (const bool after : {false, true}) {
    std::vector<double> iou, iou_blurred;
    Counts total;
    for (const Record& r : records_) {
      if (!r.has_truth) continue;
      const Counts& c = after ? r.after : r.before;
      const double value = ratio(c.hit, c.hit + c.false_alarm + c.missed);
      iou.push_back(value);
      if (r.sharpness <= blurred_below) iou_blurred.push_back(value);
      total.hit += c.hit, total.false_alarm += c.false_alarm, total.missed += c.missed;
    }
    const std::string suffix = after ? "_after" : "_before";
    masks["iou" + suffix] = mean(iou);
    masks["iou" + suffix + "_blurred"] = mean(iou_blurred);
    masks["recall" + suffix] = ratio(total.hit, total.hit + total.missed);
    masks["precision" + suffix] = ratio(total.hit, total.hit + total.false_alarm);
  }
  stats["masks"] = masks;
}

Json RunRecorder::series(bool front_end) const {
  const auto rounded = [](double value, double step) { return std::round(value / step) * step; };
  Json out;
  for (const Record& r : records_) {
    out["t_s"].push_back(rounded(r.timestamp - records_.front().timestamp, 1e-6));
    out["sharpness"].push_back(rounded(r.sharpness, 0.01));
    if (front_end) out["mask_share"].push_back(rounded(r.mask_share, 1e-5));
    if (any_truth_)
      out["true_mask_share"].push_back(r.has_truth ? Json(rounded(r.true_share, 1e-5)) : Json());
    out["kept"].push_back(r.kept);
  }
  return out;
}

}  // namespace stillpoint::cli
