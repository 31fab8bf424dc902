// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/motion/readout_estimate.hpp"

#include <gtest/gtest.h>

#include "stillpoint/core/random.hpp"

namespace {

using namespace stillpoint;

// Frames that find a third of what is wrong with the time assumed, and noise. Like DepthPose,
// assumes what is known.
void add_frames(double readout_s, int n, ReadoutEstimate& estimate) {
  RandomGenerator random(1);
  for (int i = 0; i < n; ++i) {
    const DepthReadout& known = estimate.readout();
    const double assumed = known.known() ? known.mean_s : 0;
    estimate.add(assumed + (readout_s - assumed) / 3 + 0.002 * (2 * random.uniform() - 1), 1e5);
  }
}

TEST(ReadoutEstimate, ComesNearThoughEachFrameFindsTooLittle) {
  for (const double readout_s : {-0.015, 0.0, 0.01, 0.033}) {
    SCOPED_TRACE(readout_s);
    ReadoutEstimate estimate;
    EXPECT_FALSE(estimate.readout().known());
    add_frames(readout_s, 400, estimate);
    EXPECT_TRUE(estimate.readout().known());
    EXPECT_NEAR(estimate.readout().mean_s, readout_s, 0.001);
  }
}

TEST(ReadoutEstimate, AFewFramesTellNothing) {
  ReadoutEstimate estimate;
  add_frames(0.03, 9, estimate);
  EXPECT_FALSE(estimate.readout().known());
}

TEST(ReadoutEstimate, FramesWithoutInformationAreLeftOut) {
  ReadoutEstimate estimate;
  for (int i = 0; i < 100; ++i) estimate.add(0.03, 500), estimate.add(0.2, 1e6);
  EXPECT_FALSE(estimate.readout().known());
  EXPECT_EQ(estimate.readout().mean_s, 0);
}

}  // namespace
