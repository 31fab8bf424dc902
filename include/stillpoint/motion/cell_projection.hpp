// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>

#include "stillpoint/core/config.hpp"
#include "stillpoint/core/lens.hpp"
#include "stillpoint/motion/depth_cells.hpp"
#include "stillpoint/motion/depth_shot.hpp"
#include "stillpoint/sensor/sensor_model.hpp"

namespace stillpoint {

/// Carries cells into an earlier depth image, row by row. Its loop has choices between numbers
/// only, so that compilers make vector instructions of it.
class CellProjection {
 public:
  /// Depth of a cell that lies too near, metres: beyond everything.
  static constexpr float kBeyond = 1e9f;

  CellProjection(const DepthCells& cells, const DepthShot& now, const DepthShot& view,
                 const SensorModel& sensor)
      : cells_(cells),
        now_(now),
        view_(view),
        T_view_now_((view.T_map_depth.inverse() * now.T_map_depth).cast<float>()),
        skewed_(now.is_skewed() || view.is_skewed()),
        nearest_(static_cast<float>(sensor.min_range_m)),
        floor2_(square(sensor, sensor.depth_floor_m)),
        slope2_(square(sensor, sensor.depth_slope)),
        square2_(square(sensor, sensor.depth_square)) {}

  /// Of n cells of row y, with their rays and their depth in metres: the cell that each falls on
  /// (at the rim, if it falls beside the image), its depth there in metres, and the square of the
  /// least step that is not noise there.
  void row(int y, std::size_t n, const float* ray_x, const float* ray_y, const float* depth_m,
           int* cell, float* z, float* least_step2) const {
    project(skewed_ ? of_row(y) : T_view_now_, n, ray_x, ray_y, depth_m, cell, z, least_step2);
  }

 private:
  static float square(const SensorModel& sensor, double sigma) {
    return static_cast<float>(sensor.sigmas * sensor.sigmas * sigma * sigma);
  }

  // The motion of a row that was read out at its own moment, into the row of the view on which its
  // middle falls: there, both rows lie much alike.
  Eigen::Isometry3f of_row(int y) const {
    Eigen::Isometry3f T = T_view_now_;
    T.linear() = T.linear() * now_.middle_of_row(cells_.row_share(static_cast<float>(y)));
    const std::size_t middle = cells_.index(cells_.width / 2, y);
    const Eigen::Vector3f ray(cells_.ray_x[middle], cells_.ray_y[middle], 1),
        seen = T.linear() * ray;
    if (!(seen.z() > 0)) return T;
    const float row =
        cells_.row_share(cells_.cell(seen.x() / seen.z(), seen.y() / seen.z()).second);
    return view_.middle_of_row(row).transpose() * T;
  }

  STILLPOINT_ROW_LOOP void project(const Eigen::Isometry3f& T, std::size_t n,
                                   const float* STILLPOINT_RESTRICT ray_x,
                                   const float* STILLPOINT_RESTRICT ray_y,
                                   const float* STILLPOINT_RESTRICT depth,
                                   int* STILLPOINT_RESTRICT cell, float* STILLPOINT_RESTRICT z,
                                   float* STILLPOINT_RESTRICT least_step2) const {
    const float r00 = T(0, 0), r01 = T(0, 1), r02 = T(0, 2), r10 = T(1, 0), r11 = T(1, 1),
                r12 = T(1, 2), r20 = T(2, 0), r21 = T(2, 1), r22 = T(2, 2), tx = T(0, 3),
                ty = T(1, 3), tz = T(2, 3);
    const Lens::Coefficients lens = cells_.distortion;
    // Half a cell added: to be rounded down.
    const float fx = cells_.fx, fy = cells_.fy, cx = cells_.cx + 0.5f, cy = cells_.cy + 0.5f;
    const float nearest = nearest_, floor2 = floor2_, slope2 = slope2_, square2 = square2_;
    const int width = cells_.width;
    const float right = static_cast<float>(width) - 1;
    const float bottom = static_cast<float>(cells_.height) - 1;
    for (std::size_t i = 0; i < n; ++i) {
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
      z[i] = pz < nearest ? kBeyond : pz;
      const float zz = pz * pz;
      least_step2[i] = floor2 + zz * (slope2 + zz * square2);
    }
  }

  const DepthCells& cells_;
  const DepthShot &now_, &view_;
  Eigen::Isometry3f T_view_now_;
  bool skewed_;                                // rows lie beside each other
  float nearest_, floor2_, slope2_, square2_;  // of the sensor, squared and times the sigmas
};

}  // namespace stillpoint
