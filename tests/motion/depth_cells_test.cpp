// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/motion/depth_cells.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>

#include "../any_size.hpp"
#include "small_camera.hpp"
#include "stillpoint/core/frame_context.hpp"

namespace stillpoint {
namespace {

constexpr int kBlock = 8, kEdgeColumn = 20;

// A wall, and from the middle of a column of cells on another one `step_m` before it. `noise` is
// the standard deviation of a pixel's depth over z^2.
DepthCells cells_of(double wall_m, double step_m, double noise) {
  RgbdFrame frame;
  frame.color = cv::Mat(kHeight, kWidth, CV_8UC1, cv::Scalar(100));
  cv::Mat_<double> z(kHeight, kWidth, wall_m), errors(z.size());
  z.colRange(kEdgeColumn * kBlock + kBlock / 2, kWidth) -= step_m;
  cv::RNG random(3);
  random.fill(errors, cv::RNG::NORMAL, 0, noise);
  cv::Mat(5000 * (z + errors.mul(z.mul(z)))).convertTo(frame.depth, CV_16U);
  frame.depth_units_per_m = 5000;
  FrameContext context;
  context.begin(frame, small_camera());
  DepthCells cells;
  cells.set(context.depth, kBlock);
  return cells;
}

// The share of cells that count as one surface: in the column of the edge, and elsewhere.
double whole_share(const DepthCells& cells, bool at_edge) {
  int whole = 0, all = 0;
  for (int y = 0; y < cells.height; ++y)
    for (int x = 0; x < cells.width; ++x) {
      if ((x == kEdgeColumn) != at_edge) continue;
      ++all;
      whole += cells.depth_m[cells.index(x, y)] > 0;
    }
  return static_cast<double>(whole) / all;
}

TEST(DepthCells, AreTornByStepsWhateverTheNoise) {
  for (const double noise : {0.0, 0.0015, 0.0045, 0.006}) {  // none, a Kinect's, three, four times
    for (const double wall_m : {3.0, 4.0, 5.0}) {
      const DepthCells cells = cells_of(wall_m, 1.5, noise);
      EXPECT_GT(whole_share(cells, false), 0.9) << noise << " at " << wall_m << " m";
      EXPECT_EQ(whole_share(cells, true), 0) << noise << " at " << wall_m << " m";
    }
  }
}

// What spreads little over most of the image is no noise: a small step tears as ever.
TEST(DepthCells, AreTornBySmallStepsWhereThereIsLittleNoise) {
  EXPECT_EQ(whole_share(cells_of(4, 0.35, 0.0015), true), 0);
  EXPECT_GT(whole_share(cells_of(4, 0.1, 0.0015), true), 0.5);
}

// As many cells, otherwise arranged.
TEST(DepthCells, KnowTheRaysOfAnImageThatTurned) {
  DepthCells cells;
  for (const cv::Size& size : {cv::Size(320, 240), cv::Size(240, 320)}) {
    RgbdFrame frame;
    frame.color = cv::Mat(size, CV_8UC1, cv::Scalar(100));
    frame.depth = cv::Mat(size, CV_16UC1, cv::Scalar(10000));
    FrameContext context;
    context.begin(frame, of_any_size(small_camera()));
    cells.set(context.depth, kBlock);
    for (int y = 0; y < cells.height; ++y)
      for (int x = 0; x < cells.width; ++x) {
        const std::size_t i = cells.index(x, y);
        const auto [u, v] = cells.cell(cells.ray_x[i], cells.ray_y[i]);
        EXPECT_NEAR(u, x, 1e-3);
        EXPECT_NEAR(v, y, 1e-3);
      }
  }
}

// Blocks of any size: a slope with holes, a block without depth and a step. Of each block every
// second pixel of every second row counts.
TEST(DepthCells, AreTheMeansOfTheirPixels) {
  for (const int block : {2, 4, 6, 8, 10, 16, 64}) {
    SCOPED_TRACE(block);
    RgbdFrame frame;
    frame.color = cv::Mat(200, 300, CV_8UC1, cv::Scalar(100));
    frame.depth = cv::Mat(200, 300, CV_16UC1);
    cv::RNG random(3);
    for (int y = 0; y < 200; ++y)
      for (int x = 0; x < 300; ++x)
        frame.depth.at<std::uint16_t>(y, x) = static_cast<std::uint16_t>(
            (x < 70 && y < 70) || random.uniform(0, 3) == 0 ? 0 : (x < 200 ? 2000 : 3000) + x / 4);
    FrameContext context;
    context.begin(frame, of_any_size(small_camera()));
    DepthCells cells;
    cells.set(context.depth, block);
    ASSERT_EQ(cells.width, 300 / block);
    ASSERT_EQ(cells.height, 200 / block);
    for (int cy = 0; cy < cells.height; ++cy)
      for (int cx = 0; cx < cells.width; ++cx) {
        double sum = 0;
        int n = 0, all = 0, far = 0;
        for (int y = cy * block + 1; y < (cy + 1) * block; y += 2)
          for (int x = cx * block + 1; x < (cx + 1) * block; x += 2) {
            const int z = frame.depth.at<std::uint16_t>(y, x);
            ++all, n += z > 0, sum += z, far += z > 0 && x >= 200;
          }
        const double mean_m = sum / n * metres_per_unit(frame);
        const double expected = n == 0 ? -1 : 2 * n < all ? 0 : far > 0 && far < n ? 0 : mean_m;
        EXPECT_NEAR(cells.depth_m[cells.index(cx, cy)], expected, 1e-5) << cx << ", " << cy;
      }
  }
}

TEST(DepthCells, SayNothingWhereTheLensHasNoRay) {
  Camera camera = small_camera();
  camera.fx = camera.fy = 230, camera.k1 = -0.4;
  RgbdFrame frame;
  frame.color = cv::Mat(kHeight, kWidth, CV_8UC1, cv::Scalar(100));
  frame.depth = cv::Mat(kHeight, kWidth, CV_16UC1, cv::Scalar(10000));
  FrameContext context;
  context.begin(frame, camera);
  DepthCells cells;
  cells.set(context.depth, kBlock);
  int without = 0;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const bool ray = std::isfinite(cells.ray_x[i]) && std::isfinite(cells.ray_y[i]);
    without += !ray;
    EXPECT_EQ(cells.depth_m[i], ray ? 2.0f : 0.0f) << i;
  }
  EXPECT_GT(without, 0);
  EXPECT_FALSE(std::isfinite(cells.ray_x[0]));
}

TEST(DepthCells, OfAnImageNarrowerThanACellAreNone) {
  RgbdFrame frame;
  frame.color = cv::Mat(40, 1, CV_8UC1, cv::Scalar(100));
  frame.depth = cv::Mat(40, 1, CV_16UC1, cv::Scalar(10000));
  FrameContext context;
  context.begin(frame, Camera());
  DepthCells cells;
  cells.set(context.depth, kBlock);
  EXPECT_EQ(cells.size(), 0u);
}

}  // namespace
}  // namespace stillpoint
