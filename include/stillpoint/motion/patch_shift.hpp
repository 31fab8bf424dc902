// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
#include <array>
#include <cmath>
#include <cstddef>
#include <opencv2/core.hpp>

#include "stillpoint/motion/packet.hpp"

namespace stillpoint::detail {

/// A template of Lucas and Kanade, row by row. Sums are kept per column until the end.
class Patch {
 public:
  static constexpr int kRadius = 4, kSide = 8;  // -4 to +3

  /// The patch that begins at `first`, which needs a pixel more on each side.
  void set(const float* first, std::size_t stride) {
    for (std::size_t v = 0; v < kSide; ++v, first += stride) {
      gx_[v] = 0.5f * (row(first + 1) - row(first - 1));
      gy_[v] = 0.5f * (row(first + stride) - row(first - stride));
      value_[v] = row(first);
    }
    information_ = information_of_slopes();
  }

  /// Of the shift in x and y and the brightness.
  const Eigen::Matrix3f& information() const { return information_; }

  /// Lays the patch onto `to` (CV_32FC1): x and y, where it begins, are the guess and become where
  /// it fits (Lucas and Kanade with the slopes of the template, and free brightness). Ends at steps
  /// under `enough` pixels. False: it has no corner, looks otherwise where the steps end, reaches
  /// the rim of the image or goes more than five pixels. After eight steps it is taken as it is.
  bool align(const cv::Mat& to, float enough, float& x, float& y) const {
    constexpr float kMaxShift = 5, kMaxResidual = 14;
    Eigen::Matrix3f inverse;
    bool invertible = false;
    information_.computeInverseWithCheck(inverse, invertible, 1.0f);
    if (!invertible) return false;
    const float start_x = x, start_y = y;
    float bias = 0;
    for (int iteration = 0; iteration < 8; ++iteration) {
      if (!(x >= 0 && y >= 0 && x < static_cast<float>(to.cols - kSide - 1) &&
            y < static_cast<float>(to.rows - kSide - 1)))
        return false;
      const int ix = static_cast<int>(x), iy = static_cast<int>(y);
      const Eigen::Vector4f sums =
          compare(to.ptr<float>(iy) + ix, to.step1(), x - static_cast<float>(ix),
                  y - static_cast<float>(iy), bias);
      const Eigen::Vector3f d = inverse * sums.head<3>();
      x -= d.x(), y -= d.y(), bias += d.z();
      if (std::abs(x - start_x) > kMaxShift || std::abs(y - start_y) > kMaxShift) return false;
      if (d.x() * d.x() + d.y() * d.y() > enough * enough) continue;
      return sums[3] <= kMaxResidual * kMaxResidual * kSide * kSide;
    }
    return true;
  }

 private:
  using Row = PacketOf<kSide>;

  static Row row(const float* first) { return Row::load(first); }
  static float total(const Row& r) {
    return ((r[0] + r[4]) + (r[2] + r[6])) + ((r[1] + r[5]) + (r[3] + r[7]));
  }

  Eigen::Matrix3f information_of_slopes() const {
    Row xx = Row::constant(0), xy = xx, yy = xx, x = xx, y = xx;
    for (std::size_t v = 0; v < kSide; ++v) {
      xx += gx_[v] * gx_[v], xy += gx_[v] * gy_[v], yy += gy_[v] * gy_[v];
      x += gx_[v], y += gy_[v];
    }
    Eigen::Matrix3f H;
    H << total(xx), total(xy), total(x), total(xy), total(yy), total(y), total(x), total(y),
        kSide * kSide;
    return H;
  }

  // Sums of the residuals times the slopes in x and y, of the residuals and of their squares,
  // where the patch begins at `first` and a part (a, b) of a pixel.
  Eigen::Vector4f compare(const float* first, std::size_t stride, float a, float b,
                          float bias) const {
    const float w00 = (1 - a) * (1 - b), w01 = a * (1 - b), w10 = (1 - a) * b, w11 = a * b;
    Row x = Row::constant(0), y = x, one = x, squares = x;
    for (std::size_t v = 0; v < kSide; ++v, first += stride) {
      const Row r = w00 * row(first) + w01 * row(first + 1) + w10 * row(first + stride) +
                    w11 * row(first + stride + 1) - value_[v] - bias;
      x += r * gx_[v], y += r * gy_[v], one += r, squares += r * r;
    }
    return {total(x), total(y), total(one), total(squares)};
  }

  std::array<Row, kSide> gx_, gy_, value_;
  Eigen::Matrix3f information_;
};

/// Follows a patch from (x, y) of `from` into `to`, both CV_32FC1 and smaller by `scale` than the
/// whole image: du and dv, in pixels of the whole one, are the guess and become what is found; see
/// Patch::align(). `information` is that of the patch on a shift, its greater eigenvalue scaled
/// to 1.
inline bool shift(const cv::Mat& from, const cv::Mat& to, int x, int y, int scale, float enough,
                  float& du, float& dv, Eigen::Matrix2f& information) {
  constexpr int kRadius = Patch::kRadius;
  if (x < kRadius + 1 || y < kRadius + 1 || x + kRadius + 1 >= from.cols ||
      y + kRadius + 1 >= from.rows)
    return false;
  Patch patch;
  patch.set(from.ptr<float>(y - kRadius) + x - kRadius, from.step1());
  const Eigen::Matrix3f& H = patch.information();
  const float half = 0.5f * (H(0, 0) + H(1, 1)), skew = 0.5f * (H(0, 0) - H(1, 1));
  information = H.topLeftCorner<2, 2>() / (half + std::sqrt(skew * skew + H(0, 1) * H(0, 1)));
  const float per_pixel = 1.0f / static_cast<float>(scale);
  float px = static_cast<float>(x - kRadius) + du * per_pixel;
  float py = static_cast<float>(y - kRadius) + dv * per_pixel;
  if (!patch.align(to, enough, px, py)) return false;
  du = (px - static_cast<float>(x - kRadius)) * static_cast<float>(scale);
  dv = (py - static_cast<float>(y - kRadius)) * static_cast<float>(scale);
  return true;
}

}  // namespace stillpoint::detail
