// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cstddef>
#include <mutex>
#include <optional>
#include <utility>
#include <vector>

#include "stillpoint/backends/rgbd_slam/frame_clock.hpp"
#include "stillpoint/backends/rgbd_slam/frame_record.hpp"
#include "stillpoint/backends/rgbd_slam/start_review.hpp"
#include "stillpoint/backends/rgbd_slam/threads.hpp"
#include "stillpoint/core/trajectory.hpp"

namespace stillpoint::rgbd_slam {

/// Where each frame was tracked, and the camera's motion. Poses are kept relative to keyframes, so
/// that corrections of these carry them along.
class PoseHistory {
 public:
  bool empty() const { return records_.empty(); }
  Eigen::Isometry3d last_pose(const Map& map) const { return records_.back().pose(map); }

  /// Adds a tracked frame. `in_a_row`: the frame before it was tracked, too.
  void add(const Map& map, KeyframeId reference, const TrackedFrame& frame, bool in_a_row) {
    motion_.reset();
    if (in_a_row && !records_.empty()) {
      motion_ = frame.T_camera_world * last_pose(map).inverse();
      motion_s_ = frame.frame.timestamp - records_.back().timestamp();
    }
    records_.emplace_back(map, reference, frame);
    as_tracked_.push_back({frame.frame.timestamp, frame.T_camera_world.inverse()});
  }

  /// T_next_last, if the last two frames were tracked.
  const std::optional<Eigen::Isometry3d>& motion() const { return motion_; }
  void forget_motion() { motion_.reset(); }

  /// The last motion, stretched by the real time until `timestamp`: frames may be dropped.
  Eigen::Isometry3d motion_until(double timestamp) const {
    if (!motion_) return Eigen::Isometry3d::Identity();
    const double dt = timestamp - records_.back().timestamp();
    const double ratio = motion_s_ > 0 && dt > 0 ? std::min(dt / motion_s_, 10.0) : 1;
    const Eigen::AngleAxisd rotation(motion_->linear());
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.linear() = Eigen::AngleAxisd(rotation.angle() * ratio, rotation.axis()).toRotationMatrix();
    T.translation() = motion_->translation() * ratio;
    return T;
  }

  /// Whether the next frame is one of the first, which are judged again: see StartReview.
  bool at_start(double timestamp) const { return StartReview::wants(records_, timestamp); }
  /// Keeps the frame that was added last, as it was before its keypoints were aligned.
  void keep_for_review(KeypointFrame frame, const cv::Mat& gray, bool keyframe) {
    start_.keep(std::move(frame), gray, records_.size() - 1, keyframe);
  }
  /// Judges the first frames again once enough is known; `lock` is the map's.
  void review_start(const CameraModel& model, Map& map, FairMutex& lock) {
    start_.run(model, map, lock, records_);
  }

  /// Refines the poses of those frames that are old enough for the map around them to be known well
  /// (`all`: of all that are left); see FrameRecord::settle(). `lock` is the map's, held for one
  /// frame (about 0.3 ms) at a time.
  void settle(const CameraModel& model, const Map& map, FairMutex& lock, bool all = false) {
    for (;;) {
      const std::lock_guard<FairMutex> guard(lock);
      if (!(all ? settled_ < records_.size() : settle_due())) return;
      records_[settled_++].settle(model, map);
    }
  }

  /// How many of the frames, the first ones, are settled.
  std::size_t settled() const { return settled_; }

  /// Poses of all frames as they were when they were tracked.
  const Trajectory& as_tracked() const { return as_tracked_; }

  /// Poses of all frames by the keyframes' present poses. O(frames).
  Trajectory trajectory(const Map& map) const {
    Trajectory trajectory;
    trajectory.reserve(records_.size());
    for (const FrameRecord& r : records_)
      trajectory.push_back({r.timestamp(), r.pose(map).inverse()});
    return trajectory;
  }

 private:
  // After which those points that a frame saw are known as well as they will be.
  static constexpr double kSettleAfterS = 3;
  // That wait to be settled, each with what it saw (about 40 KB): the frames of 3 s at 120 Hz.
  static constexpr std::size_t kMostUnsettled = 360;

  bool settle_due() const {
    if (settled_ >= records_.size()) return false;
    const double age_s = records_.back().timestamp() - records_[settled_].timestamp();
    return FrameClock::reached(age_s, kSettleAfterS) || records_.size() - settled_ > kMostUnsettled;
  }

  std::vector<FrameRecord> records_;
  Trajectory as_tracked_;
  std::size_t settled_ = 0;  // records_ before
  StartReview start_;
  std::optional<Eigen::Isometry3d> motion_;
  double motion_s_ = 0;
};

}  // namespace stillpoint::rgbd_slam
