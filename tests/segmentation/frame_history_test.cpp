// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/segmentation/frame_history.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace {

using namespace stillpoint;

RgbdFrame blank_frame(double timestamp) {
  RgbdFrame frame;
  frame.color = cv::Mat::zeros(4, 4, CV_8UC1);
  frame.timestamp = timestamp;
  return frame;
}

Eigen::Isometry3d moved(double x) { return Eigen::Isometry3d(Eigen::Translation3d(x, 0, 0)); }

TEST(FrameHistory, TakesAMotionThatIsNotFiniteForNone) {
  for (const double bad : {std::nan(""), HUGE_VAL}) {
    FrameHistory history(10);
    history.add(blank_frame(1), moved(0));
    history.add(blank_frame(2), moved(bad));
    history.add(blank_frame(3), moved(0.01));
    EXPECT_FALSE(history.motion(0, 2));
    ASSERT_TRUE(history.motion(1, 2));
    EXPECT_TRUE(history.motion(1, 2)->isApprox(moved(0.01)));
  }
}

TEST(FrameHistory, TakesTheMotionThatIsKnownBetter) {
  FrameHistory history(10);
  history.add(blank_frame(1), std::nullopt);
  history.add(blank_frame(2), std::nullopt);
  EXPECT_FALSE(history.motion(0, 1));
  history.set_newest_motion(moved(0.01));
  ASSERT_TRUE(history.motion(0, 1));
  EXPECT_TRUE(history.motion(0, 1)->isApprox(moved(0.01)));
}

}  // namespace
