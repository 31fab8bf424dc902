// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cstring>
#include <opencv2/core.hpp>
#include <vector>

#include "stillpoint/core/config.hpp"

namespace stillpoint {

/// `r` grown by `margin_px` on each side, clipped to the picture.
inline cv::Rect grow_rect(const cv::Rect& r, int margin_px, const cv::Size& size) {
  return cv::Rect(r.x - margin_px, r.y - margin_px, r.width + 2 * margin_px,
                  r.height + 2 * margin_px) &
         cv::Rect(0, 0, size.width, size.height);
}

/// Scratch memory of dilate_rects(), kept by the caller so that no frame allocates.
struct DilationBuffer {
  std::vector<uchar> a, b;
};

namespace detail {

// out[i] = in[i] | in[i + shift]
inline void or_shifted(const uchar* STILLPOINT_RESTRICT in, uchar* STILLPOINT_RESTRICT out,
                       std::size_t n, std::size_t shift) {
  const uchar* shifted = in + shift;
  for (std::size_t i = 0; i < n; ++i) out[i] = static_cast<uchar>(in[i] | shifted[i]);
}

inline void or_into(const uchar* STILLPOINT_RESTRICT in, std::size_t n,
                    uchar* STILLPOINT_RESTRICT out) {
  for (std::size_t i = 0; i < n; ++i) out[i] = static_cast<uchar>(out[i] | in[i]);
}

}  // namespace detail

/// Dilates the parts `rects` of `in` (CV_8UC1, 0 or 255) by a square of (2 radius + 1)^2 and ORs
/// the result into `out` (same size). Equal to cv::dilate with that kernel where `in` is zero
/// outside the rects. Cost: O(pixels of the rects x log radius), a few byte operations each.
inline void dilate_rects(const cv::Mat& in, const std::vector<cv::Rect>& rects, int radius,
                         cv::Mat& out, DilationBuffer& buffer) {
  for (const cv::Rect& rect : rects) {
    if (rect.empty()) continue;
    const cv::Rect target = grow_rect(rect, radius, in.size());
    // Rows are padded to target.width + 2 radius zeros, so that a window never reads its neighbor
    // row; then a window over rows is the same operation with a longer step.
    const std::size_t stride = static_cast<std::size_t>(target.width + 2 * radius);
    const std::size_t rows = static_cast<std::size_t>(target.height + 2 * radius);
    const std::size_t n = stride * rows;
    const std::size_t window = static_cast<std::size_t>(2 * radius + 1);
    const std::size_t padding = window * stride;
    buffer.a.resize(std::max(buffer.a.size(), n + padding));
    buffer.b.resize(std::max(buffer.b.size(), n + padding));
    uchar *a = buffer.a.data(), *b = buffer.b.data();
    std::memset(a, 0, n + padding);
    std::memset(b + n, 0, padding);
    // Source pixel (x, y) goes to its window's first position, so windows look forward only.
    for (int y = 0; y < target.height; ++y)
      std::memcpy(a + (static_cast<std::size_t>(y) + static_cast<std::size_t>(radius)) * stride +
                      static_cast<std::size_t>(radius),
                  in.ptr<uchar>(target.y + y) + target.x, static_cast<std::size_t>(target.width));
    for (const std::size_t step : {std::size_t{1}, stride}) {
      std::size_t covered = 1;
      while (covered < window) {
        const std::size_t add = std::min(covered, window - covered);
        detail::or_shifted(a, b, n, add * step);
        std::swap(a, b);
        covered += add;
      }
    }
    for (int y = 0; y < target.height; ++y) {
      detail::or_into(a + static_cast<std::size_t>(y) * stride,
                      static_cast<std::size_t>(target.width),
                      out.ptr<uchar>(target.y + y) + target.x);
    }
  }
}

}  // namespace stillpoint
