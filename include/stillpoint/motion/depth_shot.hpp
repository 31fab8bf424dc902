// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace stillpoint {

/// When, where and how a depth image was taken.
struct DepthShot {
  double timestamp = 0;
  /// The depth camera's pose in the map when the middle row was read out.
  Eigen::Isometry3d T_map_depth = Eigen::Isometry3d::Identity();
  /// How far, in cells, its surfaces may lie beside where they are drawn.
  Eigen::Vector2f lateral_cells = Eigen::Vector2f::Zero();
  /// The camera's angular velocity in its own axes, rad/s.
  Eigen::Vector3f rad_s = Eigen::Vector3f::Zero();
  /// From the first to the last row, seconds; 0: all at once, or not known.
  float readout_s = 0;

  /// Whether rows lie beside each other by what matters.
  bool is_skewed() const {
    return readout_s * readout_s * rad_s.squaredNorm() > kLeastSkew * kLeastSkew;
  }
  /// Maps points that a row saw into the camera of the middle row. `row` from -0.5 (first) to 0.5.
  Eigen::Matrix3f middle_of_row(float row) const {
    const Eigen::Vector3f a = row * readout_s * rad_s;
    Eigen::Matrix3f cross;
    cross << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
    return Eigen::Matrix3f::Identity() + cross + 0.5f * cross * cross;
  }

 private:
  static constexpr float kLeastSkew = 0.001f;  // rad: a tenth of a cell at a rim
};

}  // namespace stillpoint
