// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cmath>
#include <opencv2/core.hpp>
#include <vector>

#include "stillpoint/core/cell_labels.hpp"
#include "stillpoint/depth/object_depth_range.hpp"
#include "stillpoint/depth/region_cells.hpp"

namespace stillpoint {

/// How far the region grows: breadth first over cells whose depth goes on without a step, but not
/// into the floor, nor into what is known to be static.
class RegionGrowth {
 public:
  /// Grows by at most `reach` cells, over depths up to `range_m` beyond the range. `known_static`,
  /// if given, is asked; with `alone_only`, what never stood alone does not stop the growth. The
  /// cells used cover the region and a cell around it afterwards. O(cells of the region).
  void grow(RegionCells& cells, const DepthRange& range, float range_m, int reach,
            const CellLabels* known_static, bool alone_only) {
    const float lo = range.lo_m - range_m, hi = range.hi_m + range_m;
    visits_.clear();
    const cv::Rect& box = cells.used;
    for (int y = box.y; y < box.y + box.height; ++y)
      for (int x = box.x; x < box.x + box.width; ++x)
        if (cells.state({x, y}) == CellState::kRegion && has_unknown_beside(cells, {x, y}))
          visits_.push_back({{x, y}, 0});
    for (std::size_t k = 0; k < visits_.size(); ++k) {
      const Visit visit = visits_[k];
      if (visit.distance >= reach) continue;
      const float z = cells.z(visit.cell), step = cells.step(visit.cell);
      cells.for_each_beside(visit.cell, [&](const cv::Point& cell) {
        if (cells.state(cell) == CellState::kUnknown)
          cells.set_state(cell, may_be_region(cells, cell, lo, hi, known_static, alone_only)
                                    ? CellState::kOpen
                                    : CellState::kOutside);
        if (cells.state(cell) != CellState::kOpen || std::abs(cells.z(cell) - z) > step) return;
        cells.set_state(cell, CellState::kRegion);
        visits_.push_back({cell, visit.distance + 1});
        cells.used |= cv::Rect(cell, cv::Size(1, 1));
      });
    }
    cells.used = grow_rect(cells.used, 1, {1 << 20, 1 << 20}) & cells.limits;
  }

 private:
  struct Visit {
    cv::Point cell;
    int distance;
  };

  static bool has_unknown_beside(const RegionCells& cells, const cv::Point& cell) {
    bool any = false;
    cells.for_each_beside(
        cell, [&](const cv::Point& c) { any |= cells.state(c) == CellState::kUnknown; });
    return any;
  }

  // Takes the cell's depth.
  static bool may_be_region(RegionCells& cells, const cv::Point& cell, float lo, float hi,
                            const CellLabels* known_static, bool alone_only) {
    const float z = cells.z(cell) = cells.measured_z(cell);
    if (!(z > 0 && z >= lo && z <= hi) || cells.is_floor(cell)) return false;
    if (!known_static) return true;
    const cv::Point pixel = cells.place(cell);
    return !(alone_only ? known_static->stood_alone(pixel) : known_static->known_static(pixel));
  }

  std::vector<Visit> visits_;
};

}  // namespace stillpoint
