// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/depth/dilate.hpp"

#include <gtest/gtest.h>

#include "../flat_scene.hpp"
#include "stillpoint/core/random.hpp"

namespace {

using namespace stillpoint;

cv::Mat dilated(const cv::Mat& in, int radius) {
  cv::Mat out;
  detail::dilate_square(in, radius, out);
  return out;
}

TEST(Dilate, GrowsARectAndClipsIt) {
  const cv::Size size(100, 60);
  EXPECT_EQ(grow_rect({10, 20, 5, 6}, 3, size), cv::Rect(7, 17, 11, 12));
  EXPECT_EQ(grow_rect({1, 2, 98, 57}, 3, size), cv::Rect(0, 0, 100, 60));
  EXPECT_EQ(grow_rect({10, 20, 5, 6}, 0, size), cv::Rect(10, 20, 5, 6));
}

TEST(Dilate, MakesASquareOfEachPixel) {
  RandomGenerator random(3);
  const cv::Size size(160, 70);
  for (int k = 0; k < 30; ++k) {
    const cv::Rect part(20, 10, 100, 50);
    const int radius = static_cast<int>(random.below(k % 8 == 0 ? 100 : 16));
    cv::Mat in = cv::Mat::zeros(size, CV_8UC1), expected = in.clone();
    for (int d = 0; d < 5; ++d) {
      const cv::Point p = part.tl() + cv::Point(static_cast<int>(random.below(100)),
                                                static_cast<int>(random.below(50)));
      in.at<uchar>(p) = 255;
      expected(grow_rect({p.x, p.y, 1, 1}, radius, size)).setTo(255);
    }
    ASSERT_TRUE(identical(dilated(in, radius), expected)) << "radius " << radius;
  }
}

TEST(Dilate, LeavesFullAndEmptyMasks) {
  const cv::Size size(64, 48);
  for (const int radius : {0, 1, 10, 100}) {
    const cv::Mat full(size, CV_8UC1, cv::Scalar(255)), none = cv::Mat::zeros(size, CV_8UC1);
    EXPECT_TRUE(identical(dilated(full, radius), full)) << radius;
    EXPECT_TRUE(identical(dilated(none, radius), none)) << radius;
  }
}

TEST(Dilate, SeesNothingBeyondAPartOfALargerImage) {
  cv::Mat large(80, 90, CV_8UC1, cv::Scalar(255));
  cv::Mat in = large(cv::Rect(20, 10, 50, 40));
  in.setTo(0);
  in.at<uchar>(3, 4) = 255;
  EXPECT_EQ(pixels(dilated(in, 5)), 10 * 9);
}

}  // namespace
