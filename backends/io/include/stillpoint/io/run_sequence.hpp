// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <chrono>
#include <cstddef>
#include <exception>
#include <filesystem>
#include <functional>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "stillpoint/core/frame.hpp"
#include "stillpoint/core/mask.hpp"
#include "stillpoint/core/selection.hpp"
#include "stillpoint/core/trajectory.hpp"
#include "stillpoint/io/trajectory_file.hpp"
#include "stillpoint/io/tum_sequence.hpp"
#include "stillpoint/tracking/tracker.hpp"

namespace stillpoint {

/// Takes the place of a front end: nothing is dynamic, every keypoint is kept. For a tracker as it
/// is alone.
class NoFrontEnd {
 public:
  const DynamicMask& compute_mask(const RgbdFrame& frame, const std::optional<Eigen::Isometry3d>&) {
    mask_.timestamp = frame.timestamp;
    return mask_;
  }
  const Selection& select(const std::vector<cv::KeyPoint>& keypoints) {
    selection_.probability.assign(keypoints.size(), 0.0f);
    selection_.reason.assign(keypoints.size(), KeypointReason::kStatic);
    selection_.kept.resize(keypoints.size());
    for (std::size_t i = 0; i < keypoints.size(); ++i) selection_.kept[i] = static_cast<int>(i);
    return selection_;
  }
  void correct_pose(const Eigen::Isometry3d&) {}

 private:
  DynamicMask mask_;
  Selection selection_;
};

/// What became of a frame. Valid until the function that is given it returns.
struct TrackedFrame {
  /// In the sequence.
  std::size_t index;
  const RgbdFrame& frame;
  const DynamicMask& mask;
  const std::vector<cv::KeyPoint>& keypoints;
  const Selection& selection;
  /// No value: the tracker is lost.
  const std::optional<Eigen::Isometry3d>& T_world_camera;
  /// Time that the tracker took, and front end and tracker together, without reading the images.
  double extraction_ms, tracking_ms, total_ms;
};

/// What run_sequence() does beside running; nothing needs to be set.
struct SequenceRun {
  /// Only so many frames; 0: all.
  std::size_t frames = 0;
  /// The trajectory is written here when the run is done (TUM format). Empty: it is not written. A
  /// run that breaks off leaves this file alone and writes what was tracked to FILE.partial.
  std::filesystem::path trajectory = {};
  /// Called before entry i is read; returns the entry to take in its place, i or a later one. (A
  /// robot that is late drops frames.)
  std::function<std::size_t(std::size_t i)> choose = {};
  /// Called when the images of entry i are read, before the frame runs through.
  std::function<void(std::size_t i, const RgbdFrame& frame)> loaded = {};
  /// Called after each frame.
  std::function<void(const TrackedFrame&)> tracked = {};
};

namespace detail {

/// After a failure, which is the message that counts: one about this file would hide it.
inline void keep_tracked(Tracker& tracker, const std::filesystem::path& file) {
  if (file.empty()) return;
  try {
    tracker.finish();
    const Trajectory poses = tracker.trajectory();
    if (!poses.empty()) write_trajectory(file.string() + ".partial", poses);
  } catch (const std::exception&) {
  }
}

}  // namespace detail

/// Runs front end and tracker over a sequence: for each frame the mask, the keypoints outside it,
/// their selection, the pose, and the pose back to the front end. `front_end`: FrontEnd, or
/// NoFrontEnd for the tracker alone. Returns the final poses of all tracked frames.
///
///     FrontEnd front_end(FrontEndSettings(), camera, &segmenter);
///     MyTracker tracker(camera);
///     SequenceRun run;
///     run.trajectory = "trajectory.txt";
///     run_sequence(TumSequence("walk"), front_end, tracker, run);
///
/// Throws Error for images that cannot be read (see TumSequence::load()), and what the tracker
/// throws.
template <class AnyFrontEnd>
Trajectory run_sequence(const TumSequence& sequence, AnyFrontEnd& front_end, Tracker& tracker,
                        const SequenceRun& run = {}) {
  using Clock = std::chrono::steady_clock;
  const auto ms = [](Clock::time_point from, Clock::time_point to) {
    return std::chrono::duration<double, std::milli>(to - from).count();
  };
  const std::size_t count =
      run.frames > 0 ? std::min(run.frames, sequence.size()) : sequence.size();
  try {
    for (std::size_t i = 0; i < count; ++i) {
      if (run.choose) i = run.choose(i);
      const RgbdFrame frame = sequence.load(i);
      if (run.loaded) run.loaded(i, frame);
      const Clock::time_point start = Clock::now();
      const DynamicMask& mask = front_end.compute_mask(frame, tracker.predicted_motion());
      const Clock::time_point masked = Clock::now();
      const std::vector<cv::KeyPoint>& keypoints = tracker.extract(frame, mask);
      const Clock::time_point extracted = Clock::now();
      const Selection& selection = front_end.select(keypoints);
      const Clock::time_point selected = Clock::now();
      const std::optional<Eigen::Isometry3d> pose = tracker.track(frame, mask, selection);
      if (pose) front_end.correct_pose(*pose);
      const Clock::time_point end = Clock::now();
      if (run.tracked)
        run.tracked({i, frame, mask, keypoints, selection, pose, ms(masked, extracted),
                     ms(selected, end), ms(start, end)});
    }
    tracker.finish();
  } catch (const std::exception&) {
    detail::keep_tracked(tracker, run.trajectory);
    throw;
  }
  Trajectory trajectory = tracker.trajectory();
  if (!run.trajectory.empty()) write_trajectory(run.trajectory, trajectory);
  return trajectory;
}

}  // namespace stillpoint
