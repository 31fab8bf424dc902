// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/motion/mover_detector.hpp"

#include <gtest/gtest.h>

#include <cstddef>
#include <opencv2/core.hpp>
#include <vector>

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

// A board 1.5 m ahead fills most of the image, which cuts it off on three sides. Of its middle
// `moved_columns` have moved, and `corners` cells show it by a corner; what is beside the middle
// counts as static, as it moves in its own plane.
std::size_t found_of_board(int moved_columns, std::size_t corners) {
  DepthCells cells;
  cells.width = 80, cells.height = 60, cells.fx = cells.fy = 65;
  cells.depth_m.assign(cells.size(), 4.0f);
  CellLabels labels;
  labels.reset(8, cells.width, cells.height);
  std::vector<std::size_t> outlier_corners;
  for (int y = 0; y < 60; ++y)
    for (int x = 30; x < 80; ++x) {
      const std::size_t i = cells.index(x, y);
      cells.depth_m[i] = 1.5f;
      labels.set_seen(i);
      if (x >= 60 || x < 40)
        labels[i] = CellLabel::kStatic;
      else if (x >= 60 - moved_columns)
        labels[i] = CellLabel::kMoved;
      if (x == 59 && outlier_corners.size() < corners) outlier_corners.push_back(i);
    }
  MoverDetector detector{MoverDetectorSettings()};
  return detector.find(cells, labels, outlier_corners).size();
}

TEST(MoverDetector, BelievesCornersWhereTheImageCutsAMoverOff) {
  EXPECT_EQ(found_of_board(20, 0), 0u) << "depth alone may be wrong on a piece of a wall";
  EXPECT_EQ(found_of_board(20, 7), 0u);
  EXPECT_EQ(found_of_board(20, 8), 1u);
  EXPECT_EQ(found_of_board(5, 8), 1u);
  EXPECT_EQ(found_of_board(4, 8), 0u) << "less than a third of it has moved";
}

}  // namespace
}  // namespace stillpoint
