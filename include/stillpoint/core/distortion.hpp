// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <limits>

#include "stillpoint/core/camera.hpp"

namespace stillpoint {

/// Applies Brown's lens distortion to normalized coordinates (x/z, y/z). O(1).
inline Eigen::Vector2d distort_normalized(const Camera& camera, const Eigen::Vector2d& p) {
  const double x = p.x(), y = p.y(), r2 = x * x + y * y;
  const double radial = 1 + r2 * (camera.k1 + r2 * (camera.k2 + r2 * camera.k3));
  return {x * radial + 2 * camera.p1 * x * y + camera.p2 * (r2 + 2 * x * x),
          y * radial + camera.p1 * (r2 + 2 * y * y) + 2 * camera.p2 * x * y};
}

/// Raw pixel of an undistorted one. O(1).
inline Eigen::Vector2d distort_pixel(const Camera& camera, const Eigen::Vector2d& pixel) {
  if (!camera.distorted()) return pixel;
  const Eigen::Vector2d d = distort_normalized(
      camera, {(pixel.x() - camera.cx) / camera.fx, (pixel.y() - camera.cy) / camera.fy});
  return {camera.fx * d.x() + camera.cx, camera.fy * d.y() + camera.cy};
}

/// Undistorted pixel of a raw one, to within 1e-6 px for lenses whose distortion can be inverted at
/// the pixel (every calibrated camera inside its own image); NaN where it cannot: no ray is seen
/// there. O(1): at most 30 fixed-point steps.
inline Eigen::Vector2d undistort_pixel(const Camera& camera, const Eigen::Vector2d& pixel) {
  if (!camera.distorted()) return pixel;
  const Eigen::Vector2d raw((pixel.x() - camera.cx) / camera.fx,
                            (pixel.y() - camera.cy) / camera.fy);
  constexpr double kGiveUp = 1e-5;  // a focal length of 500 px makes it 0.005 px
  Eigen::Vector2d p = raw, error = raw;
  for (int i = 0; i < 30 && !(error.squaredNorm() < 1e-20); ++i) {
    error = distort_normalized(camera, p) - raw;
    p -= error;
  }
  if (!(error.norm() < kGiveUp)) p.setConstant(std::numeric_limits<double>::quiet_NaN());
  return {camera.fx * p.x() + camera.cx, camera.fy * p.y() + camera.cy};
}

}  // namespace stillpoint
