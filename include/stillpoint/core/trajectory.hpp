// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <vector>

namespace stillpoint {

/// A camera pose at a time.
struct StampedPose {
  /// Seconds.
  double timestamp = 0;
  /// Maps points from camera coordinates (x right, y down, z forward) to the world, metres.
  Eigen::Isometry3d T_world_camera = Eigen::Isometry3d::Identity();
};

/// Poses of the tracked frames only, in the order of time. A lost frame has no entry.
using Trajectory = std::vector<StampedPose>;

}  // namespace stillpoint
