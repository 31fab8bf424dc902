// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
#include <cmath>
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

namespace detail {

// Derivative of distort_normalized().
inline Eigen::Matrix2d distortion_slope(const Camera& camera, const Eigen::Vector2d& p) {
  const double x = p.x(), y = p.y(), r2 = x * x + y * y;
  const double radial = 1 + r2 * (camera.k1 + r2 * (camera.k2 + r2 * camera.k3));
  const double change = camera.k1 + r2 * (2 * camera.k2 + r2 * 3 * camera.k3);  // by r2
  const double across = 2 * (x * y * change + camera.p1 * x + camera.p2 * y);
  Eigen::Matrix2d slope;
  slope << radial + 2 * x * x * change + 2 * camera.p1 * y + 6 * camera.p2 * x, across, across,
      radial + 2 * y * y * change + 6 * camera.p1 * y + 2 * camera.p2 * x;
  return slope;
}

// Whether the radial distortion grows all the way: it does not fold back before.
inline bool grows_until(const Camera& camera, double r2_end) {
  const double most_bent =
      r2_end * (3 * std::abs(camera.k1) +
                r2_end * (5 * std::abs(camera.k2) + r2_end * 7 * std::abs(camera.k3)));
  if (most_bent < 1) return true;  // as nearly always: trackers ask for each keypoint
  for (int i = 1; i <= 32; ++i) {
    const double r2 = r2_end * i / 32;
    if (!(1 + r2 * (3 * camera.k1 + r2 * (5 * camera.k2 + r2 * 7 * camera.k3)) > 0)) return false;
  }
  return true;
}

}  // namespace detail

/// Raw pixel of an undistorted one. O(1).
inline Eigen::Vector2d distort_pixel(const Camera& camera, const Eigen::Vector2d& pixel) {
  if (!camera.distorted()) return pixel;
  const Eigen::Vector2d d = distort_normalized(
      camera, {(pixel.x() - camera.cx) / camera.fx, (pixel.y() - camera.cy) / camera.fy});
  return {camera.fx * d.x() + camera.cx, camera.fy * d.y() + camera.cy};
}

/// Undistorted pixel of a raw one, to within 1e-6 px for lenses whose distortion can be inverted at
/// the pixel (every calibrated camera inside its own image); NaN where it cannot: no ray is seen
/// there. O(1): at most 30 fixed-point steps and, where these fail, 30 of Newton's.
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
  if (!(error.squaredNorm() < 1e-18)) {
    // Where the distortion grows fast these steps go too far; Newton's arrive.
    p = error = raw;
    for (int i = 0; i < 30 && !(error.squaredNorm() < 1e-20); ++i) {
      error = distort_normalized(camera, p) - raw;
      p -= detail::distortion_slope(camera, p).inverse() * error;
    }
  }
  if (!(error.norm() < kGiveUp) || !detail::grows_until(camera, p.squaredNorm()))
    p.setConstant(std::numeric_limits<double>::quiet_NaN());
  return {camera.fx * p.x() + camera.cx, camera.fy * p.y() + camera.cy};
}

}  // namespace stillpoint
