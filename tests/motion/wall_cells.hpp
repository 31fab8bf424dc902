// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "stillpoint/motion/depth_cells.hpp"

namespace stillpoint {

/// 40 x 30 cells that see a wall across the view, `depth_m` away.
inline DepthCells wall_cells(float depth_m) {
  DepthCells cells;
  cells.width = 40, cells.height = 30;
  cells.fx = cells.fy = 32;
  cells.cx = 19.5f, cells.cy = 14.5f;
  cells.depth_m.assign(cells.size(), depth_m);
  for (int y = 0; y < cells.height; ++y)
    for (int x = 0; x < cells.width; ++x) {
      cells.ray_x.push_back((static_cast<float>(x) - cells.cx) / cells.fx);
      cells.ray_y.push_back((static_cast<float>(y) - cells.cy) / cells.fy);
    }
  return cells;
}

}  // namespace stillpoint
