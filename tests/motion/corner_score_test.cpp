// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/motion/corner_score.hpp"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "../flat_scene.hpp"

namespace {

using namespace stillpoint;

TEST(CornerScore, IsThatOfOpenCv) {
  const cv::Mat color = FlatScene().frame(0, {{{60, 40, 90, 120}, 2, 3}}).color;
  cv::Mat gray, found, expected;
  cv::cvtColor(color, gray, cv::COLOR_BGR2GRAY);
  for (const cv::Size& size : {cv::Size(160, 120), cv::Size(53, 31)}) {
    cv::resize(gray, gray, size, 0, 0, cv::INTER_AREA);
    detail::CornerScore().find(gray, found);
    cv::cornerMinEigenVal(gray, expected, 3);
    const cv::Rect inside(cv::Point(2, 2), size - cv::Size(4, 4));  // not where borders count
    double most = 0;
    cv::minMaxLoc(expected(inside), nullptr, &most);
    EXPECT_GT(most, 0.01);
    EXPECT_LT(cv::norm(found(inside), expected(inside), cv::NORM_INF), 1e-5 * most);
  }
}

TEST(CornerScore, TakesTinyImages) {
  cv::Mat found;
  detail::CornerScore().find(cv::Mat(2, 1, CV_8UC1, cv::Scalar(9)), found);
  EXPECT_EQ(found.size(), cv::Size(1, 2));
  EXPECT_EQ(cv::countNonZero(found), 0);
}

}  // namespace
