// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <utility>
#include <vector>

#include "stillpoint/core/bit_mask.hpp"
#include "stillpoint/core/config.hpp"

namespace stillpoint {

/// `r` grown by `margin_px` on each side, clipped to the picture.
inline cv::Rect grow_rect(const cv::Rect& r, int margin_px, const cv::Size& size) {
  return cv::Rect(r.x - margin_px, r.y - margin_px, r.width + 2 * margin_px,
                  r.height + 2 * margin_px) &
         cv::Rect(0, 0, size.width, size.height);
}

namespace detail {

/// Dilates binary pictures by squares. Keeps its memory, so that no frame allocates.
class Dilation {
 public:
  /// Dilates what lies in `part` of `in` (all else there is zero) by a square of (2 radius + 1)^2:
  /// equal to cv::dilate with that kernel. Calls `visit(y, row)` for the rows of the grown part,
  /// from the top; the row's words begin at pixel left() and end with the one that holds the grown
  /// part's last pixel. O(words of the part x log radius).
  template <class Visit>
  void run(const BitMask& in, const cv::Rect& part, int radius, Visit&& visit) {
    const cv::Rect grown = grow_rect(part, radius, in.size());
    if (part.empty() || grown.empty()) return;
    const std::size_t r = static_cast<std::size_t>(radius), window = 2 * r + 1;
    left_ = grown.x / 64 * 64;
    const std::size_t first = static_cast<std::size_t>(left_) / 64;
    stride_ = words_for(static_cast<std::size_t>(grown.x + grown.width)) - first;
    const std::size_t n = static_cast<std::size_t>(part.height), total = (n + 2 * r) * stride_;
    rows_.assign(total, 0);
    if (next_.size() < total) next_.resize(total);
    for (std::size_t i = 0; i < n; ++i)
      along(in.row(part.y + static_cast<int>(i)) + first, r, &rows_[(2 * r + i) * stride_]);
    // Down the columns: row i takes the rows from i on, in windows that double.
    for (std::size_t covered = 1; covered < window;) {
      const std::size_t add = std::min(covered, window - covered), shift = add * stride_;
      const std::size_t both = total - std::min(total, shift);
      or_rows(rows_.data(), shift, both, next_.data());
      std::copy(&rows_[both], rows_.data() + total, &next_[both]);
      std::swap(rows_, next_);
      covered += add;
    }
    const std::size_t end = static_cast<std::size_t>(grown.x + grown.width);
    const std::uint64_t last =
        end % 64 != 0 ? ~(~std::uint64_t{0} << (end % 64)) : ~std::uint64_t{0};
    for (std::size_t i = 0; i < n + 2 * r; ++i) {
      const int y = part.y - radius + static_cast<int>(i);
      if (y < 0 || y >= in.size().height) continue;
      std::uint64_t* row = &rows_[i * stride_];
      row[stride_ - 1] &= last;
      visit(y, static_cast<const std::uint64_t*>(row));
    }
  }

  /// Column of the first pixel of the rows: a multiple of 64.
  int left() const { return left_; }

 private:
  // A row of stride_ words, dilated along itself, into `out`, which is zero.
  void along(const std::uint64_t* in, std::size_t r, std::uint64_t* out) {
    if (r <= 63) return along_one(in, static_cast<int>(r), out);
    line_.assign(in, in + stride_);
    while (r > 0) {
      const std::size_t step = std::min<std::size_t>(r, 63);
      along_one(line_.data(), static_cast<int>(step), out);
      std::copy_n(out, stride_, line_.begin());
      r -= step;
    }
  }

  // The same with a radius of at most 63: a word reaches no further than the next one.
  void along_one(const std::uint64_t* in, int r, std::uint64_t* out) const {
    for (std::size_t k = 0; k < stride_; ++k) {
      const std::uint64_t word = in[k];
      if (word == 0) continue;
      out[k] |= word;
      if (r == 0) continue;
      std::uint64_t up = word, down = word;  // moved by 0 to r - 1 pixels, in windows that double
      for (int covered = 1; covered < r;) {
        const int add = std::min(covered, r - covered);
        up |= up << add, down |= down >> add;
        covered += add;
      }
      out[k] |= up << 1 | down >> 1;
      if (k > 0) out[k - 1] |= up << (64 - r);
      if (k + 1 < stride_) out[k + 1] |= down >> (64 - r);
    }
  }

  // out[k] = in[k] | in[k + shift]
  static void or_rows(const std::uint64_t* STILLPOINT_RESTRICT in, std::size_t shift, std::size_t n,
                      std::uint64_t* STILLPOINT_RESTRICT out) {
    for (std::size_t k = 0; k < n; ++k) out[k] = in[k] | in[k + shift];
  }

  int left_ = 0;
  std::size_t stride_ = 0;  // words of a row
  std::vector<std::uint64_t> rows_, next_, line_;
};

}  // namespace detail
}  // namespace stillpoint
