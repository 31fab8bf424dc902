// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/core/image_scale.hpp"

#include <gtest/gtest.h>

namespace {

using namespace stillpoint;

TEST(ImageScale, TurnsSettingsIntoPixelsOfTheImage) {
  EXPECT_EQ(scaled_px(10, {640, 480}), 10);
  EXPECT_EQ(scaled_px(10, {1920, 1080}), 30);
  EXPECT_EQ(scaled_px(10, {32, 24}), 1);
  EXPECT_EQ(scaled_px(0, {640, 480}), 0);
}

TEST(ImageScale, GrowsARectAndClipsIt) {
  const cv::Size size(100, 60);
  EXPECT_EQ(grow_rect({10, 20, 5, 6}, 3, size), cv::Rect(7, 17, 11, 12));
  EXPECT_EQ(grow_rect({1, 2, 98, 57}, 3, size), cv::Rect(0, 0, 100, 60));
  EXPECT_EQ(grow_rect({10, 20, 5, 6}, 0, size), cv::Rect(10, 20, 5, 6));
}

}  // namespace
