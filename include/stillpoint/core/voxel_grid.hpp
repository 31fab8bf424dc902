// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>

#include "stillpoint/core/error.hpp"

namespace stillpoint::detail {

/// Numbers the cubes that space is divided into.
class VoxelGrid {
 public:
  explicit VoxelGrid(double side_m) : side_m_(side_m) {}

  /// Throws Error for a camera's pose with a number that is not finite, or so far from the origin
  /// that voxels would get the same number, and points, as floats, the same place.
  void check_pose(const char* who, const Eigen::Isometry3d& T_world_camera) const {
    check(T_world_camera.matrix().allFinite(), [&] {
      return std::string(who) +
             ": T_world_camera: expected a rotation and a translation, found NaN or infinity; "
             "leave out frames without a pose";
    });
    const Eigen::Vector3d place = T_world_camera.translation();
    check(place.cwiseAbs().maxCoeff() <= reach_m(), [&] {
      return std::string(who) + ": T_world_camera: expected a place within " +
             std::to_string(reach_m()) + " m of the origin on each axis (2^19 voxels), found (" +
             std::to_string(place.x()) + ", " + std::to_string(place.y()) + ", " +
             std::to_string(place.z()) + "); take the first pose for the origin";
    });
  }

  /// The voxel that holds `p`, `steps` further.
  std::uint64_t key(const Eigen::Vector3d& p,
                    const Eigen::Vector3i& steps = Eigen::Vector3i::Zero()) const {
    std::uint64_t key = 0;
    for (int a = 0; a < 3; ++a) {
      const double voxel = std::floor(p[a] / side_m_) + steps[a] + (1 << 20);
      key = key << 21 | static_cast<std::uint64_t>(std::clamp(voxel, 0.0, 2097151.0));
    }
    return key;
  }

 private:
  // Half of what the key has room for; the other half is for what the camera sees from there.
  double reach_m() const { return (1 << 19) * side_m_; }

  double side_m_;
};

}  // namespace stillpoint::detail
