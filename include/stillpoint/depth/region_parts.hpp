// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "stillpoint/depth/region_cells.hpp"

namespace stillpoint {

/// Which parts of the mask at other depths than the object's are its, too: an arm stretched out, a
/// second person in one mask.
///
/// A part is the object's if it ends where the mask ends, in a step to something farther. What goes
/// on beyond the mask is background that a careless mask took in.
class RegionParts {
 public:
  /// Adds such parts to the region. A part may go on `slack` cells beyond the mask. O(cells of the
  /// box).
  void keep(RegionCells& cells, const cv::Mat_<std::uint16_t>& samples_on_mask, int slack) {
    const cv::Rect box = cells.used;
    const int on_mask = cv::countNonZero(samples_on_mask(box));
    int core = 0;
    for_each_cell(box, [&](const cv::Point& c) { core += cells.state(c) == CellState::kRegion; });
    const std::size_t least = static_cast<std::size_t>(std::max(6, on_mask / 25));
    if (static_cast<std::size_t>(on_mask) < static_cast<std::size_t>(core) + least) return;
    visits_.clear();
    for_each_cell(box, [&](const cv::Point& c) {
      if (samples_on_mask(c) == 0 || cells.state(c) != CellState::kUnknown) return;
      const std::size_t begin = visits_.size();
      if (collect(cells, samples_on_mask, box, c, slack) < least) return;
      for (std::size_t k = begin; k < visits_.size(); ++k)
        if (visits_[k].beyond == 0) cells.set_state(visits_[k].cell, CellState::kRegion);
    });
    for (const Visit& v : visits_)
      if (cells.state(v.cell) == CellState::kPart) cells.set_state(v.cell, CellState::kUnknown);
  }

 private:
  struct Visit {
    cv::Point cell;
    int beyond;  // how many cells beyond the mask
  };

  template <class Do>
  static void for_each_cell(const cv::Rect& box, Do&& work) {
    for (int y = box.y; y < box.y + box.height; ++y)
      for (int x = box.x; x < box.x + box.width; ++x) work(cv::Point(x, y));
  }

  // Adds the cells of the mask that are connected with `first` to the visits, and those up to
  // `slack` cells beyond it. Returns how many are on the mask; 0 if the part goes on beyond it.
  std::size_t collect(RegionCells& cells, const cv::Mat_<std::uint16_t>& samples_on_mask,
                      const cv::Rect& box, const cv::Point& first, int slack) {
    int steps = 0, goes_on = 0;
    std::size_t on_mask = 0, k = visits_.size();
    const auto take = [&](const cv::Point& cell, int beyond) {
      cells.set_state(cell, CellState::kPart);
      visits_.push_back({cell, beyond});
    };
    take(first, 0);
    for (; k < visits_.size(); ++k) {
      const Visit visit = visits_[k];
      on_mask += visit.beyond == 0;
      const float z = cells.z(visit.cell), step = cells.step(visit.cell);
      if (cells.is_floor(visit.cell)) ++goes_on;
      cells.for_each_beside(visit.cell, [&](const cv::Point& cell) {
        if (box.contains(cell) && samples_on_mask(cell) != 0) {
          if (cells.state(cell) == CellState::kUnknown && std::abs(cells.z(cell) - z) <= step)
            take(cell, 0);
          return;
        }
        if (cells.state(cell) == CellState::kPart || !cells.limits.contains(cell)) return;
        const float beyond = cells.measured_z(cell);
        if (beyond > z + step) {
          steps += 2;
        } else if (beyond == 0) {  // cameras measure nothing beside a step, and on much else
          ++steps;
        } else if (beyond > z - step) {  // what is nearer hides where the part ends
          if (visit.beyond == slack) {
            goes_on += 2;
            return;
          }
          cells.z(cell) = beyond;
          take(cell, visit.beyond + 1);
        }
      });
    }
    return steps > goes_on ? on_mask : 0;
  }

  std::vector<Visit> visits_;
};

}  // namespace stillpoint
