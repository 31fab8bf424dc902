// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/depth/stratified_samples.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace {

using stillpoint::StratifiedSamples;

const cv::Size kSize(640, 480);

TEST(StratifiedSamples, DrawsOnePlaceInEachCell) {
  for (const int side : {1, 4, 7, 64}) {
    const StratifiedSamples samples(side, 1);
    for (int cy = 0; cy * side < kSize.height; ++cy)
      for (int cx = 0; cx * side < kSize.width; ++cx) {
        const cv::Rect cell =
            cv::Rect(cx * side, cy * side, side, side) & cv::Rect(cv::Point(), kSize);
        ASSERT_TRUE(cell.contains(samples.place(cx, cy, kSize))) << side << ": " << cx << " " << cy;
      }
  }
}

TEST(StratifiedSamples, DrawsEvenlyInsideTheCells) {
  const StratifiedSamples samples(4, 7);
  std::vector<int> count(16, 0);
  for (int cy = 0; cy < 120; ++cy)
    for (int cx = 0; cx < 160; ++cx) {
      const cv::Point p = samples.place(cx, cy, kSize);
      ++count[static_cast<std::size_t>(p.y % 4 * 4 + p.x % 4)];
    }
  for (int c : count) EXPECT_NEAR(c, 1200, 200);
}

TEST(StratifiedSamples, DependsOnTheSeedOnly) {
  const StratifiedSamples a(8, 1), b(8, 1), c(8, 2);
  int different = 0;
  for (int cy = 0; cy < 60; ++cy)
    for (int cx = 0; cx < 80; ++cx) {
      EXPECT_EQ(a.place(cx, cy, kSize), b.place(cx, cy, kSize));
      different += a.place(cx, cy, kSize) != c.place(cx, cy, kSize);
    }
  EXPECT_GT(different, 4000);
}

TEST(StratifiedSamples, KnowsTheCellsOfARect) {
  const StratifiedSamples samples(4, 1);
  EXPECT_EQ(samples.cells_of({0, 0, 4, 4}), cv::Rect(0, 0, 1, 1));
  EXPECT_EQ(samples.cells_of({3, 0, 2, 5}), cv::Rect(0, 0, 2, 2));
  EXPECT_EQ(samples.cells_of({8, 12, 1, 1}), cv::Rect(2, 3, 1, 1));
}

}  // namespace
