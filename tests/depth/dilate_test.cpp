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

// What lies in `part` of `in`, dilated; all else of `in` is zero.
cv::Mat dilated(const cv::Mat& in, const cv::Rect& part, int radius, detail::Dilation& dilation) {
  cv::Mat out = cv::Mat::zeros(in.size(), CV_8UC1);
  detail::BitMask bits;
  bits.reset(in.size());
  bits.add(in, {0, 0, in.cols, in.rows});
  const int end = grow_rect(part, radius, in.size()).br().x;
  dilation.run(bits, part, radius, [&](int y, const std::uint64_t* row) {
    detail::unpack(row, 0, static_cast<std::size_t>(end - dilation.left()),
                   out.ptr<uchar>(y) + dilation.left());
  });
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
  detail::Dilation dilation;  // used again and again, as a front end does
  for (int k = 0; k < 150; ++k) {
    const cv::Size size(1 + static_cast<int>(random.below(300)),
                        1 + static_cast<int>(random.below(70)));
    cv::Mat in = cv::Mat::zeros(size, CV_8UC1);
    const int x = static_cast<int>(random.below(static_cast<std::size_t>(size.width)));
    const int y = static_cast<int>(random.below(static_cast<std::size_t>(size.height)));
    const cv::Rect part(
        x, y, 1 + static_cast<int>(random.below(static_cast<std::size_t>(size.width - x))),
        1 + static_cast<int>(random.below(static_cast<std::size_t>(size.height - y))));
    const std::size_t dots = random.below(30);
    for (std::size_t d = 0; d < dots; ++d)
      in.at<uchar>(part.y + static_cast<int>(random.below(static_cast<std::size_t>(part.height))),
                   part.x + static_cast<int>(random.below(static_cast<std::size_t>(part.width)))) =
          255;
    const int radius = static_cast<int>(random.below(k % 8 == 0 ? 150 : 16));
    ASSERT_TRUE(identical(dilated(in, part, radius, dilation), by_opencv(in, radius)))
        << "case " << k << ", radius " << radius << ", " << size;
  }
}

TEST(Dilate, EqualsOpenCvOnFullAndEmptyMasks) {
  detail::Dilation dilation;
  const cv::Size size(64, 48);
  const cv::Rect all(0, 0, 64, 48);
  for (const int radius : {0, 1, 10, 100}) {
    const cv::Mat full(size, CV_8UC1, cv::Scalar(255)), none = cv::Mat::zeros(size, CV_8UC1);
    EXPECT_TRUE(identical(dilated(full, all, radius, dilation), full)) << radius;
    EXPECT_TRUE(identical(dilated(none, all, radius, dilation), none)) << radius;
    EXPECT_TRUE(identical(dilated(none, {}, radius, dilation), none)) << radius;
    cv::Mat corner = none.clone();
    corner.at<uchar>(47, 63) = 255;
    EXPECT_TRUE(
        identical(dilated(corner, {63, 47, 1, 1}, radius, dilation), by_opencv(corner, radius)));
  }
}

TEST(Dilate, TakesPartsOfLargerPictures) {
  detail::Dilation dilation;
  cv::Mat large(80, 90, CV_8UC1, cv::Scalar(255));
  cv::Mat in = large(cv::Rect(20, 10, 50, 40));
  in.setTo(0);
  in.at<uchar>(3, 4) = 255;
  EXPECT_TRUE(identical(dilated(in, {4, 3, 1, 1}, 5, dilation), by_opencv(in.clone(), 5)));
}

}  // namespace
