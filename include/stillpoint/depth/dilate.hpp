// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstring>
#include <opencv2/core.hpp>
#include <vector>

#include "stillpoint/core/byte_rows.hpp"

namespace stillpoint {

/// `r` grown by `margin_px` on each side, clipped to the picture.
inline cv::Rect grow_rect(const cv::Rect& r, int margin_px, const cv::Size& size) {
  return cv::Rect(r.x - margin_px, r.y - margin_px, r.width + 2 * margin_px,
                  r.height + 2 * margin_px) &
         cv::Rect(0, 0, size.width, size.height);
}

/// Scratch memory of dilate_rects(), kept by the caller so that no frame allocates.
struct DilationBuffer {
  std::array<std::vector<uchar>, 3> blocks;
  std::vector<uchar> running;
};

/// Dilates the parts `rects` of `in` (CV_8UC1, 0 or 255) by a square of (2 radius + 1)^2 and ORs
/// the result into `out` (same size). Equal to cv::dilate with that kernel where `in` is zero
/// outside the rects. Cost: O(pixels of the rects x log radius), a few byte operations each.
inline void dilate_rects(const cv::Mat& in, const std::vector<cv::Rect>& rects, int radius,
                         cv::Mat& out, DilationBuffer& buffer) {
  const int margin = 2 * radius, window = margin + 1;
  const auto at_least = [](std::vector<uchar>& v, std::size_t n) {
    if (v.size() < n) v.resize(n);
    return v.data();
  };
  for (const cv::Rect& rect : rects) {
    if (rect.empty()) continue;
    // A row: `margin` zeros, the pixels, `margin` zeros. Windows look forward, so the dilated row
    // begins at its first byte and reads no other row.
    const int width = rect.width + margin;
    const std::size_t stride =
        detail::whole_parts(static_cast<std::size_t>(rect.width + 2 * margin));
    const std::size_t size = stride * static_cast<std::size_t>(window);
    uchar* blocks[3];
    for (std::size_t i = 0; i < 3; ++i)
      blocks[i] = at_least(buffer.blocks[i], size + detail::whole_parts(window));
    uchar* running = at_least(buffer.running, stride);

    // Fills blocks[to] with the next `window` rows, dilated along themselves: windows double.
    // Whole blocks at a time, as loads that overlap two stores just made are slow.
    const auto load = [&](int row, int to) {
      uchar* a = blocks[to];
      std::memset(a, 0, size);
      for (int i = std::max(0, -row); i < std::min(window, rect.height - row); ++i)
        std::memcpy(a + static_cast<std::size_t>(i) * stride + margin,
                    in.ptr<uchar>(rect.y + row + i) + rect.x, static_cast<std::size_t>(rect.width));
      for (int covered = 1; covered < window;) {
        const int add = std::min(covered, window - covered);
        detail::or_shifted(blocks[to], blocks[2], size, static_cast<std::size_t>(add));
        std::swap(blocks[to], blocks[2]);
        covered += add;
      }
    };
    const int first_x = rect.x - radius, skip = std::max(0, -first_x);
    const std::size_t shown =
        static_cast<std::size_t>(std::min(first_x + width, in.cols) - std::max(first_x, 0));
    // Down the columns (van Herk): the window of an output row is the end of one block and the
    // beginning of the next: three operations per row, whatever the radius.
    int now = 0;
    load(-margin, now);
    for (int k = 0; k < rect.height + margin; k += window, now = 1 - now) {
      const auto row = [&](int block, int i) {
        return blocks[block] + static_cast<std::size_t>(i) * stride;
      };
      for (int i = window - 2; i >= 0; --i) detail::or_into(row(now, i + 1), stride, row(now, i));
      if (k + 1 < rect.height + margin) load(k + window - margin, 1 - now);
      std::memset(running, 0, stride);
      for (int i = 0; i < window && k + i < rect.height + margin; ++i) {
        const int y = rect.y - radius + k + i;
        if (i > 0) detail::or_into(row(1 - now, i - 1), stride, running);
        if (y < 0 || y >= in.rows) continue;
        uchar* to = out.ptr<uchar>(y) + std::max(first_x, 0);
        detail::or_into(row(now, i) + skip, shown, to);
        detail::or_into(running + skip, shown, to);
      }
    }
  }
}

}  // namespace stillpoint
