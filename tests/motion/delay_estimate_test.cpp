// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/motion/delay_estimate.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "stillpoint/core/random.hpp"

namespace {

using namespace stillpoint;

// A camera that looks to and fro and up and down, up to a radian per second.
Eigen::Vector3d velocity(int i) { return {0.5 * std::sin(0.31 * i), std::sin(0.2 * i), 0}; }

// Depth that is taken `mean_s` late, and up to `jitter_s` more or less. Like DepthPose, takes what
// is known into account.
class LateDepth {
 public:
  LateDepth(double mean_s, double jitter_s) : mean_s_(mean_s), jitter_s_(jitter_s) {}

  void add_frames(int n, double speed = 1) {
    for (int k = 0; k < n; ++k) {
      const Eigen::Vector3d now = speed * velocity(++i_), before = speed * velocity(i_ - 1);
      const double late = mean_s_ + jitter_s_ * even(), known = applied();
      Eigen::Vector3d noise;
      for (int axis = 0; axis < 3; ++axis) noise[axis] = even();  // one order in every compiler
      estimate.add(now, before, now * (late - known) - before * (last_ - known) + 0.001 * noise);
      last_ = late;
    }
  }

  DelayEstimate estimate;

 private:
  double even() { return 2 * random_.uniform() - 1; }
  double applied() const { return estimate.delay().known() ? estimate.delay().mean_s : 0; }

  double mean_s_, jitter_s_, last_ = mean_s_;
  int i_ = 0;
  RandomGenerator random_{1};
};

TEST(DelayEstimate, FindsTheMean) {
  for (const double mean_s : {-0.03, 0.0, 0.01, 0.05}) {
    SCOPED_TRACE(mean_s);
    LateDepth camera(mean_s, 0);
    camera.add_frames(200);
    const DepthDelay& found = camera.estimate.delay();
    EXPECT_TRUE(found.known());
    EXPECT_NEAR(found.mean_s, mean_s, 4 * found.error_s);
    EXPECT_LT(found.error_s, 0.001);
    EXPECT_LT(found.spread_s, 0.0015);
  }
}

TEST(DelayEstimate, FindsTheSpread) {
  for (const double jitter_s : {0.006, 0.015}) {
    SCOPED_TRACE(jitter_s);
    LateDepth camera(0.02, jitter_s);
    camera.add_frames(600);
    const DepthDelay& found = camera.estimate.delay();
    EXPECT_NEAR(found.mean_s, 0.02, 4 * found.error_s);
    // An even distribution between -1 and 1 has this deviation.
    EXPECT_NEAR(found.spread_s, jitter_s / std::sqrt(3.0), 0.15 * jitter_s);
  }
}

TEST(DelayEstimate, KnowsNothingOfACameraThatHardlyRotates) {
  LateDepth camera(0.02, 0);
  camera.add_frames(500, 0.02);
  EXPECT_FALSE(camera.estimate.delay().known());
}

TEST(DelayEstimate, KnowsNothingAfterAFewFrames) {
  LateDepth camera(0.02, 0);
  camera.add_frames(15);
  EXPECT_FALSE(camera.estimate.delay().known());
}

TEST(DelayEstimate, ForgetsFailedRegistrations) {
  LateDepth camera(0.02, 0);
  camera.add_frames(100);
  for (int i = 0; i < 20; ++i)
    camera.estimate.add({0, 0.5, 0}, {0, 0.4, 0}, {0, i % 2 == 0 ? 0.2 : -0.2, 0});
  EXPECT_NEAR(camera.estimate.delay().mean_s, 0.02, 0.001);
}

// Clocks drift apart.
TEST(DelayEstimate, FollowsAChange) {
  DelayEstimate estimate;
  for (const double late : {0.0, 0.02}) {
    for (int i = 1; i < 500; ++i) {
      const double known = estimate.delay().known() ? estimate.delay().mean_s : 0;
      estimate.add(velocity(i), velocity(i - 1), (late - known) * (velocity(i) - velocity(i - 1)));
    }
    EXPECT_NEAR(estimate.delay().mean_s, late, 0.001);
  }
}

}  // namespace
