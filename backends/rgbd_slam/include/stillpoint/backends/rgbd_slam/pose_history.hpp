// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "stillpoint/backends/rgbd_slam/map.hpp"
#include "stillpoint/core/trajectory.hpp"

namespace stillpoint::rgbd_slam {

/// Where each frame was tracked, and the camera's motion. Poses are kept relative to keyframes, so
/// that corrections of these carry them along.
class PoseHistory {
 public:
  Eigen::Isometry3d last_pose(const Map& map) const { return records_.back().pose(map); }

  /// Adds a tracked frame. `in_a_row`: the frame before it was tracked, too.
  void add(const Map& map, KeyframeId reference, double timestamp,
           const Eigen::Isometry3d& T_camera_world, bool in_a_row) {
    motion_.reset();
    if (in_a_row && !records_.empty()) {
      motion_ = T_camera_world * last_pose(map).inverse();
      motion_s_ = timestamp - records_.back().timestamp;
    }
    records_.push_back({timestamp, reference, T_camera_world * map.pose_of(reference).inverse()});
    as_tracked_.push_back({timestamp, T_camera_world.inverse()});
  }

  /// The frames in the order in which they were tracked; find() gives the newest of a time. O(1);
  /// find() is O(frames).
  std::size_t size() const { return records_.size(); }
  double timestamp(std::size_t i) const { return records_[i].timestamp; }
  Eigen::Isometry3d pose(const Map& map, std::size_t i) const { return records_[i].pose(map); }
  std::optional<std::size_t> find(double timestamp) const {
    for (std::size_t i = size(); i-- > 0;)
      if (records_[i].timestamp == timestamp) return i;
    return std::nullopt;
  }
  /// Gives a frame another pose, which is kept relative to `reference`.
  void attach(const Map& map, std::size_t i, KeyframeId reference,
              const Eigen::Isometry3d& T_camera_world) {
    records_[i].reference = reference;
    records_[i].T_camera_reference = T_camera_world * map.pose_of(reference).inverse();
  }

  /// T_next_last, if the last two frames were tracked.
  const std::optional<Eigen::Isometry3d>& motion() const { return motion_; }
  void forget_motion() { motion_.reset(); }

  /// The last motion, stretched by the real time until `timestamp`: frames may be dropped.
  Eigen::Isometry3d motion_until(double timestamp) const {
    if (!motion_) return Eigen::Isometry3d::Identity();
    const double dt = timestamp - records_.back().timestamp;
    const double ratio = motion_s_ > 0 && dt > 0 ? std::min(dt / motion_s_, 10.0) : 1;
    const Eigen::AngleAxisd rotation(motion_->linear());
    return Eigen::Translation3d(motion_->translation() * ratio) *
           Eigen::AngleAxisd(rotation.angle() * ratio, rotation.axis());
  }

  /// Poses of all frames as they were when they were tracked, by time. O(frames).
  Trajectory as_tracked() const { return by_time(as_tracked_); }

  /// Poses of all frames by the keyframes' present poses, by time. O(frames).
  Trajectory trajectory(const Map& map) const {
    Trajectory trajectory;
    trajectory.reserve(records_.size());
    for (const Record& r : records_) trajectory.push_back({r.timestamp, r.pose(map).inverse()});
    return by_time(std::move(trajectory));
  }

 private:
  struct Record {
    double timestamp;
    KeyframeId reference;
    Eigen::Isometry3d T_camera_reference;

    // T_camera_world.
    Eigen::Isometry3d pose(const Map& map) const {
      return T_camera_reference * map.pose_of(reference);
    }
  };

  // A camera's clock may be set back: then the poses from before and after lie between each other.
  // Of two poses at one time the later frame's stays.
  static Trajectory by_time(Trajectory poses) {
    const auto earlier = [](const StampedPose& a, const StampedPose& b) {
      return a.timestamp < b.timestamp;
    };
    if (!std::is_sorted(poses.begin(), poses.end(), earlier))
      std::stable_sort(poses.begin(), poses.end(), earlier);
    const auto first_kept =
        std::unique(poses.rbegin(), poses.rend(), [](const StampedPose& a, const StampedPose& b) {
          return a.timestamp == b.timestamp;
        }).base();
    poses.erase(poses.begin(), first_kept);
    return poses;
  }

  std::vector<Record> records_;
  Trajectory as_tracked_;
  std::optional<Eigen::Isometry3d> motion_;
  double motion_s_ = 0;
};

}  // namespace stillpoint::rgbd_slam
