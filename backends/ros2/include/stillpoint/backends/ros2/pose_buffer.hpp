// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cstddef>
#include <deque>
#include <optional>

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

}  // namespace stillpoint::ros2
