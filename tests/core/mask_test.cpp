// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/core/mask.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace {

using stillpoint::DynamicMask;

DynamicMask mask_with(int x, int y) {
  DynamicMask mask;
  mask.image = cv::Mat::zeros(6, 8, CV_8UC1);
  mask.image.at<uchar>(y, x) = 255;
  return mask;
}

TEST(DynamicMask, TakesTheNearestPixel) {
  const DynamicMask mask = mask_with(3, 2);
  EXPECT_TRUE(mask.dynamic_at(3, 2));
  EXPECT_TRUE(mask.dynamic_at(2.5f, 1.5f));
  EXPECT_TRUE(mask.dynamic_at(3.49f, 2.49f));
  EXPECT_FALSE(mask.dynamic_at(3.5f, 2));
  EXPECT_FALSE(mask.dynamic_at(3, 2.5f));
  EXPECT_FALSE(mask.dynamic_at(2.49f, 2));
  EXPECT_FALSE(mask.dynamic_at(2, 3)) << "x is the column";
}

TEST(DynamicMask, RoundsAtTheBorder) {
  EXPECT_TRUE(mask_with(0, 0).dynamic_at(-0.5f, -0.5f));
  EXPECT_FALSE(mask_with(0, 0).dynamic_at(-0.51f, 0));
  EXPECT_TRUE(mask_with(7, 5).dynamic_at(7.49f, 5.49f));
  EXPECT_FALSE(mask_with(7, 5).dynamic_at(7.5f, 5));
  EXPECT_FALSE(mask_with(7, 5).dynamic_at(7, 5.5f));
}

TEST(DynamicMask, IsStaticOutsideThePictureAndForNoNumber) {
  DynamicMask mask = mask_with(3, 2);
  mask.image.setTo(255);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float infinity = std::numeric_limits<float>::infinity();
  for (const float bad : {nan, infinity, -infinity, 1e30f, -1e30f, 100.0f}) {
    EXPECT_FALSE(mask.dynamic_at(bad, 2));
    EXPECT_FALSE(mask.dynamic_at(3, bad));
  }
  EXPECT_FALSE(DynamicMask().dynamic_at(0, 0));
}

TEST(DynamicMask, TurnsItsPolarity) {
  const DynamicMask mask = mask_with(3, 2);
  const cv::Mat inverse = mask.static_image();
  EXPECT_EQ(inverse.type(), CV_8UC1);
  EXPECT_EQ(inverse.at<uchar>(2, 3), 0);
  EXPECT_EQ(inverse.at<uchar>(2, 2), 255);
  EXPECT_EQ(cv::countNonZero(inverse), 47);
  EXPECT_DOUBLE_EQ(mask.coverage(), 1.0 / 48);
  EXPECT_EQ(DynamicMask().coverage(), 0);
}

}  // namespace
