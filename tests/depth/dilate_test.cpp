// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/depth/dilate.hpp"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "../flat_scene.hpp"
#include "stillpoint/core/random.hpp"

namespace {

using namespace stillpoint;

cv::Mat by_opencv(const cv::Mat& in, int radius) {
  cv::Mat out;
  cv::dilate(in, out, cv::getStructuringElement(cv::MORPH_RECT, {2 * radius + 1, 2 * radius + 1}));
  return out;
}

cv::Mat dilated(const cv::Mat& in, const std::vector<cv::Rect>& rects, int radius,
                DilationBuffer& buffer) {
  cv::Mat out = cv::Mat::zeros(in.size(), CV_8UC1);
  dilate_rects(in, rects, radius, out, buffer);
  return out;
}

TEST(Dilate, GrowsARectAndClipsIt) {
  const cv::Size size(100, 60);
  EXPECT_EQ(grow_rect({10, 20, 5, 6}, 3, size), cv::Rect(7, 17, 11, 12));
  EXPECT_EQ(grow_rect({1, 2, 98, 57}, 3, size), cv::Rect(0, 0, 100, 60));
  EXPECT_EQ(grow_rect({10, 20, 5, 6}, 0, size), cv::Rect(10, 20, 5, 6));
}

TEST(Dilate, EqualsOpenCvOnRandomMasks) {
  RandomGenerator random(3);
  DilationBuffer buffer;  // used again and again, as a front end does
  for (int k = 0; k < 150; ++k) {
    const cv::Size size(1 + static_cast<int>(random.below(90)),
                        1 + static_cast<int>(random.below(70)));
    cv::Mat in = cv::Mat::zeros(size, CV_8UC1);
    std::vector<cv::Rect> rects;
    for (std::size_t r = 0; r < 1 + random.below(4); ++r) {
      const int x = static_cast<int>(random.below(static_cast<std::size_t>(size.width)));
      const int y = static_cast<int>(random.below(static_cast<std::size_t>(size.height)));
      const cv::Rect rect(
          x, y, 1 + static_cast<int>(random.below(static_cast<std::size_t>(size.width - x))),
          1 + static_cast<int>(random.below(static_cast<std::size_t>(size.height - y))));
      rects.push_back(rect);
      const std::size_t dots = random.below(12);
      for (std::size_t d = 0; d < dots; ++d)
        in.at<uchar>(
            rect.y + static_cast<int>(random.below(static_cast<std::size_t>(rect.height))),
            rect.x + static_cast<int>(random.below(static_cast<std::size_t>(rect.width)))) = 255;
    }
    const int radius = static_cast<int>(random.below(16));
    ASSERT_TRUE(identical(dilated(in, rects, radius, buffer), by_opencv(in, radius)))
        << "case " << k << ", radius " << radius << ", " << size;
  }
}

TEST(Dilate, EqualsOpenCvOnFullAndEmptyMasks) {
  DilationBuffer buffer;
  const cv::Size size(64, 48);
  const std::vector<cv::Rect> all{{0, 0, 64, 48}};
  for (const int radius : {0, 1, 10, 100}) {
    const cv::Mat full(size, CV_8UC1, cv::Scalar(255)), none = cv::Mat::zeros(size, CV_8UC1);
    EXPECT_TRUE(identical(dilated(full, all, radius, buffer), full)) << radius;
    EXPECT_TRUE(identical(dilated(none, all, radius, buffer), none)) << radius;
    EXPECT_TRUE(identical(dilated(none, {}, radius, buffer), none)) << radius;
    cv::Mat corner = none.clone();
    corner.at<uchar>(47, 63) = 255;
    EXPECT_TRUE(
        identical(dilated(corner, {{63, 47, 1, 1}}, radius, buffer), by_opencv(corner, radius)));
  }
}

TEST(Dilate, AddsToWhatIsThere) {
  DilationBuffer buffer;
  cv::Mat in = cv::Mat::zeros(40, 40, CV_8UC1), out = in.clone();
  in.at<uchar>(10, 10) = 255;
  out.at<uchar>(11, 11) = out.at<uchar>(30, 30) = 255;
  dilate_rects(in, {{10, 10, 1, 1}}, 2, out, buffer);
  EXPECT_EQ(pixels(out), 26);
}

TEST(Dilate, TakesPartsOfLargerPictures) {
  DilationBuffer buffer;
  cv::Mat large(80, 90, CV_8UC1, cv::Scalar(255));
  cv::Mat in = large(cv::Rect(20, 10, 50, 40));
  in.setTo(0);
  in.at<uchar>(3, 4) = 255;
  EXPECT_TRUE(identical(dilated(in, {{4, 3, 1, 1}}, 5, buffer), by_opencv(in.clone(), 5)));
}

}  // namespace
