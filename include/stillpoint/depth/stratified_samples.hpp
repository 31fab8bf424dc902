// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <opencv2/core.hpp>

#include "stillpoint/core/random.hpp"

namespace stillpoint {

/// Stratified sampling of a image: one place drawn uniformly in each cell of cell_px x cell_px
/// (paper section 3.2). The same places in every frame for a seed, in any order of asking.
class StratifiedSamples {
 public:
  StratifiedSamples(int cell_px, std::uint64_t seed) : cell_px_(cell_px) {
    RandomGenerator random(seed);
    const std::size_t side = static_cast<std::size_t>(cell_px);
    for (auto& place : places_) {
      place.x = static_cast<std::uint8_t>(random.below(side));
      place.y = static_cast<std::uint8_t>(random.below(side));
    }
  }

  /// The sample's pixel of a cell, inside the image.
  cv::Point place(int cell_x, int cell_y, const cv::Size& size) const {
    const Place& p = places_[static_cast<unsigned>(cell_y * 61 + cell_x) % kTable];
    return {std::min(cell_x * cell_px_ + p.x, size.width - 1),
            std::min(cell_y * cell_px_ + p.y, size.height - 1)};
  }

  /// The cells that a rectangle of pixels touches.
  cv::Rect cells_of(const cv::Rect& r) const {
    const int x0 = r.x / cell_px_, y0 = r.y / cell_px_;
    return {x0, y0, (r.x + r.width - 1) / cell_px_ - x0 + 1,
            (r.y + r.height - 1) / cell_px_ - y0 + 1};
  }

  /// Columns and rows of cells in an image.
  cv::Size grid_size(const cv::Size& size) const {
    return {(size.width - 1) / cell_px_ + 1, (size.height - 1) / cell_px_ + 1};
  }

  int cell_px() const { return cell_px_; }

 private:
  static constexpr unsigned kTable = 4096;
  struct Place {
    std::uint8_t x, y;
  };
  int cell_px_;
  std::array<Place, kTable> places_;
};

}  // namespace stillpoint
