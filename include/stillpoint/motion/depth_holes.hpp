// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "stillpoint/motion/depth_cells.hpp"

namespace stillpoint {

/// Collects the holes in the depth of a frame: cells without any depth that hang together.
class DepthHoles {
 public:
  /// Calls `visit` with the cells of each hole in `view`, row by row of their first cells; what
  /// `view` cuts apart are several. O(cells).
  template <class Visit>
  void for_each(const DepthCells& cells, const cv::Rect& view, Visit visit) {
    seen_.assign(cells.size(), 0);
    for (int y = view.y; y < view.br().y; ++y)
      for (int x = view.x; x < view.br().x; ++x) {
        hole_.clear();
        add(cells, {x, y});
        for (std::size_t k = 0; k < hole_.size(); ++k)
          for (const auto& next : DepthCells::kNext) {
            const cv::Point q(hole_[k].x + next[0], hole_[k].y + next[1]);
            if (view.contains(q)) add(cells, q);
          }
        if (!hole_.empty()) visit(hole_);
      }
  }

 private:
  void add(const DepthCells& cells, const cv::Point& p) {
    const std::size_t i = cells.index(p.x, p.y);
    if (!(cells.depth_m[i] < 0) || seen_[i] != 0) return;
    seen_[i] = 1;
    hole_.push_back(p);
  }

  std::vector<std::uint8_t> seen_;  // by cell
  std::vector<cv::Point> hole_;
};

}  // namespace stillpoint
