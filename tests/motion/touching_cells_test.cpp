// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/motion/touching_cells.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <vector>

namespace stillpoint {
namespace {

// 80 x 60 cells of a view in which depth is a function of the ray.
class Touching : public testing::Test {
 protected:
  void look(const std::function<float(float x, float y)>& depth_m) {
    cells_.width = 80, cells_.height = 60;
    cells_.fx = cells_.fy = 65;
    for (int y = 0; y < 60; ++y)
      for (int x = 0; x < 80; ++x) {
        const float ray_x = (static_cast<float>(x) - 39.5f) / 65;
        const float ray_y = (static_cast<float>(y) - 29.5f) / 65;
        cells_.depth_m.push_back(depth_m(ray_x, ray_y));
      }
    dynamic_.assign(cells_.size(), 0);
  }
  void move(int x, int y) { dynamic_[cells_.index(x, y)] = 1; }
  // It moves 3 cm before what is there, in these rows.
  void put_hand_down(int first_row, int end_row) {
    for (int y = first_row; y < end_row; ++y)
      for (int x = 36; x < 42; ++x) {
        cells_.depth_m[cells_.index(x, y)] -= 0.03f;
        move(x, y);
      }
  }
  bool touches(int x, int y) {
    return TouchingCells().find(cells_, dynamic_)[cells_.index(x, y)] != 0;
  }

  DepthCells cells_;
  std::vector<std::uint8_t> dynamic_;
};

// A person before a wall holds still but for an arm.
TEST_F(Touching, IsThePersonAndNotTheWallBehind) {
  look([](float x, float) { return x > -0.1f && x < 0.1f ? 2.0f : 4.0f; });
  for (int x = 38; x < 41; ++x) move(x, 20);
  EXPECT_TRUE(touches(38, 20)) << "what is dynamic itself";
  EXPECT_TRUE(touches(34, 20));
  EXPECT_TRUE(touches(44, 24));
  EXPECT_FALSE(touches(39, 50)) << "farther than an arm is long";
  EXPECT_FALSE(touches(26, 20));
}

TEST_F(Touching, IsNotATableOnWhichAHandMoves) {
  // The camera looks down on it at a slant.
  look([](float, float y) { return 1 / (0.9f + 0.8f * y); });
  put_hand_down(30, 40);
  for (const int x : {10, 30, 34, 44, 60}) EXPECT_FALSE(touches(x, 35)) << x;
  EXPECT_FALSE(touches(39, 27));
}

// Between an arm that comes from below and the upper end of the image, the table goes on evenly
// across and along diagonals only.
TEST_F(Touching, IsNotTheTableBeyondAHand) {
  look([](float, float y) { return 1 / (1.5f + 0.3f * y); });
  put_hand_down(30, 60);
  for (const int x : {36, 39, 41})
    for (const int y : {5, 20, 29}) EXPECT_FALSE(touches(x, y)) << x << " " << y;
}

TEST_F(Touching, IsWhatStandsOnTheFloor) {
  // The floor, 0.6 m below the camera, and somebody who stands on it 2 m away.
  look([](float x, float y) {
    const float floor = y > 0.1f ? 0.6f / y : 6.0f;
    return x > -0.15f && x < 0.15f ? std::min(2.0f, floor) : floor;
  });
  ASSERT_LT(std::abs(cells_.depth_m[cells_.index(39, 48)] - 2), 0.02f) << "no step at the feet";
  for (int x = 36; x < 44; ++x) move(x, 40);
  EXPECT_TRUE(touches(39, 45)) << "the legs";
  EXPECT_TRUE(touches(34, 46));
  EXPECT_FALSE(touches(39, 56)) << "the floor";
}

TEST_F(Touching, NothingTouchesNothing) {
  look([](float, float) { return 3.0f; });
  EXPECT_FALSE(touches(39, 20));
}

}  // namespace
}  // namespace stillpoint
