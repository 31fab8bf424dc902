// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/depth/depth_samples.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace {

using namespace stillpoint;

const cv::Size kSize(640, 480);

// A frame in which each pixel's depth tells where it is: 1 + x + 640 y, modulo 65521, in
// millimetres.
DepthView depth() {
  RgbdFrame frame;
  frame.color = cv::Mat::zeros(kSize, CV_8UC3);
  frame.depth.create(kSize, CV_16UC1);
  for (int y = 0; y < kSize.height; ++y)
    for (int x = 0; x < kSize.width; ++x)
      frame.depth.at<std::uint16_t>(y, x) =
          static_cast<std::uint16_t>((1 + x + kSize.width * y) % 65521);
  frame.depth_units_per_m = 1000;
  DepthView view;
  view.set(frame, Camera());
  return view;
}

TEST(DepthSamples, AreOnePlaceInEachCell) {
  const DepthView view = depth();
  for (const int side : {1, 4, 7, 64, 300}) {
    DepthSamples samples(side, 1);
    samples.begin(view);
    ASSERT_EQ(samples.units().size(),
              cv::Size((kSize.width - 1) / side + 1, (kSize.height - 1) / side + 1));
    for (int y = 0; y < samples.units().rows; ++y)
      for (int x = 0; x < samples.units().cols; ++x) {
        const cv::Rect cell =
            cv::Rect(x * side, y * side, side, side) & cv::Rect(cv::Point(), kSize);
        const cv::Point p = samples.place({x, y});
        ASSERT_TRUE(cell.contains(p)) << side << ": " << x << " " << y;
        ASSERT_EQ(samples.units()(y, x), view.row(p.y)[p.x]);
        ASSERT_FLOAT_EQ(samples.z({x, y}), 0.001f * view.row(p.y)[p.x]);
      }
  }
}

TEST(DepthSamples, AreDrawnEvenlyInsideTheCells) {
  const DepthView view = depth();
  DepthSamples samples(4, 7);
  samples.begin(view);
  std::vector<int> count(16, 0);
  for (int y = 0; y < 120; ++y)
    for (int x = 0; x < 160; ++x) {
      const cv::Point p = samples.place({x, y});
      ++count[static_cast<std::size_t>(p.y % 4 * 4 + p.x % 4)];
    }
  for (int c : count) EXPECT_NEAR(c, 1200, 200);
}

TEST(DepthSamples, DependOnTheSeedOnly) {
  const DepthView view = depth();
  DepthSamples a(8, 1), b(8, 1), c(8, 2);
  for (DepthSamples* samples : {&a, &b, &c}) samples->begin(view);
  int different = 0;
  for (int y = 0; y < 60; ++y)
    for (int x = 0; x < 80; ++x) {
      EXPECT_EQ(a.place({x, y}), b.place({x, y}));
      different += a.place({x, y}) != c.place({x, y});
    }
  EXPECT_GT(different, 4000);
}

TEST(DepthSamples, KnowTheCellsOfARect) {
  const DepthView view = depth();
  DepthSamples samples(4, 1);
  samples.begin(view);
  EXPECT_EQ(samples.cells_of({0, 0, 4, 4}), cv::Rect(0, 0, 1, 1));
  EXPECT_EQ(samples.cells_of({3, 0, 2, 5}), cv::Rect(0, 0, 2, 2));
  EXPECT_EQ(samples.cells_of({8, 12, 1, 1}), cv::Rect(2, 3, 1, 1));
  int visited = 0;
  const cv::Rect box(3, 2, 10, 9);
  samples.for_each_in(box, [&](const cv::Point& cell, const cv::Point& pixel) {
    ++visited;
    EXPECT_TRUE(box.contains(pixel));
    EXPECT_EQ(samples.place(cell), pixel);
  });
  int expected = 0;
  for (int y = 0; y < 3; ++y)
    for (int x = 0; x < 4; ++x) expected += box.contains(samples.place({x, y}));
  EXPECT_EQ(visited, expected);
}

}  // namespace
