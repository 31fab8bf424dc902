// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/motion/mover_detector.hpp"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>

namespace stillpoint {
namespace {

// A wall 4 m ahead, and a surface of 20 x 20 cells at 2.2 m, at the left rim, of which the outer
// columns have moved; of the others earlier frames looked at `seen` columns.
std::size_t found(int moved_columns, int seen_columns) {
  DepthCells cells;
  cells.width = 80, cells.height = 60, cells.fx = cells.fy = 65;
  cells.depth_m.assign(cells.size(), 4.0f);
  CellLabels labels;
  labels.reset(8, cells.width, cells.height);
  for (int y = 20; y < 40; ++y)
    for (int x = 0; x < 20; ++x) {
      const std::size_t i = cells.index(x, y);
      cells.depth_m[i] = 2.2f;
      if (x >= 20 - moved_columns) labels[i] = CellLabel::kMoved;
      if (x >= 20 - moved_columns - seen_columns) labels.set_seen(i);
    }
  MoverDetector detector{MoverDetectorSettings()};
  return detector.find(cells, labels).size();
}

TEST(MoverDetector, NeedsAShareOfMovedCellsAmongThoseThatCanBeJudged) {
  EXPECT_EQ(found(5, 15), 1u);
  EXPECT_EQ(found(1, 19), 0u) << "a twentieth of a surface that has been seen";
  EXPECT_EQ(found(1, 2), 1u) << "of one that comes into view";
}

}  // namespace
}  // namespace stillpoint
