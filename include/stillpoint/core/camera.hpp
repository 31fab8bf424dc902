// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <opencv2/core.hpp>
#include <string>

#include "stillpoint/core/error.hpp"

namespace stillpoint {

/// Pinhole camera with Brown distortion (OpenCV order k1, k2, p1, p2, k3).
///
/// Axes: x right, y down, z forward. Focal lengths and principal point in pixels, pixel centres at
/// whole numbers. All five coefficients 0: the image is undistorted.
struct Camera {
  double fx = 0, fy = 0, cx = 0, cy = 0;
  double k1 = 0, k2 = 0, p1 = 0, p2 = 0, k3 = 0;
  int width = 0, height = 0;
  double fps = 30;
  /// Units of a 16-bit depth image per metre: 5000 for TUM and Bonn, 1000 for millimetres.
  double depth_units_per_m = 5000;
  /// Exposure time; 0 when unknown.
  double exposure_s = 0;

  bool valid() const { return fx > 0 && fy > 0; }
  bool distorted() const { return k1 != 0 || k2 != 0 || p1 != 0 || p2 != 0 || k3 != 0; }

  /// The camera of images that are resized to so many pixels; width and height must be set. Throws
  /// Error if they are not, or for no pixels.
  Camera resized(int new_width, int new_height) const {
    detail::check(width > 0 && height > 0 && new_width > 0 && new_height > 0, [&] {
      return "Camera::resized: expected widths and heights above 0, found " +
             std::to_string(width) + "x" + std::to_string(height) + " to " +
             std::to_string(new_width) + "x" + std::to_string(new_height);
    });
    const double sx = static_cast<double>(new_width) / width;
    const double sy = static_cast<double>(new_height) / height;
    Camera c = *this;
    c.fx *= sx, c.fy *= sy;
    // Whole numbers are the centers of pixels, so the image begins at -0.5.
    c.cx = (cx + 0.5) * sx - 0.5, c.cy = (cy + 0.5) * sy - 0.5;
    c.width = new_width, c.height = new_height;
    return c;
  }

  cv::Matx33d matrix() const { return {fx, 0, cx, 0, fy, cy, 0, 0, 1}; }
  cv::Vec<double, 5> distortion() const { return {k1, k2, p1, p2, k3}; }

  /// Point in camera coordinates (metres) of an undistorted pixel at depth `z_m`.
  Eigen::Vector3d unproject(double u, double v, double z_m) const {
    return {(u - cx) / fx * z_m, (v - cy) / fy * z_m, z_m};
  }
  /// Undistorted pixel of a point in camera coordinates; the caller checks `p.z() > 0`.
  Eigen::Vector2d project(const Eigen::Vector3d& p) const {
    return {fx * p.x() / p.z() + cx, fy * p.y() / p.z() + cy};
  }

  /// The published calibrations of the TUM RGB-D cameras and of the Bonn dynamic data set.
  static Camera tum_fr1() {
    return make(517.306408, 516.469215, 318.643040, 255.313989, 0.262383, -0.953104, -0.005358,
                0.002628, 1.163314);
  }
  static Camera tum_fr2() {
    return make(520.908620, 521.007327, 325.141442, 249.701764, 0.231222, -0.784899, -0.003257,
                -0.000105, 0.917205);
  }
  static Camera tum_fr3() { return make(535.4, 539.2, 320.1, 247.6, 0, 0, 0, 0, 0); }
  static Camera bonn() {
    return make(542.822841, 542.576870, 315.593520, 237.756098, 0.039903, -0.099343, -0.000730,
                -0.000144, 0.000000);
  }

 private:
  static Camera make(double fx, double fy, double cx, double cy, double k1, double k2, double p1,
                     double p2, double k3) {
    Camera c;
    c.fx = fx, c.fy = fy, c.cx = cx, c.cy = cy;
    c.k1 = k1, c.k2 = k2, c.p1 = p1, c.p2 = p2, c.k3 = k3;
    c.width = 640, c.height = 480;
    return c;
  }
};

/// Throws Error for a camera without focal lengths, or with a number that is not finite: it would
/// spoil a map for good. `who` is named in it.
inline void check_camera(const char* who, const Camera& camera) {
  detail::check(camera.valid(), [&] {
    return std::string(who) + ": expected a camera with focal lengths, found none";
  });
  for (const double v : {camera.fx, camera.fy, camera.cx, camera.cy, camera.k1, camera.k2,
                         camera.p1, camera.p2, camera.k3})
    detail::check(std::isfinite(v), [&] {
      return std::string(who) + ": camera: expected finite numbers, found " + std::to_string(v);
    });
}

}  // namespace stillpoint
