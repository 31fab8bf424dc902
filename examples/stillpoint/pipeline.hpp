// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <chrono>
#include <optional>
#include <vector>

#include "stillpoint/front_end.hpp"
#include "stillpoint/tracking/tracker.hpp"

namespace stillpoint::cli {

/// Wall-clock times of one frame, milliseconds. Reading and writing files is not in them, save the
/// masks that the `mask_files` segmenter reads.
struct StageTimes {
  double segmentation = 0, motion = 0, compensation = 0, depth = 0, probability = 0;
  double extraction = 0, tracking = 0;
  /// From the frame's arrival to its pose.
  double total = 0;
};

/// The whole system on one frame after another: segmenter, front end and tracker in a row.
///
/// This is what a robot's main loop looks like:
///
///     Pipeline pipeline(settings, camera, &segmenter, tracker);
///     while (next(frame)) pipeline.process(frame);
///     tracker.finish();
class Pipeline {
 public:
  /// Without `front_end` nothing is dynamic and every keypoint is kept: the tracker as it would
  /// be alone. `segmenter` may be null (no masks); it and `tracker` must outlive the pipeline.
  Pipeline(const FrontEndSettings& settings, bool use_front_end, const Camera& camera,
           Segmenter* segmenter, Tracker& tracker)
      : use_front_end_(use_front_end), front_end_(settings, camera, segmenter), tracker_(tracker) {}

  /// Runs one frame through; false if the tracker is lost. Throws Error for a frame that breaks
  /// RgbdFrame's rules.
  bool process(const RgbdFrame& frame) {
    const auto start = Clock::now();
    if (use_front_end_)
      mask_ = front_end_.compute_mask(frame, tracker_.predicted_motion());
    else
      mask_.timestamp = frame.timestamp;
    const auto before_extraction = Clock::now();
    keypoints_ = &tracker_.extract(frame, mask_);
    const auto before_selection = Clock::now();
    selection_ = use_front_end_ ? &front_end_.select(*keypoints_) : keep_all(keypoints_->size());
    const auto before_tracking = Clock::now();
    pose_ = tracker_.track(frame, mask_, *selection_);
    if (use_front_end_ && pose_) front_end_.correct_pose(*pose_);
    const auto end = Clock::now();

    times_ = {};
    if (use_front_end_) {
      times_.segmentation = stats().segmentation_ms;
      times_.motion = stats().motion_ms;
      times_.compensation = stats().compensation_ms;
      times_.depth = stats().depth_ms;
      times_.probability = stats().probability_ms;
    }
    times_.extraction = milliseconds(before_extraction, before_selection);
    times_.tracking = milliseconds(before_tracking, end);
    times_.total = milliseconds(start, end);
    return pose_.has_value();
  }

  // What the last frame gave; valid until the next process().
  const DynamicMask& mask() const { return mask_; }
  const std::vector<cv::KeyPoint>& keypoints() const { return *keypoints_; }
  const Selection& selection() const { return *selection_; }
  const std::optional<Eigen::Isometry3d>& pose() const { return pose_; }
  const StageTimes& times() const { return times_; }
  const FrontEnd& front_end() const { return front_end_; }
  const FrameStats& stats() const { return front_end_.stats(); }
  bool uses_front_end() const { return use_front_end_; }

 private:
  using Clock = std::chrono::steady_clock;

  static double milliseconds(Clock::time_point from, Clock::time_point to) {
    return std::chrono::duration<double, std::milli>(to - from).count();
  }

  const Selection* keep_all(std::size_t count) {
    all_.probability.assign(count, 0.0f);
    all_.reason.assign(count, KeypointReason::kStatic);
    all_.kept.resize(count);
    for (std::size_t i = 0; i < count; ++i) all_.kept[i] = static_cast<int>(i);
    return &all_;
  }

  bool use_front_end_;
  FrontEnd front_end_;
  Tracker& tracker_;
  DynamicMask mask_;
  const std::vector<cv::KeyPoint>* keypoints_ = nullptr;
  const Selection* selection_ = nullptr;
  Selection all_;
  std::optional<Eigen::Isometry3d> pose_;
  StageTimes times_;
};

}  // namespace stillpoint::cli
