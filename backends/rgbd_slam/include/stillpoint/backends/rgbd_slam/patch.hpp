// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "stillpoint/backends/rgbd_slam/image_pyramid.hpp"
#include "stillpoint/core/camera.hpp"
#include "stillpoint/core/distortion.hpp"

namespace stillpoint::rgbd_slam {

/// How a point looked when it was first seen.
///
/// A corner detector finds a corner again to within half a pixel or so. Laying the remembered patch
/// onto the image finds it to within a tenth, which halves the error of the trajectory.
struct Patch {
  static constexpr int kSide = 16;
  /// Grey values, row by row; the point lies in the middle, at (7.5, 7.5).
  std::array<std::uint8_t, kSide * kSide> gray{};
  /// The camera that saw it: rotation from world to camera, the point's depth in it, and pixels of
  /// level 0 in one of the patch. Depth 0: there is no patch.
  Eigen::Matrix3f R_camera_world = Eigen::Matrix3f::Identity();
  float depth_m = 0, scale = 1;

  bool empty() const { return depth_m <= 0; }
};

/// Cuts the patch at an undistorted pixel on a pyramid level; an empty one at the image's rim.
inline Patch cut_patch(const ImagePyramid& pyramid, const Camera& camera,
                       const Eigen::Vector2d& pixel, int level,
                       const Eigen::Matrix3d& R_camera_world, double depth_m) {
  Patch patch;
  if (level < 0 || level >= pyramid.levels() || depth_m <= 0) return patch;
  const cv::Mat& image = pyramid.image(level);
  const Eigen::Vector2d p = pyramid.to_level(distort_pixel(camera, pixel), level);
  constexpr double kHalf = Patch::kSide / 2;
  if (!(p.x() > kHalf && p.y() > kHalf && p.x() < image.cols - kHalf - 1 &&
        p.y() < image.rows - kHalf - 1))
    return patch;
  const float x0 = static_cast<float>(p.x()) - 7.5f, y0 = static_cast<float>(p.y()) - 7.5f;
  for (int v = 0; v < Patch::kSide; ++v)
    for (int u = 0; u < Patch::kSide; ++u)
      patch.gray[static_cast<std::size_t>(v * Patch::kSide + u)] = static_cast<std::uint8_t>(
          gray_at(image, x0 + static_cast<float>(u), y0 + static_cast<float>(v)) + 0.5f);
  patch.R_camera_world = R_camera_world.cast<float>();
  patch.depth_m = static_cast<float>(depth_m);
  patch.scale = static_cast<float>(pyramid.scale(level));
  return patch;
}

/// How a step in the patch, taken as parallel to its own image plane, shows on a pyramid level. No
/// value: behind the camera, or much larger or smaller than the patch.
inline std::optional<Eigen::Matrix2d> patch_warp(const Camera& camera, const Patch& patch,
                                                 const Eigen::Isometry3d& T_camera_world,
                                                 const Eigen::Vector3d& point, double level_scale) {
  const Eigen::Matrix3d R =
      T_camera_world.linear() * patch.R_camera_world.cast<double>().transpose();
  const Eigen::Vector3d p = T_camera_world * point;
  if (p.z() < 0.1) return std::nullopt;
  // Where a step of five pixels in the patch goes to.
  const double step = 5.0 * patch.scale * patch.depth_m;
  const Eigen::Vector2d origin = camera.project(p);
  Eigen::Matrix2d warp;
  warp.col(0) = camera.project(p + R.col(0) * (step / camera.fx)) - origin;
  warp.col(1) = camera.project(p + R.col(1) * (step / camera.fy)) - origin;
  warp /= 5.0 * level_scale;
  const double determinant = warp.determinant();
  if (!(determinant > 0.3 && determinant < 3)) return std::nullopt;
  return warp;
}

/// Fills `gray` (Side rows of as many) with the patch as a level shows it; false where the level
/// shows more than the patch holds. `back`: from the level's pixels to the patch's.
template <int Side>
bool warp_patch(const Patch& patch, const Eigen::Matrix2f& back, float (&gray)[Side][Side]) {
  constexpr float kMiddle = 0.5f * (Side - 1);
  const cv::Mat seen(Patch::kSide, Patch::kSide, CV_8UC1, const_cast<uchar*>(patch.gray.data()));
  for (int v = 0; v < Side; ++v)
    for (int u = 0; u < Side; ++u) {
      const Eigen::Vector2f q =
          back * Eigen::Vector2f(static_cast<float>(u) - kMiddle, static_cast<float>(v) - kMiddle);
      const float x = q.x() + 7.5f, y = q.y() + 7.5f;
      if (!(x >= 0 && y >= 0 && x < Patch::kSide - 1 && y < Patch::kSide - 1)) return false;
      gray[v][u] = gray_at(seen, x, y);
    }
  return true;
}

/// Lays a point's patch onto an image near an undistorted pixel and returns the place where it
/// fits.
///
/// The patch is rotated and scaled as the pose says; then place and brightness are fitted (inverse
/// compositional Gauss-Newton on 8 x 8 pixels of the level). No value: it does not fit, or more
/// than two pixels of the level away. Takes about 3 us.
inline std::optional<Eigen::Vector2d> align_patch(const ImagePyramid& pyramid, const Camera& camera,
                                                  const Patch& patch,
                                                  const Eigen::Isometry3d& T_camera_world,
                                                  const Eigen::Vector3d& point,
                                                  const Eigen::Vector2d& pixel, int level) {
  constexpr int kSide = 8, kRim = kSide + 2;
  if (patch.empty() || level < 0 || level >= pyramid.levels()) return std::nullopt;
  const auto warp = patch_warp(camera, patch, T_camera_world, point, pyramid.scale(level));
  float gray[kRim][kRim];  // the template, with a pixel around it for its slopes
  if (!warp || !warp_patch(patch, warp->inverse().cast<float>(), gray)) return std::nullopt;
  float slope_x[kSide * kSide], slope_y[kSide * kSide], value[kSide * kSide];
  Eigen::Matrix3f H = Eigen::Matrix3f::Zero();
  for (int v = 0, n = 0; v < kSide; ++v)
    for (int u = 0; u < kSide; ++u, ++n) {
      slope_x[n] = 0.5f * (gray[v + 1][u + 2] - gray[v + 1][u]);
      slope_y[n] = 0.5f * (gray[v + 2][u + 1] - gray[v][u + 1]);
      value[n] = gray[v + 1][u + 1];
      const Eigen::Vector3f j(slope_x[n], slope_y[n], 1);
      H += j * j.transpose();
    }
  Eigen::Matrix3f inverse;
  bool invertible = false;
  H.computeInverseWithCheck(inverse, invertible, 1e-3f);
  if (!invertible) return std::nullopt;

  const cv::Mat& image = pyramid.image(level);
  const Eigen::Vector2f start = pyramid.to_level(distort_pixel(camera, pixel), level).cast<float>();
  Eigen::Vector2f place = start;
  float brightness = 0;
  for (int iteration = 0; iteration < 10; ++iteration) {
    if (!(place.x() > 5 && place.y() > 5 && place.x() < static_cast<float>(image.cols - 6) &&
          place.y() < static_cast<float>(image.rows - 6)))
      return std::nullopt;
    // All pixels share the fractions between pixels.
    const float x0 = place.x() - 3.5f, y0 = place.y() - 3.5f;
    const int ix = static_cast<int>(x0), iy = static_cast<int>(y0);
    const float a = x0 - static_cast<float>(ix), b = y0 - static_cast<float>(iy);
    const float w00 = (1 - a) * (1 - b), w01 = a * (1 - b), w10 = (1 - a) * b, w11 = a * b;
    float gx = 0, gy = 0, g1 = 0, squares = 0;
    for (int v = 0, n = 0; v < kSide; ++v) {
      const uchar* above = image.ptr<uchar>(iy + v) + ix;
      const uchar* below = image.ptr<uchar>(iy + v + 1) + ix;
      for (int u = 0; u < kSide; ++u, ++n) {
        const float r = w00 * above[u] + w01 * above[u + 1] + w10 * below[u] + w11 * below[u + 1] -
                        value[n] + brightness;
        gx -= r * slope_x[n], gy -= r * slope_y[n], g1 -= r;
        squares += r * r;
      }
    }
    const Eigen::Vector3f delta = inverse * Eigen::Vector3f(gx, gy, g1);
    place += delta.head<2>();
    brightness += delta.z();
    if (delta.head<2>().squaredNorm() > 0.03f * 0.03f) continue;
    constexpr float kMaxResidual = 15;
    if (squares > kMaxResidual * kMaxResidual * kSide * kSide || (place - start).norm() > 2)
      return std::nullopt;
    return undistort_pixel(camera, pyramid.from_level(place.cast<double>(), level));
  }
  return std::nullopt;
}

}  // namespace stillpoint::rgbd_slam
