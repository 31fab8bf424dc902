// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/backends/rgbd_slam/features.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "test_scene.hpp"

namespace {

using namespace stillpoint;
using namespace stillpoint::rgbd_slam;
using namespace test_scene;

TEST(Descriptor, CountsDifferingBits) {
  Descriptor a{}, b{};
  EXPECT_EQ(hamming_distance(a, b), 0);
  b.fill(255);
  EXPECT_EQ(hamming_distance(a, b), 256);
  a = {1, 2, 4, 8}, b = {0, 2, 5, 0};
  EXPECT_EQ(hamming_distance(a, b), 3);
}

TEST(Descriptor, RefusesRowsOfAnotherLength) {
  EXPECT_THROW(descriptors_from_rows(cv::Mat::zeros(3, 16, CV_8UC1)), Error);
  EXPECT_TRUE(descriptors_from_rows(cv::Mat()).empty());
}

TEST(Spread, KeepsTheStrongestOfEvenCells) {
  std::vector<cv::KeyPoint> keypoints;
  // A dense clump on the left, single points on the right.
  for (int i = 0; i < 400; ++i)
    keypoints.emplace_back(static_cast<float>(i % 20), static_cast<float>(i / 20), 1.0f, -1.0f,
                           static_cast<float>(100 + i));
  for (int i = 0; i < 8; ++i)
    keypoints.emplace_back(200.0f + 50 * static_cast<float>(i % 4),
                           static_cast<float>(50 + 100 * (i / 4)), 1.0f, -1.0f, 1.0f);
  spread(keypoints, 20, cv::Size(400, 200));
  ASSERT_EQ(keypoints.size(), 20u);
  int right = 0;
  for (const cv::KeyPoint& k : keypoints) right += k.pt.x >= 200;
  EXPECT_EQ(right, 8);
  spread(keypoints, 0, cv::Size(400, 200));
  EXPECT_TRUE(keypoints.empty());
}

TEST(OrbExtractor, SpendsTheWholeBudgetOutsideTheMask) {
  const RgbdFrame frame = render(Eigen::Isometry3d::Identity(), 0);
  OrbExtractor::Settings settings;
  settings.features = 400;
  OrbExtractor extractor(settings);
  Features all, masked, again;
  extractor.extract(frame.color, cv::Mat(), all);
  EXPECT_NEAR(static_cast<double>(all.keypoints.size()), 400, 8);
  EXPECT_EQ(all.keypoints.size(), all.descriptors.size());
  cv::Mat mask = cv::Mat::zeros(frame.color.size(), CV_8UC1);
  mask.colRange(0, 160) = 255;
  extractor.extract(frame.color, mask, masked);
  int octaves = 0;
  for (const cv::KeyPoint& k : masked.keypoints) {
    EXPECT_GT(k.pt.x, 160 + settings.mask_margin_px - 1);
    octaves = std::max(octaves, k.octave);
  }
  EXPECT_GE(octaves, 4);
  extractor.extract(frame.color, mask, again);
  EXPECT_EQ(again.descriptors, masked.descriptors);
  extractor.extract(frame.color, cv::Mat(frame.color.size(), CV_8UC1, cv::Scalar(255)), again);
  EXPECT_TRUE(again.keypoints.empty());
}

TEST(OrbExtractor, FindsMoreWhereAMaskLeavesLess) {
  const RgbdFrame frame = render(Eigen::Isometry3d::Identity(), 0);
  OrbExtractor::Settings settings;
  settings.features = 100;
  Features found;
  const auto count_with = [&](int hidden_columns) {
    cv::Mat mask = cv::Mat::zeros(frame.color.size(), CV_8UC1);
    mask.colRange(0, hidden_columns) = 255;
    OrbExtractor(settings).extract(frame.color, mask, found);
    return static_cast<double>(found.keypoints.size());
  };
  const int width = frame.color.cols;
  EXPECT_NEAR(count_with(0), 100, 8);
  EXPECT_NEAR(count_with(width / 5), 100 / (0.8 * 0.8), 12);
  EXPECT_NEAR(count_with(width / 2), 300, 24) << "more than most_masked times as many";
  settings.most_masked = 1;
  EXPECT_NEAR(count_with(width / 2), 100, 8);
  settings.most_masked = 0.5;
  EXPECT_THROW(OrbExtractor{settings}, Error);
}

TEST(OrbExtractor, SurvivesTinyAndRefusesWrongImages) {
  OrbExtractor extractor;
  Features features;
  extractor.extract(cv::Mat::zeros(20, 20, CV_8UC1), cv::Mat(), features);
  EXPECT_TRUE(features.keypoints.empty());
  EXPECT_THROW(extractor.extract(cv::Mat::zeros(48, 64, CV_8UC3), cv::Mat(), features), Error);
  EXPECT_THROW(
      extractor.extract(cv::Mat::zeros(48, 64, CV_8UC1), cv::Mat::zeros(4, 4, CV_8UC1), features),
      Error);
  OrbExtractor::Settings bad;
  bad.scale_factor = 1;
  EXPECT_THROW(OrbExtractor{bad}, Error);
}

}  // namespace
