// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <opencv2/core.hpp>

#include "stillpoint/core/depth_view.hpp"
#include "stillpoint/core/random.hpp"

namespace stillpoint {

/// What a cell of the image is to the object that is looked at.
enum CellState : std::uint8_t {
  kOffMask,  ///< not on its mask
  kOnMask,   ///< on its mask, at another depth than its own
  kOutside,  ///< not the object's
  kRegion    ///< the object's
};
/// One CellState for each cell.
using CellStates = cv::Mat_<std::uint8_t>;

/// Stratified sampling of a depth image (paper section 3.2): in each cell of cell_px x cell_px one
/// pixel, drawn uniformly, the same in every frame for a seed. Cells are addressed by column and
/// row.
class DepthSamples {
 public:
  DepthSamples(int cell_px, std::uint64_t seed) : cell_px_(cell_px) {
    RandomGenerator random(seed);
    for (auto& place : places_)
      for (std::uint16_t* offset : {&place.x, &place.y})
        *offset = static_cast<std::uint16_t>(random.below(static_cast<std::size_t>(cell_px)));
  }

  /// Takes the samples of a frame's depth, to which it refers: it must outlive this. O(cells).
  void begin(const DepthView& depth) {
    depth_ = &depth;
    const cv::Rect cells = cells_of({{}, depth.size()});
    units_.create(cells.size());
    for (cv::Point cell; cell.y < cells.height; ++cell.y) {
      std::uint16_t* units = units_[cell.y];
      for (cell.x = 0; cell.x < cells.width; ++cell.x) {
        const cv::Point p = place(cell);
        units[cell.x] = depth.row(p.y)[p.x];
      }
    }
  }

  const DepthView& depth() const { return *depth_; }
  int cell_px() const { return cell_px_; }
  /// The sample's pixel of a cell, inside the image.
  cv::Point place(const cv::Point& cell) const {
    const cv::Size size = depth_->size();
    const auto& p = places_[static_cast<unsigned>(cell.y * 61 + cell.x) % kTable];
    return {std::min(cell.x * cell_px_ + p.x, size.width - 1),
            std::min(cell.y * cell_px_ + p.y, size.height - 1)};
  }
  /// Depth of the cells' samples in the frame's units, and of one in metres; 0 = no measurement.
  const cv::Mat_<std::uint16_t>& units() const { return units_; }
  float z(const cv::Point& cell) const { return depth_->to_m(units_(cell)); }
  /// The cells that a rectangle of pixels touches.
  cv::Rect cells_of(const cv::Rect& r) const {
    const cv::Point last = r.br() - cv::Point(1, 1);
    return {r.tl() / cell_px_, last / cell_px_ + cv::Point(1, 1)};
  }
  /// Calls `visit(cell, pixel)` for the samples in a rectangle of pixels, row by row.
  template <class Visit>
  void for_each_in(const cv::Rect& box, Visit&& visit) const {
    const cv::Rect cells = cells_of(box);
    for (cv::Point cell = cells.tl(); cell.y < cells.br().y; ++cell.y)
      for (cell.x = cells.x; cell.x < cells.br().x; ++cell.x) {
        const cv::Point p = place(cell);
        if (box.contains(p)) visit(cell, p);
      }
  }

 private:
  static constexpr unsigned kTable = 4096;

  int cell_px_;
  std::array<cv::Point_<std::uint16_t>, kTable> places_;
  const DepthView* depth_ = nullptr;
  cv::Mat_<std::uint16_t> units_;
};

}  // namespace stillpoint
