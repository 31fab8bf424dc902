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
    for (Place& offset : offsets_)
      for (std::uint16_t* part : {&offset.x, &offset.y})
        *part = static_cast<std::uint16_t>(random.below(static_cast<std::size_t>(cell_px)));
  }

  /// Takes the samples of a frame's depth, to which it refers: it must outlive this. O(cells).
  void begin(const DepthView& depth) {
    depth_ = &depth;
    set_places(depth.size());
    units_.create(places_.size());
    for (int y = 0; y < units_.rows; ++y) {
      const Place* places = places_[y];
      std::uint16_t* units = units_[y];
      for (int x = 0; x < units_.cols; ++x) units[x] = depth.row(places[x].y)[places[x].x];
    }
  }

  const DepthView& depth() const { return *depth_; }
  int cell_px() const { return cell_px_; }
  /// The sample's pixel of a cell, inside the image.
  cv::Point place(const cv::Point& cell) const { return places_(cell); }
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
  using Place = cv::Point_<std::uint16_t>;
  static constexpr unsigned kTable = 4096;

  void set_places(const cv::Size& size) {
    if (size == size_) return;
    size_ = size;
    places_.create(cells_of({{}, size}).size());
    for (int y = 0; y < places_.rows; ++y)
      for (int x = 0; x < places_.cols; ++x) {
        const Place& offset = offsets_[static_cast<unsigned>(y * 61 + x) % kTable];
        places_(y, x) = cv::Point(std::min(x * cell_px_ + offset.x, size.width - 1),
                                  std::min(y * cell_px_ + offset.y, size.height - 1));
      }
  }

  int cell_px_;
  std::array<Place, kTable> offsets_;  // in a cell
  cv::Size size_;
  cv::Mat_<Place> places_;  // in an image of that size
  const DepthView* depth_ = nullptr;
  cv::Mat_<std::uint16_t> units_;
};

}  // namespace stillpoint
