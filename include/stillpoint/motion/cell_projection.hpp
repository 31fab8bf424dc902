// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>

#include "stillpoint/core/config.hpp"
#include "stillpoint/core/lens.hpp"
#include "stillpoint/motion/depth_cells.hpp"
#include "stillpoint/sensor/sensor_model.hpp"

namespace stillpoint {

/// Carries cells into an earlier depth image, row by row. Its loop has choices between numbers
/// only, so that compilers make vector instructions of it.
class CellProjection {
 public:
  /// Depth of a cell that was not measured or lies too near, metres: beyond everything.
  static constexpr float kBeyond = 1e9f;

  CellProjection(const DepthCells& cells, const Eigen::Isometry3d& T_view_now,
                 const SensorModel& sensor)
      : cells_(cells),
        R_(T_view_now.linear().cast<float>()),
        t_(T_view_now.translation().cast<float>()),
        nearest_(static_cast<float>(sensor.min_range_m)),
        floor2_(square(sensor, sensor.depth_floor_m)),
        slope2_(square(sensor, sensor.depth_slope)),
        square2_(square(sensor, sensor.depth_square)) {}

  /// Of a row of cells: the cell that each falls on (at the rim, if it falls beside the image), its
  /// depth there in metres, and the square of the least step that is not noise there.
  void row(int y, int* cell, float* z, float* least_step2) const {
    const std::size_t first = cells_.index(0, y);
    project(&cells_.ray_x[first], &cells_.ray_y[first], &cells_.depth_m[first], cell, z,
            least_step2);
  }

 private:
  static float square(const SensorModel& sensor, double sigma) {
    return static_cast<float>(sensor.sigmas * sensor.sigmas * sigma * sigma);
  }

  void project(const float* STILLPOINT_RESTRICT ray_x, const float* STILLPOINT_RESTRICT ray_y,
               const float* STILLPOINT_RESTRICT depth, int* STILLPOINT_RESTRICT cell,
               float* STILLPOINT_RESTRICT z, float* STILLPOINT_RESTRICT least_step2) const {
    const float r00 = R_(0, 0), r01 = R_(0, 1), r02 = R_(0, 2), r10 = R_(1, 0), r11 = R_(1, 1),
                r12 = R_(1, 2), r20 = R_(2, 0), r21 = R_(2, 1), r22 = R_(2, 2), tx = t_.x(),
                ty = t_.y(), tz = t_.z();
    const Lens::Coefficients lens = cells_.distortion;
    // Half a cell added: to be rounded down.
    const float fx = cells_.fx, fy = cells_.fy, cx = cells_.cx + 0.5f, cy = cells_.cy + 0.5f;
    const float nearest = nearest_, floor2 = floor2_, slope2 = slope2_, square2 = square2_;
    const int width = cells_.width;
    const float right = static_cast<float>(width) - 1;
    const float bottom = static_cast<float>(cells_.height) - 1;
    for (int i = 0; i < width; ++i) {
      const float a = ray_x[i], b = ray_y[i], d = depth[i];
      const float pz = (r20 * a + r21 * b + r22) * d + tz, inverse = 1 / pz;
      const float x = ((r00 * a + r01 * b + r02) * d + tx) * inverse;
      const float y = ((r10 * a + r11 * b + r12) * d + ty) * inverse;
      const float xx = x * x, yy = y * y, xy = x * y, r_square = xx + yy;
      const float r2 = r_square < lens.most_square ? r_square : lens.most_square;
      const float radial = 1 + r2 * (lens.k1 + r2 * (lens.k2 + r2 * lens.k3));
      const float u = fx * (x * radial + 2 * lens.p1 * xy + lens.p2 * (r2 + 2 * xx)) + cx;
      const float v = fy * (y * radial + lens.p1 * (r2 + 2 * yy) + 2 * lens.p2 * xy) + cy;
      const float from_left = u > 0 ? u : 0, from_top = v > 0 ? v : 0;  // 0 for NaN
      const float column = from_left < right ? from_left : right;
      const float line = from_top < bottom ? from_top : bottom;
      cell[i] = static_cast<int>(line) * width + static_cast<int>(column);
      const float measured = d > 0 ? pz : kBeyond;
      z[i] = pz < nearest ? kBeyond : measured;
      const float zz = pz * pz;
      least_step2[i] = floor2 + zz * (slope2 + zz * square2);
    }
  }

  const DepthCells& cells_;
  Eigen::Matrix3f R_;
  Eigen::Vector3f t_;
  float nearest_, floor2_, slope2_, square2_;  // of the sensor, squared and times the sigmas
};

}  // namespace stillpoint
