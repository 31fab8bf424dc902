// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/core/mask_functions.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "../io/temporary_folder.hpp"

namespace stillpoint {
namespace {

constexpr float kNotANumber = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

bool same_bytes(const cv::Mat& a, const cv::Mat& b) {
  if (a.type() != b.type() || a.size() != b.size()) return false;
  for (int y = 0; y < a.rows; ++y)
    if (std::memcmp(a.ptr(y), b.ptr(y), a.elemSize() * static_cast<std::size_t>(a.cols)) != 0)
      return false;
  return true;
}

cv::Mat mask_with(const cv::Rect& dynamic, cv::Size size = {40, 30}) {
  cv::Mat mask = cv::Mat::zeros(size, CV_8UC1);
  mask(dynamic).setTo(255);
  return mask;
}

cv::Mat float_depth() {
  cv::Mat depth(30, 40, CV_32FC1);
  for (int y = 0; y < depth.rows; ++y)
    for (int x = 0; x < depth.cols; ++x) depth.at<float>(y, x) = 1 + 0.01f * static_cast<float>(x);
  depth.at<float>(3, 4) = kNotANumber, depth.at<float>(12, 12) = kNotANumber;
  depth.at<float>(5, 6) = kInfinity, depth.at<float>(7, 8) = 0;
  return depth;
}

TEST(MaskFunctions, AnAllStaticFrameIsNeutralByteForByte) {
  const cv::Mat nothing = cv::Mat::zeros(30, 40, CV_8UC1);
  const cv::Mat depth = float_depth();
  EXPECT_TRUE(same_bytes(masked_depth(depth, nothing), depth)) << "NaN and infinity, too";
  cv::Mat units(30, 40, CV_16UC1);
  cv::randu(units, 0, 65535);
  EXPECT_TRUE(same_bytes(masked_depth(units, nothing), units));
  EXPECT_EQ(cv::countNonZero(static_image(nothing) != 255), 0);
  EXPECT_EQ(cv::countNonZero(feature_mask(nothing, 16) != 255), 0);
  EXPECT_EQ(cv::countNonZero(dynamic_probability(nothing)), 0) << "not even -0 or 1e-9";
  EXPECT_EQ(dynamic_probability_at(std::vector<cv::Point2f>{{5, 5}}, nothing)[0], 0);
}

TEST(MaskFunctions, MaskedDepthZeroesAndNeverInvents) {
  const cv::Rect person(10, 10, 8, 6);
  const cv::Mat mask = mask_with(person), depth = float_depth();
  const cv::Mat before = depth.clone(), masked = masked_depth(depth, mask);
  EXPECT_TRUE(same_bytes(depth, before)) << "the caller's stays";
  for (int y = 0; y < depth.rows; ++y)
    for (int x = 0; x < depth.cols; ++x) {
      const float z = masked.at<float>(y, x), was = depth.at<float>(y, x);
      if (mask.at<uchar>(y, x))
        EXPECT_EQ(z, 0) << "NaN on the person is no measurement either";
      else
        EXPECT_TRUE(z == was || (std::isnan(z) && std::isnan(was)));
    }
  cv::Mat units(30, 40, CV_16UC1, cv::Scalar(5000));
  const cv::Mat masked_units = masked_depth(units, mask);
  EXPECT_EQ(cv::countNonZero(masked_units), 30 * 40 - person.area());
  EXPECT_EQ(cv::countNonZero(masked_units(person)), 0);
  // A view of a larger image.
  const cv::Mat large(60, 80, CV_16UC1, cv::Scalar(7));
  EXPECT_EQ(cv::countNonZero(masked_depth(large(cv::Rect(20, 20, 40, 30)), mask)),
            30 * 40 - person.area());
}

TEST(MaskFunctions, FeatureMaskKeepsAMargin) {
  const cv::Mat mask = mask_with({10, 10, 8, 6});
  EXPECT_TRUE(same_bytes(feature_mask(mask, 0), static_image(mask)));
  const cv::Mat allowed = feature_mask(mask, 3);
  EXPECT_EQ(cv::countNonZero(allowed == 0), 14 * 12);
  EXPECT_EQ(allowed.at<uchar>(7, 7), 0);
  EXPECT_EQ(allowed.at<uchar>(6, 7), 255);
  EXPECT_EQ(cv::countNonZero(feature_mask(mask, 100)), 0);
  // A part of a larger mask does not see beyond its own border.
  EXPECT_EQ(cv::countNonZero(feature_mask(mask(cv::Rect(20, 0, 12, 16)), 5) == 0), 0);
}

TEST(MaskFunctions, ProbabilityFallsOffAroundTheMask) {
  const cv::Mat mask = mask_with({10, 10, 8, 6});
  const cv::Mat p = dynamic_probability(mask, 4);
  ASSERT_EQ(p.type(), CV_32FC1);
  EXPECT_EQ(p.at<float>(12, 12), 1);
  EXPECT_NEAR(p.at<float>(12, 18), 0.75, 1e-6);  // a pixel beside the mask
  EXPECT_NEAR(p.at<float>(12, 20), 0.25, 1e-6);
  EXPECT_EQ(p.at<float>(12, 21), 0);
  EXPECT_EQ(cv::countNonZero(dynamic_probability(mask, 0)), 8 * 6) << "no rim: the mask";
  const std::vector<cv::Point2f> points{{12, 12},         {18.4f, 12}, {30, 12},
                                        {kNotANumber, 2}, {-1, 2},     {39.6f, 2}};
  const std::vector<float> at = dynamic_probability_at(points, mask, 4);
  EXPECT_EQ(at[0], 1);
  EXPECT_NEAR(at[1], 0.75, 1e-6);
  EXPECT_EQ(at[2], 0);
  for (const std::size_t i : {3u, 4u, 5u}) EXPECT_EQ(at[i], 1) << i;
}

TEST(MaskFunctions, SayWhatIsWrong) {
  const cv::Mat mask = mask_with({10, 10, 8, 6}), depth = float_depth();
  EXPECT_ERROR(static_image(cv::Mat()), "static_image: mask", "found an empty one");
  EXPECT_ERROR(static_image(depth), "expected CV_8UC1", "found CV_32FC1");
  EXPECT_ERROR(feature_mask(mask, -1), "margin_px", "found -1");
  EXPECT_ERROR(feature_mask(depth, 1), "found CV_32FC1");
  EXPECT_ERROR(masked_depth(cv::Mat(30, 40, CV_64FC1), mask), "found CV_64FC1");
  EXPECT_ERROR(masked_depth(cv::Mat(), mask), "depth", "found an empty one");
  EXPECT_ERROR(masked_depth(depth, mask.rowRange(0, 20)), "mask's size 40x20, found 40x30");
  EXPECT_ERROR(dynamic_probability(mask, kNotANumber), "rim_px", "found nan");
  EXPECT_ERROR(dynamic_probability(mask, -1), "rim_px", "found -1");
}

}  // namespace
}  // namespace stillpoint
