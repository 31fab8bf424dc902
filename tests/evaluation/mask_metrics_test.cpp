// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/evaluation/mask_metrics.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace {

using stillpoint::compare_masks;

cv::Mat mask_of(const cv::Rect& box, int value = 255) {
  cv::Mat m = cv::Mat::zeros(10, 10, CV_8UC1);
  m(box) = value;
  return m;
}

TEST(MaskMetrics, CountsPixels) {
  const auto c = compare_masks(mask_of({0, 0, 4, 4}), mask_of({2, 0, 4, 4}, 1));
  EXPECT_EQ(c.true_positive, 8u);
  EXPECT_EQ(c.false_positive, 8u);
  EXPECT_EQ(c.false_negative, 8u);
  EXPECT_EQ(c.true_negative, 76u);
  EXPECT_DOUBLE_EQ(c.iou(), 8 / 24.0);
  EXPECT_DOUBLE_EQ(c.precision(), 0.5);
  EXPECT_DOUBLE_EQ(c.recall(), 0.5);
  EXPECT_DOUBLE_EQ(c.f1(), 0.5);
}

TEST(MaskMetrics, TellsPrecisionFromRecall) {
  const auto c = compare_masks(mask_of({0, 0, 2, 4}), mask_of({0, 0, 8, 4}));
  EXPECT_DOUBLE_EQ(c.precision(), 1);
  EXPECT_DOUBLE_EQ(c.recall(), 0.25);
  EXPECT_DOUBLE_EQ(c.f1(), 0.4);
}

TEST(MaskMetrics, CountsValidPixelsOnly) {
  stillpoint::RgbdFrame frame;
  frame.depth = cv::Mat::zeros(10, 10, CV_16UC1);
  frame.depth(cv::Rect(0, 0, 10, 2)) = 5000;
  const auto c = compare_masks(mask_of({0, 0, 4, 4}), mask_of({2, 0, 4, 4}),
                               stillpoint::measured_pixels(frame));
  EXPECT_EQ(c.total(), 20u);
  EXPECT_EQ(c.true_positive, 4u);
}

TEST(MaskMetrics, NothingToDivideByIsNaN) {
  const auto nobody = compare_masks(mask_of({}), mask_of({}));
  EXPECT_TRUE(std::isnan(nobody.iou()));
  EXPECT_TRUE(std::isnan(nobody.recall()));
  EXPECT_TRUE(std::isnan(nobody.precision()));
  EXPECT_DOUBLE_EQ(compare_masks(mask_of({0, 0, 1, 1}), mask_of({})).iou(), 0);
}

TEST(MaskMetrics, SumsUpASequenceInTwoWays) {
  stillpoint::MaskMetrics m;
  EXPECT_TRUE(std::isnan(m.mean_iou()));
  m.add(compare_masks(mask_of({0, 0, 8, 8}), mask_of({0, 0, 8, 8})));
  m.add(compare_masks(mask_of({}), mask_of({0, 0, 1, 1})));
  m.add(compare_masks(mask_of({}), mask_of({})));  // nobody there, nobody found: says nothing
  EXPECT_EQ(m.frames(), 3u);
  EXPECT_DOUBLE_EQ(m.pixels().iou(), 64 / 65.0);
  EXPECT_DOUBLE_EQ(m.mean_iou(), 0.5);
  EXPECT_DOUBLE_EQ(m.mean_recall(), 0.5);
  EXPECT_DOUBLE_EQ(m.mean_precision(), 1);
}

TEST(MaskMetrics, RefusesOtherTypesAndSizes) {
  const cv::Mat truth = mask_of({});
  EXPECT_THROW(compare_masks(cv::Mat::zeros(10, 10, CV_8UC3), truth), stillpoint::Error);
  EXPECT_THROW(compare_masks(cv::Mat::zeros(10, 9, CV_8UC1), truth), stillpoint::Error);
  EXPECT_THROW(compare_masks(truth, truth, cv::Mat::zeros(9, 10, CV_8UC1)), stillpoint::Error);
}

}  // namespace
