// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/evaluation/keypoint_metrics.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace {

using stillpoint::compare_keypoints;
using stillpoint::KeypointReason;

struct Point {
  float x, y;
};

TEST(KeypointMetrics, CountsRemovedAgainstTheTruth) {
  cv::Mat truth = cv::Mat::zeros(10, 20, CV_8UC1);
  truth(cv::Rect(0, 0, 10, 10)) = 1;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  //                          person, person, person, wall, wall, wall, wall, nowhere
  std::vector<Point> points{{1, 1},  {2, 2},  {9.4f, 3}, {9.6f, 3},
                            {12, 5}, {13, 5}, {14, 5},   {nan, 5}};
  stillpoint::Selection selection;
  selection.reason = {KeypointReason::kInMask, KeypointReason::kProbable,
                      KeypointReason::kFloor,  KeypointReason::kProbable,
                      KeypointReason::kStatic, KeypointReason::kStatic,
                      KeypointReason::kFloor,  KeypointReason::kOutsidePicture};
  auto m = compare_keypoints(points, selection, truth);
  EXPECT_EQ(m.counts.true_positive, 2u);
  EXPECT_EQ(m.counts.false_negative, 1u);
  EXPECT_EQ(m.counts.false_positive, 1u);
  EXPECT_EQ(m.counts.true_negative, 3u);
  EXPECT_EQ(m.kept(), 4u);
  EXPECT_EQ(m.removed(), 3u);
  EXPECT_DOUBLE_EQ(m.counts.precision(), 2 / 3.0);
  EXPECT_DOUBLE_EQ(m.counts.recall(), 2 / 3.0);
  EXPECT_DOUBLE_EQ(m.share_of_kept_on_people(), 0.25);
  EXPECT_DOUBLE_EQ(m.share_of_static_kept(), 0.75);
  m += m;
  EXPECT_EQ(m.kept(), 8u);
}

TEST(KeypointMetrics, NoKeypointsAndBadInput) {
  const cv::Mat truth = cv::Mat::zeros(10, 20, CV_8UC1);
  const auto none = compare_keypoints(std::vector<cv::KeyPoint>(), {}, truth);
  EXPECT_EQ(none.counts.total(), 0u);
  EXPECT_TRUE(std::isnan(none.share_of_kept_on_people()));
  EXPECT_THROW(compare_keypoints(std::vector<cv::KeyPoint>(1), {}, truth), stillpoint::Error);
  EXPECT_THROW(compare_keypoints(std::vector<cv::KeyPoint>(), {}, cv::Mat()), stillpoint::Error);
}

}  // namespace
