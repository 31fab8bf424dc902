// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cstddef>
#include <deque>
#include <mutex>
#include <optional>
#include <string>

#include "stillpoint/backends/ros2/messages.hpp"

namespace stillpoint::ros2 {

/// The poses of the last seconds, to be asked for the pose at an image's stamp. Not thread-safe.
class PoseBuffer {
 public:
  /// Poses further apart than `max_gap` are not interpolated.
  explicit PoseBuffer(Nanoseconds max_gap = 200000000, std::size_t most = 1000)
      : max_gap_(max_gap), most_(most) {}

  /// Adds a pose. One that is not newer than the last begins anew (a jump of the clock), or, if it
  /// is within `max_gap`, is left out. O(1).
  void add(Nanoseconds stamp, const Eigen::Isometry3d& T_world_body) {
    if (!T_world_body.matrix().allFinite()) return;
    if (!poses_.empty() && stamp <= poses_.back().stamp) {
      if (poses_.back().stamp - stamp <= max_gap_) return;
      poses_.clear();
    }
    poses_.push_back({stamp, T_world_body});
    if (poses_.size() > most_) poses_.pop_front();
  }

  bool empty() const { return poses_.empty(); }
  /// The stamps of the first and the last pose; not to be asked where there is none.
  Nanoseconds begin() const { return poses_.front().stamp; }
  Nanoseconds end() const { return poses_.back().stamp; }

  /// The pose at `stamp`, between its neighbors; nothing before the first and after the last.
  /// O(log n).
  std::optional<Eigen::Isometry3d> at(Nanoseconds stamp) const {
    const auto after =
        std::lower_bound(poses_.begin(), poses_.end(), stamp,
                         [](const Pose& pose, Nanoseconds t) { return pose.stamp < t; });
    if (after == poses_.end()) return std::nullopt;
    if (after->stamp == stamp) return after->T;
    if (after == poses_.begin()) return std::nullopt;
    const Pose& before = *(after - 1);
    if (after->stamp - before.stamp > max_gap_) return std::nullopt;
    const double a = static_cast<double>(stamp - before.stamp) /
                     static_cast<double>(after->stamp - before.stamp);
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    const Eigen::Quaterniond from(before.T.linear()), to(after->T.linear());
    T.linear() = from.slerp(a, to).toRotationMatrix();
    T.translation() = (1 - a) * before.T.translation() + a * after->T.translation();
    return T;
  }

 private:
  struct Pose {
    Nanoseconds stamp;
    Eigen::Isometry3d T;
  };
  Nanoseconds max_gap_;
  std::size_t most_;
  std::deque<Pose, Eigen::aligned_allocator<Pose>> poses_;
};

/// Odometry as it comes, to be asked where a camera on its body was. Thread-safe.
class OdometryPoses {
 public:
  /// nav_msgs/Odometry: frame_id of its header, child_frame_id, pose.
  void add(Nanoseconds stamp, const std::string& world_frame, const std::string& body_frame,
           const Eigen::Isometry3d& T_world_body) {
    const std::lock_guard<std::mutex> guard(mutex_);
    world_frame_ = world_frame, body_frame_ = body_frame;
    poses_.add(stamp, T_world_body);
  }

  std::string world_frame() const {
    const std::lock_guard<std::mutex> guard(mutex_);
    return world_frame_;
  }

  /// The pose of the frame `camera` at `stamp`. `transform(body, camera, T_body_camera)` says where
  /// the camera is on the body; it returns an empty text, or a problem. So does this; `T` is then
  /// as it was.
  template <class Transform>
  std::string at(Nanoseconds stamp, const std::string& camera, Transform transform,
                 Eigen::Isometry3d& T) const {
    std::unique_lock<std::mutex> guard(mutex_);
    const std::optional<Eigen::Isometry3d> T_world_body = poses_.at(stamp);
    if (!T_world_body)
      return "expected poses before and after the stamp " + detail::text(seconds(stamp)) +
             ", at most 0.2 s apart, found " +
             (poses_.empty() ? "none"
                             : "them from " + detail::text(seconds(poses_.begin())) + " to " +
                                   detail::text(seconds(poses_.end())));
    const std::string body = body_frame_;
    guard.unlock();
    if (body.empty())
      return "expected an odometry whose child_frame_id says which frame its poses are of, found "
             "none";
    Eigen::Isometry3d T_body_camera = Eigen::Isometry3d::Identity();
    if (body != camera) {
      const std::string problem = transform(body, camera, T_body_camera);
      if (!problem.empty()) return problem;
    }
    T = *T_world_body * T_body_camera;
    return "";
  }

 private:
  mutable std::mutex mutex_;
  PoseBuffer poses_;
  std::string world_frame_, body_frame_;
};

}  // namespace stillpoint::ros2
