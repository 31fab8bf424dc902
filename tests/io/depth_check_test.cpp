// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/io/depth_check.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "stillpoint/io/tum_sequence.hpp"

namespace {

using stillpoint::check_depth_scale;
using stillpoint::RgbdFrame;

RgbdFrame frame_of(int type, double value, double units_per_m) {
  RgbdFrame frame;
  frame.color = cv::Mat::zeros(9, 12, CV_8UC3);
  frame.depth = cv::Mat(9, 12, type, cv::Scalar(value));
  frame.depth(cv::Rect(0, 0, 12, 4)) = 0;  // no measurement
  frame.depth_units_per_m = units_per_m;
  return frame;
}

TEST(DepthCheck, SaysNothingWhenDepthMakesSense) {
  EXPECT_FALSE(check_depth_scale(frame_of(CV_16UC1, 10000, 5000)));
  EXPECT_FALSE(check_depth_scale(frame_of(CV_16UC1, 2000, 1000)));
  EXPECT_FALSE(check_depth_scale(frame_of(CV_32FC1, 2.5, 5000)));
  EXPECT_DOUBLE_EQ(*median_depth_m(frame_of(CV_16UC1, 10000, 5000)), 2.0);
}

TEST(DepthCheck, CallsOutAWrongFactorAndNamesABetterOne) {
  const auto near = check_depth_scale(frame_of(CV_16UC1, 400, 5000));  // 0.08 m
  ASSERT_TRUE(near);
  EXPECT_NE(near->find("0.08 m"), std::string::npos) << *near;
  EXPECT_NE(near->find("5000 is likely wrong"), std::string::npos) << *near;
  const auto far = check_depth_scale(frame_of(CV_16UC1, 10000, 1));
  ASSERT_TRUE(far);
  EXPECT_NE(far->find("10000 m"), std::string::npos) << *far;
  EXPECT_NE(far->find("5000 would give 2 m"), std::string::npos) << *far;
  const auto millimetres = check_depth_scale(frame_of(CV_16UC1, 1500, 20000));
  ASSERT_TRUE(millimetres);
  EXPECT_NE(millimetres->find("1000 would give 1.5 m"), std::string::npos) << *millimetres;
  const auto floats = check_depth_scale(frame_of(CV_32FC1, 1500, 5000));
  ASSERT_TRUE(floats);
  EXPECT_NE(floats->find("millimetres"), std::string::npos) << *floats;
}

TEST(DepthCheck, JudgesByMeasurementsOnly) {
  EXPECT_FALSE(check_depth_scale(frame_of(CV_16UC1, 0, 5000))) << "all black";
  EXPECT_FALSE(check_depth_scale(frame_of(CV_32FC1, std::numeric_limits<double>::quiet_NaN(), 1)));
  EXPECT_FALSE(check_depth_scale(RgbdFrame()));
  RgbdFrame mostly_far = frame_of(CV_32FC1, 2, 1);
  mostly_far.depth(cv::Rect(0, 4, 12, 2)) = 1000;  // 24 of 60 pixels
  EXPECT_FALSE(check_depth_scale(mostly_far));
}

TEST(DepthCheck, OfARealFrame) {
  const std::filesystem::path folder = STILLPOINT_SHARED_DATA "/real/fr1_desk";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no " << folder;
  RgbdFrame frame = stillpoint::TumSequence(folder).load(0);
  EXPECT_FALSE(check_depth_scale(frame));
  for (const double wrong : {1.0, 100000.0}) {
    frame.depth_units_per_m = wrong;
    const auto message = check_depth_scale(frame);
    ASSERT_TRUE(message) << wrong;
    EXPECT_NE(message->find(": 5000 would give"), std::string::npos) << *message;
  }
}

}  // namespace
