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
    const std::size_t words = words_for(static_cast<std::size_t>(grown.x + grown.width)) - first;
    // Rows shifted right are read from further right, so they run over.
    stride_ = words + (r + 63) / 64 + 1;
    const std::size_t n = static_cast<std::size_t>(part.height), total = (n + 2 * r) * stride_;
    rows_.assign(total, 0);
    if (next_.size() < total) next_.resize(total);
    line_.resize(stride_);
    for (std::size_t i = 0; i < n; ++i)
      along(in.row(part.y + static_cast<int>(i)) + first, words, r, &rows_[(2 * r + i) * stride_]);
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
      row[words - 1] &= last;
      visit(y, static_cast<const std::uint64_t*>(row));
    }
  }

  /// Column of the first pixel of the rows: a multiple of 64.
  int left() const { return left_; }

 private:
  // A row of `words`, dilated along itself, into stride_ words.
  void along(const std::uint64_t* in, std::size_t words, std::size_t r, std::uint64_t* out) {
    std::uint64_t any = 0;
    for (std::size_t k = 0; k < words; ++k) any |= in[k];
    if (any == 0) return;
    std::copy(in, in + words, line_.begin());
    std::fill(line_.begin() + static_cast<std::ptrdiff_t>(words), line_.end(), 0);
    // Pixel x takes those from x - 2 r on, in windows that double; then all move back by r.
    for (std::size_t covered = 1; covered < 2 * r + 1;) {
      const std::size_t add = std::min(covered, 2 * r + 1 - covered), q = add / 64, b = add % 64;
      for (std::size_t k = stride_ - 1; k > q; --k)
        line_[k] |= b == 0 ? line_[k - q] : line_[k - q] << b | line_[k - q - 1] >> (64 - b);
      if (q < stride_) line_[q] |= line_[0] << b;
      covered += add;
    }
    const std::size_t q = r / 64, b = r % 64;
    for (std::size_t k = 0; k < words; ++k)
      out[k] = b == 0 ? line_[k + q] : line_[k + q] >> b | line_[k + q + 1] << (64 - b);
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
