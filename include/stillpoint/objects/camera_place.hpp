// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <optional>

namespace stillpoint {

/// Where the camera was at a frame.
struct CameraPlace {
  /// At the color image and at the depth image (see RgbdFrame::depth_timestamp), in a world whose
  /// origin stays the same as long as `chain` does.
  Eigen::Isometry3d T_world_camera = Eigen::Isometry3d::Identity();
  Eigen::Isometry3d T_world_depth = Eigen::Isometry3d::Identity();
  int chain = 0;
  /// Maps that world into the host's; empty: not known.
  std::optional<Eigen::Isometry3d> T_host_world;
};

}  // namespace stillpoint
