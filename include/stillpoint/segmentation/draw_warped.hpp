// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>

#include "stillpoint/core/config.hpp"

namespace stillpoint::detail {

// Places in the mask are counted in 2^-32 pixels: sums of them are exact.
constexpr int kFixedBits = 32;
inline std::int64_t fixed_point(double value, double limit) {
  constexpr double kOne = 4294967296;
  return static_cast<std::int64_t>(std::floor(std::min(limit, std::max(-limit, value)) * kOne));
}

// Keeps those n of a range for which the place first + n * step is from 0 to below `size` pixels.
inline void clip_range(std::int64_t first, std::int64_t step, int size, cv::Range& range) {
  const auto outside = [&](int n) {
    const std::int64_t place = first + n * step;
    return place < 0 || place >= static_cast<std::int64_t>(size) << kFixedBits;
  };
  while (range.start < range.end && outside(range.start)) ++range.start;
  while (range.end > range.start && outside(range.end - 1)) --range.end;
}

STILLPOINT_ROW_LOOP inline void add_row(const uchar* row, int n, uchar* STILLPOINT_RESTRICT to) {
  for (int x = 0; x < n; ++x) to[x] = static_cast<uchar>(to[x] | row[x]);
}

/// ORs a mask, one byte per pixel of `box`, into the part `part` of `out`, which covers the image
/// from `origin` on. `affine` maps pixels of the mask's image into those of `out`'s; the nearest
/// pixel is taken. O(part).
inline void draw_warped(const uchar* mask, const cv::Rect& box,
                        const Eigen::Matrix<double, 2, 3>& affine, const cv::Rect& part,
                        const cv::Point& origin, cv::Mat& out) {
  const Eigen::Matrix2d inverse = affine.leftCols<2>().inverse();
  const Eigen::Vector2d offset = -inverse * affine.col(2) + Eigen::Vector2d(0.5, 0.5);
  const std::int64_t step_u = fixed_point(inverse(0, 0), 1e4);
  const std::int64_t step_v = fixed_point(inverse(1, 0), 1e4);
  const bool only_moved = step_u == std::int64_t{1} << kFixedBits && step_v == 0;
  for (int y = part.y; y < part.y + part.height; ++y) {
    std::int64_t u =
        fixed_point(inverse(0, 0) * part.x + inverse(0, 1) * y + offset.x() - box.x, 1e9);
    std::int64_t v =
        fixed_point(inverse(1, 0) * part.x + inverse(1, 1) * y + offset.y() - box.y, 1e9);
    cv::Range inside(0, part.width);
    clip_range(u, step_u, box.width, inside);
    clip_range(v, step_v, box.height, inside);
    u += inside.start * step_u, v += inside.start * step_v;
    uchar* to = out.ptr<uchar>(y - origin.y) + part.x - origin.x;
    const auto at = [&] {
      return static_cast<std::ptrdiff_t>((v >> kFixedBits) * box.width + (u >> kFixedBits));
    };
    if (only_moved && inside.start < inside.end) {
      add_row(mask + at(), inside.size(), to + inside.start);
      continue;
    }
    for (int x = inside.start; x < inside.end; ++x, u += step_u, v += step_v) to[x] |= mask[at()];
  }
}

}  // namespace stillpoint::detail
