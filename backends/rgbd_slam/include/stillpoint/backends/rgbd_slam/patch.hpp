// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <array>
#include <cmath>
#include <cstddef>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "stillpoint/backends/rgbd_slam/image_pyramid.hpp"
#include "stillpoint/core/camera.hpp"
#include "stillpoint/core/distortion.hpp"
#include "stillpoint/motion/patch_shift.hpp"

namespace stillpoint::rgbd_slam {

/// How a point looked when it was first seen.
///
/// A corner detector finds a corner again to within half a pixel or so. Laying the remembered patch
/// onto the image finds it to within a tenth, which halves the error of the trajectory.
struct Patch {
  static constexpr int kSide = 16;
  /// Grey values, row by row; the point lies in the middle, at (7.5, 7.5).
  std::array<float, kSide * kSide> gray{};
  /// The camera that saw it: rotation from world to camera, the point's depth in it, and pixels of
  /// level 0 in one of the patch. Depth 0: there is no patch.
  Eigen::Matrix3f R_camera_world = Eigen::Matrix3f::Identity();
  float depth_m = 0, scale = 1;

  bool empty() const { return depth_m <= 0; }

  /// Between pixels; the caller keeps 0 <= x, y < kSide - 1.
  float gray_at(float x, float y) const {
    const int ix = static_cast<int>(x), iy = static_cast<int>(y);
    const float a = x - static_cast<float>(ix), b = y - static_cast<float>(iy);
    const float* above = &gray[static_cast<std::size_t>(iy * kSide + ix)];
    const float* below = above + kSide;
    const float top = above[0] + a * (above[1] - above[0]);
    return top + b * (below[0] + a * (below[1] - below[0]) - top);
  }
};

/// Cuts the patch of an image (CV_32FC1) at an undistorted pixel on a pyramid level; an empty one
/// at the image's rim.
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
  cv::Mat gray(Patch::kSide, Patch::kSide, CV_32FC1, patch.gray.data());
  cv::getRectSubPix(image, gray.size(), cv::Point2d(p.x(), p.y()), gray);
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

/// The patch as a level shows it, with a pixel around it for its slopes; no value where the level
/// shows more than the patch holds. `back`: from the level's pixels to the patch's.
inline std::optional<stillpoint::detail::Patch> warp_patch(const Patch& patch,
                                                           const Eigen::Matrix2f& back) {
  constexpr int kRim = stillpoint::detail::Patch::kSide + 2;
  std::array<float, kRim * kRim> gray;
  for (int v = 0, n = 0; v < kRim; ++v)
    for (int u = 0; u < kRim; ++u, ++n) {
      const Eigen::Vector2f q =
          back * Eigen::Vector2f(static_cast<float>(u) - 4.5f, static_cast<float>(v) - 4.5f);
      const float x = q.x() + 7.5f, y = q.y() + 7.5f;
      if (!(x >= 0 && y >= 0 && x < Patch::kSide - 1 && y < Patch::kSide - 1)) return std::nullopt;
      gray[static_cast<std::size_t>(n)] = patch.gray_at(x, y);
    }
  stillpoint::detail::Patch warped;
  warped.set(&gray[kRim + 1], kRim);
  return warped;
}

/// Lays a point's patch onto an image near an undistorted pixel and returns the place where it
/// fits.
///
/// The patch is rotated and scaled as the pose says; then place and brightness are fitted. No
/// value: it does not fit, or more than two pixels of the level away. Takes about 3 us.
inline std::optional<Eigen::Vector2d> align_patch(const ImagePyramid& pyramid, const Camera& camera,
                                                  const Patch& patch,
                                                  const Eigen::Isometry3d& T_camera_world,
                                                  const Eigen::Vector3d& point,
                                                  const Eigen::Vector2d& pixel, int level) {
  if (patch.empty() || level < 0 || level >= pyramid.levels()) return std::nullopt;
  const auto warp = patch_warp(camera, patch, T_camera_world, point, pyramid.scale(level));
  if (!warp) return std::nullopt;
  const auto warped = warp_patch(patch, warp->inverse().cast<float>());
  if (!warped) return std::nullopt;
  const Eigen::Vector2f start = pyramid.to_level(distort_pixel(camera, pixel), level).cast<float>();
  // The middle of its 8 x 8 pixels.
  float x = start.x() - 3.5f, y = start.y() - 3.5f;
  if (!warped->align(pyramid.image(level), 0.03f, x, y)) return std::nullopt;
  const Eigen::Vector2f place(x + 3.5f, y + 3.5f);
  if ((place - start).norm() > 2) return std::nullopt;
  const Eigen::Vector2d flat =
      undistort_pixel(camera, pyramid.from_level(place.cast<double>(), level));
  return flat.allFinite() ? std::optional(flat) : std::nullopt;
}

}  // namespace stillpoint::rgbd_slam
