// SPDX-License-Identifier: BSD-2-Clause
#include "run_recorder.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "files.hpp"
#include "overlay.hpp"
#include "statistics.hpp"
#include "stillpoint/core/error.hpp"
#include "stillpoint/evaluation/stage_timing.hpp"
#include "stillpoint/io/image_file.hpp"
#include "stillpoint/io/mask_folder.hpp"
#include "stillpoint/io/objects_file.hpp"
#include "stillpoint/io/text_file.hpp"

namespace stillpoint::cli {
namespace {

using Json = nlohmann::ordered_json;

/// Sharpness of the edges, about 1: perfect steps; NaN: there are too few. Unlike Blur::sharpness
/// it does not depend on earlier frames, so that sequences can be compared.
double sharpness(const ImageBlur& blur) {
  constexpr double kOfPerfectSteps = 1.0 / 6;
  return ImageBlur::ratio(blur.total) / kOfPerfectSteps;
}

}  // namespace

FrameWriter::FrameWriter(const RunOutputs& outputs, const Camera& camera)
    : outputs_(outputs), camera_(camera), objects_(objects_csv_header()) {
  if (!outputs_.masks_dir.empty()) make_folder(outputs_.masks_dir);
  if (!outputs_.overlays_dir.empty()) make_folder(outputs_.overlays_dir);
  if (outputs_.keypoints_csv.empty()) return;
  csv_.reset(std::fopen(outputs_.keypoints_csv.string().c_str(), "w"));
  if (!csv_) throw Error(outputs_.keypoints_csv.string() + ": cannot be written");
  std::fputs("timestamp,x,y,probability,kept\n", csv_.get());
}

void FrameWriter::write(const FrameView& view, const std::string& stem, WholeImageJudge& judge) {
  const RgbdFrame& frame = view.frame();
  const Selection& selection = view.selection();
  if (!outputs_.masks_dir.empty()) {
    cv::Mat mask = view.mask().image;
    if (mask.empty()) mask = cv::Mat::zeros(frame.color.size(), CV_8UC1);
    write_image(mask_path(outputs_.masks_dir, stem), mask);
  }
  if (csv_)
    for (std::size_t i = 0; i < selection.size(); ++i) {
      const cv::Point2f p = view.keypoints()[i].pt;
      std::fprintf(csv_.get(), "%.6f,%.2f,%.2f,%.4f,%d\n", frame.timestamp,
                   static_cast<double>(p.x), static_cast<double>(p.y),
                   static_cast<double>(selection.probability[i]), selection.is_kept(i) ? 1 : 0);
    }
  if (!outputs_.objects_csv.empty())
    objects_ += objects_csv(frame.timestamp, view.front_end().objects());
  const auto& stems = outputs_.overlay_stems;
  const bool wanted = (outputs_.overlay_every > 0 && view.index() % outputs_.overlay_every == 0) ||
                      std::find(stems.begin(), stems.end(), stem) != stems.end();
  if (outputs_.overlays_dir.empty() || !wanted) return;
  std::vector<cv::Point2f> kept, removed;
  for (int i : selection.kept) kept.push_back(view.keypoints()[static_cast<std::size_t>(i)].pt);
  if (view.uses_front_end()) {
    judge.judge(frame, view.mask());
    for (std::size_t i = 0; i < judge.keypoints().size(); ++i)
      if (!judge.selection().is_kept(i)) removed.push_back(judge.keypoints()[i].pt);
  }
  cv::Mat overlay = draw_overlay(frame.color, view.mask(), kept, removed, frame.timestamp);
  if (view.uses_front_end()) draw_objects(overlay, view.front_end().objects(), camera_);
  write_image(outputs_.overlays_dir / (stem + (outputs_.overlays_jpeg ? ".jpg" : ".png")), overlay);
}

void FrameWriter::finish() {
  if (csv_ && (std::fflush(csv_.get()) != 0 || std::ferror(csv_.get()) != 0))
    throw Error(outputs_.keypoints_csv.string() + ": could not be written to its end (disk full?)");
  if (!outputs_.objects_csv.empty()) write_file(outputs_.objects_csv, objects_, "objects file");
}

void WorstFrames::add(const FrameView& view, const std::string& stem, const cv::Mat& truth,
                      const BinaryCounts& counts) {
  const RgbdFrame& frame = view.frame();
  constexpr double kApartS = 0.25;
  if (count_ == 0 || truth.empty() || !view.uses_front_end()) return;
  const FrontEnd& front_end = view.front_end();
  Frame worse;
  worse.timestamp = frame.timestamp, worse.stem = stem;
  worse.wrong = static_cast<double>(counts.false_positive + counts.false_negative) /
                static_cast<double>(truth.total());
  const auto near = [&](const Frame& f) {
    return std::abs(f.timestamp - worse.timestamp) < kApartS;
  };
  for (const Frame& f : frames_)
    if (near(f) && f.wrong >= worse.wrong) return;
  frames_.erase(std::remove_if(frames_.begin(), frames_.end(), near), frames_.end());
  const auto at = std::find_if(frames_.begin(), frames_.end(),
                               [&](const Frame& f) { return f.wrong < worse.wrong; });
  if (at == frames_.end() && frames_.size() >= count_) return;
  std::vector<cv::Point2f> kept;
  for (int i : view.selection().kept)
    kept.push_back(view.keypoints()[static_cast<std::size_t>(i)].pt);
  worse.image = draw_stages(frame, truth,
                            {{"segmenter", front_end.raw_mask()},
                             {"motion check", front_end.movers_mask()},
                             {"mended", front_end.mended_mask()},
                             {"after depth", front_end.undilated_mask()}},
                            view.mask(), kept);
  frames_.insert(at, std::move(worse));
  if (frames_.size() > count_) frames_.pop_back();
}

void WorstFrames::finish() const {
  if (count_ == 0) return;
  make_folder(folder_);
  int place = 0;
  for (const Frame& f : frames_) {
    char number[16];
    std::snprintf(number, sizeof number, "%02d_", ++place);
    write_image(folder_ / (number + f.stem + ".png"), f.image);
  }
}

void RunRecorder::add(const FrameView& view, const std::string& stem, WholeImageJudge& judge) {
  const RgbdFrame& frame = view.frame();
  Record r;
  r.timestamp = frame.timestamp;
  r.times = view.times();
  r.tracked = view.is_tracked();
  r.keypoints = static_cast<int>(view.keypoints().size());
  r.kept = static_cast<int>(view.selection().kept.size());
  r.sharpness = sharpness(blur_.measure(frame, {}));
  r.motion_px = std::numeric_limits<double>::quiet_NaN();
  if (view.uses_front_end()) {
    const FrameStats& stats = view.stats();
    r.status = stats.status;
    r.motion_px = stats.blur.motion_px;
    r.restored = stats.restored;
    r.mask_share = stats.mask_share;
    if (std::isfinite(stats.depth_delay_s)) depth_delay_s_ = stats.depth_delay_s;
    if (std::isfinite(stats.depth_readout_s)) depth_readout_s_ = stats.depth_readout_s;
    if (!stats.segmenter_error.empty() && segmenter_errors_++ == 0)
      segmenter_error_ = stats.segmenter_error;
  }

  std::error_code ignored;
  const std::filesystem::path truth_file = mask_path(truth_dir_, stem);
  truth_ = cv::Mat();
  if (!truth_dir_.empty() && std::filesystem::exists(truth_file, ignored)) {
    const cv::Mat truth = truth_ = read_mask(truth_file, frame.color.size());
    any_truth_ = r.has_truth = true;
    r.true_share = cv::countNonZero(truth) / static_cast<double>(truth.total());
    r.tracked_keypoints = compare_keypoints(view.keypoints(), view.selection(), truth);
    if (view.uses_front_end()) {
      r.before = compare_masks(view.front_end().raw_mask(), truth);
      r.after = compare_masks(view.front_end().undilated_mask(), truth);
      r.measured = compare_masks(view.front_end().undilated_mask(), truth, measured_pixels(frame));
      judge.judge(frame, view.mask());
      r.judged_keypoints = compare_keypoints(judge.keypoints(), judge.selection(), truth);
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

void RunRecorder::summarize_times(Json& stats) const {
  StageTiming timing;
  for (const Record& r : records_) {
    timing.add("segmentation", r.times.segmentation);
    timing.add("motion", r.times.motion);
    timing.add("compensation", r.times.compensation);
    timing.add("depth", r.times.depth);
    timing.add("probability", r.times.probability);
    timing.add("extraction", r.times.extraction);
    timing.add("tracking", r.times.tracking);
    timing.add("total", r.times.total);
  }
  for (const std::string& stage : timing.stages()) {
    const TimingSummary t = timing.summary(stage);
    stats["times_ms"][stage] = {{"median", t.median_ms}, {"p95", t.p95_ms}, {"max", t.max_ms}};
  }
}

Json RunRecorder::lost() const {
  Json lost = Json::array();
  for (std::size_t i = 0; i < records_.size(); ++i) {
    if (records_[i].tracked) continue;
    const std::size_t first = i;
    while (i < records_.size() && !records_[i].tracked) ++i;
    const double start = records_.front().timestamp;
    lost.push_back({{"from_s", records_[first].timestamp - start},
                    {"to_s", records_[i - 1].timestamp - start},
                    {"frames", i - first},
                    {"found_again", i < records_.size()}});
  }
  return lost;
}

Json RunRecorder::masks() const {
  std::vector<double> sharp;
  BinaryCounts measured;
  for (const Record& r : records_) {
    if (!r.has_truth) continue;
    sharp.push_back(r.sharpness);
    measured += r.measured;
  }
  const double blurred_below = quantile(sharp, 1.0 / 3);
  Json masks;
  masks["frames"] = sharp.size();
  for (const bool after : {false, true}) {
    MaskMetrics all, blurred;
    for (const Record& r : records_) {
      if (!r.has_truth) continue;
      all.add(after ? r.after : r.before);
      if (r.sharpness <= blurred_below) blurred.add(after ? r.after : r.before);
    }
    const std::string suffix = after ? "_after" : "_before";
    masks["iou" + suffix] = all.mean_iou();
    masks["recall" + suffix] = all.mean_recall();
    masks["precision" + suffix] = all.mean_precision();
    masks["iou" + suffix + "_blurred"] = blurred.mean_iou();
    masks["recall" + suffix + "_blurred"] = blurred.mean_recall();
  }
  masks["recall_measured"] = measured.recall();
  masks["precision_measured"] = measured.precision();
  return masks;
}

void RunRecorder::summarize(Json& stats, bool front_end) const {
  summarize_times(stats);
  stats["lost"] = lost();
  std::map<std::string, int> status;
  MeanOfNumbers extracted, kept, share, restored, sharpness_mean, motion;
  KeypointMetrics tracked_keypoints, judged_keypoints;
  for (const Record& r : records_) {
    for (const std::string& name : status_names(r.status)) ++status[name];
    extracted.add(r.keypoints);
    kept.add(r.kept);
    share.add(r.mask_share);
    restored.add(r.restored);
    tracked_keypoints += r.tracked_keypoints;
    judged_keypoints += r.judged_keypoints;
    sharpness_mean.add(r.sharpness);
    motion.add(r.motion_px);
  }
  stats["blur"] = {{"sharpness", sharpness_mean.value()}, {"motion_px", motion.value()}};
  if (std::isfinite(depth_delay_s_)) stats["depth_delay_s"] = depth_delay_s_;
  if (std::isfinite(depth_readout_s_)) stats["depth_readout_s"] = depth_readout_s_;
  stats["status"] = Json::object();
  for (const auto& [name, count] : status) stats["status"][name] = count;

  // Objects of their own, put in at the end: a reference into an ordered JSON object does not live
  // through the next insertion.
  Json keypoints = {{"extracted", extracted.value()}, {"kept", kept.value()}};
  if (any_truth_) keypoints["kept_on_people"] = tracked_keypoints.share_of_kept_on_people();
  if (front_end) {
    stats["mask_share"] = share.value();
    stats["restored_per_frame"] = restored.value();
  }
  const bool judged = front_end && any_truth_;
  if (judged) {
    keypoints["precision"] = judged_keypoints.counts.precision();
    keypoints["recall"] = judged_keypoints.counts.recall();
    keypoints["f1"] = judged_keypoints.counts.f1();
    keypoints["static_kept"] = judged_keypoints.share_of_static_kept();
  }
  stats["keypoints"] = keypoints;
  if (judged) stats["masks"] = masks();
}

Json RunRecorder::series(bool front_end) const {
  const auto rounded = [](double value, double steps) { return std::round(value * steps) / steps; };
  Json out;
  for (const Record& r : records_) {
    out["t_s"].push_back(rounded(r.timestamp - records_.front().timestamp, 1e6));
    out["sharpness"].push_back(rounded(r.sharpness, 1e3));
    if (front_end) out["motion_px"].push_back(rounded(r.motion_px, 100));
    if (front_end) out["mask_share"].push_back(rounded(r.mask_share, 1e5));
    if (any_truth_)
      out["true_mask_share"].push_back(r.has_truth ? Json(rounded(r.true_share, 1e5)) : Json());
    out["kept"].push_back(r.kept);
    if (!front_end || !any_truth_) continue;
    for (const bool after : {false, true}) {
      const BinaryCounts& counts = after ? r.after : r.before;
      const std::string suffix = after ? "_after" : "_before";
      // A frame without people has no IoU, and nothing to miss.
      const bool people = r.has_truth && r.true_share > 0;
      out["iou" + suffix].push_back(people ? Json(rounded(counts.iou(), 1e4)) : Json());
      out["missed" + suffix].push_back(people ? Json(rounded(1 - counts.recall(), 1e4)) : Json());
    }
  }
  return out;
}

}  // namespace stillpoint::cli
