// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <opencv2/core.hpp>
#include <vector>

#include "stillpoint/core/camera.hpp"
#include "stillpoint/core/distortion.hpp"

namespace stillpoint {

/// Rays of the raw image's pixels and pixels of rays, with the lens distortion of a Camera. The
/// inverse of the distortion is a table, made once per camera and image size.
class Lens {
 public:
  /// Without a valid camera: no distortion, a focal length of 0.9 times the width. O(1) unless
  /// camera or size have changed, then O(pixels / 16) inversions of the distortion.
  void set(const Camera& camera, const cv::Size& size) {
    if (size == size_ && same_intrinsics(camera, camera_)) return;
    size_ = size, camera_ = camera;
    fx_ = static_cast<float>(camera.valid() ? camera.fx : 0.9 * size.width);
    fy_ = static_cast<float>(camera.valid() ? camera.fy : 0.9 * size.width);
    cx_ = static_cast<float>(camera.valid() ? camera.cx : 0.5 * (size.width - 1));
    cy_ = static_cast<float>(camera.valid() ? camera.cy : 0.5 * (size.height - 1));
    distorted_ = camera.valid() && camera.distorted();
    if (distorted_) fill_table();
  }

  bool distorted() const { return distorted_; }
  const cv::Size& size() const { return size_; }
  /// Focal lengths and principal point, pixels.
  float fx() const { return fx_; }
  float fy() const { return fy_; }
  float cx() const { return cx_; }
  float cy() const { return cy_; }

  /// Coefficients of the distortion for loops over many rays; all 0 without distortion. Beyond
  /// `most_square`, the squared length of the image's longest ray, the radial factor stays.
  struct Coefficients {
    float k1 = 0, k2 = 0, k3 = 0, p1 = 0, p2 = 0, most_square = 1e9f;
  };
  Coefficients coefficients() const {
    if (!distorted_) return {};
    return {static_cast<float>(camera_.k1), static_cast<float>(camera_.k2),
            static_cast<float>(camera_.k3), static_cast<float>(camera_.p1),
            static_cast<float>(camera_.p2), most_square_};
  }

  /// Ray (x / z, y / z) of a raw pixel, to within 0.02 px. O(1).
  Eigen::Vector2f ray(float u, float v) const {
    const Eigen::Vector2f p((u - cx_) / fx_, (v - cy_) / fy_);
    return distorted_ ? Eigen::Vector2f(p + correction(u, v)) : p;
  }

  /// Raw pixel of a ray; beyond the image the distortion at its corners is kept, so that nothing
  /// folds back into it. O(1).
  Eigen::Vector2f pixel(const Eigen::Vector2f& ray) const {
    if (!distorted_) return {fx_ * ray.x() + cx_, fy_ * ray.y() + cy_};
    const float square = ray.squaredNorm();
    Eigen::Vector2d d = ray.cast<double>();
    if (square <= most_square_) {
      d = distort_normalized(camera_, d);
    } else {
      const double r2 = static_cast<double>(most_square_);
      d *= 1 + r2 * (camera_.k1 + r2 * (camera_.k2 + r2 * camera_.k3));
    }
    return {fx_ * static_cast<float>(d.x()) + cx_, fy_ * static_cast<float>(d.y()) + cy_};
  }

 private:
  static constexpr int kStep = 4;  // pixels between entries of the table

  static bool same_intrinsics(const Camera& a, const Camera& b) {
    return a.fx == b.fx && a.fy == b.fy && a.cx == b.cx && a.cy == b.cy && a.k1 == b.k1 &&
           a.k2 == b.k2 && a.p1 == b.p1 && a.p2 == b.p2 && a.k3 == b.k3;
  }

  // What the distortion adds to a ray, every kStep pixels.
  void fill_table() {
    columns_ = (size_.width + kStep - 1) / kStep + 1;
    const int rows = (size_.height + kStep - 1) / kStep + 1;
    table_.resize(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows));
    most_square_ = 0;
    for (int j = 0; j < rows; ++j)
      for (int i = 0; i < columns_; ++i) {
        const Eigen::Vector2d raw(i * kStep, j * kStep);
        const Eigen::Vector2d flat = undistort_pixel(camera_, raw);
        const Eigen::Vector2f ray(static_cast<float>((flat.x() - camera_.cx) / camera_.fx),
                                  static_cast<float>((flat.y() - camera_.cy) / camera_.fy));
        const Eigen::Vector2f straight((static_cast<float>(raw.x()) - cx_) / fx_,
                                       (static_cast<float>(raw.y()) - cy_) / fy_);
        table_[static_cast<std::size_t>(j * columns_ + i)] = ray - straight;
        if (ray.allFinite()) most_square_ = std::max(most_square_, ray.squaredNorm());
      }
  }

  Eigen::Vector2f correction(float u, float v) const {
    const float x = std::max(0.0f, std::min(u, static_cast<float>(size_.width - 1))) / kStep;
    const float y = std::max(0.0f, std::min(v, static_cast<float>(size_.height - 1))) / kStep;
    const int i = static_cast<int>(x), j = static_cast<int>(y);
    const float a = x - static_cast<float>(i), b = y - static_cast<float>(j);
    const Eigen::Vector2f* t = &table_[static_cast<std::size_t>(j * columns_ + i)];
    const Eigen::Vector2f* under = t + columns_;
    return (1 - b) * ((1 - a) * t[0] + a * t[1]) + b * ((1 - a) * under[0] + a * under[1]);
  }

  Camera camera_;
  cv::Size size_;
  bool distorted_ = false;
  float fx_ = 1, fy_ = 1, cx_ = 0, cy_ = 0;
  float most_square_ = 0;  // of a ray in the image
  int columns_ = 0;
  std::vector<Eigen::Vector2f> table_;
};

}  // namespace stillpoint
