// SPDX-License-Identifier: BSD-2-Clause
#include "synthetic/depth.hpp"

#include <gtest/gtest.h>

namespace stillpoint {
namespace {

Camera kinect() {
  Camera c;
  c.width = 640, c.height = 480, c.fx = c.fy = 525, c.cx = 319.5, c.cy = 239.5;
  return c;
}

struct Statistics {
  double mean_m = 0, deviation_m = 0, missing = 0;
};

Statistics measured(double z_m, const KinectNoise& noise, std::uint64_t seed) {
  const cv::Mat exact(240, 640, CV_32FC1, cv::Scalar(z_m));
  const cv::Mat depth = measure_depth(exact, cv::Mat(), kinect(), noise, seed);
  EXPECT_EQ(depth.type(), CV_16UC1);
  double sum = 0, square = 0;
  int count = 0, missing = 0;
  for (int y = 0; y < depth.rows; ++y)
    for (int x = 20; x < depth.cols; ++x) {
      const double z = depth.at<std::uint16_t>(y, x) / 5000.0;
      if (z == 0) {
        ++missing;
        continue;
      }
      sum += z, square += (z - z_m) * (z - z_m), ++count;
    }
  Statistics s;
  s.missing = missing / static_cast<double>(missing + count);
  if (count) s.mean_m = sum / count, s.deviation_m = std::sqrt(square / count);
  return s;
}

TEST(SyntheticDepth, NoiseGrowsWithTheSquareOfTheDistance) {
  for (const double z : {1.0, 2.0, 4.0, 6.0}) {
    const Statistics s = measured(z, KinectNoise(), 3);
    const double axial = 0.0012 + 0.0019 * (z - 0.4) * (z - 0.4);
    const double step = z * z / (525 * 0.075 * 8);  // of the disparity
    const double expected = std::sqrt(axial * axial + step * step / 12);
    EXPECT_NEAR(s.deviation_m / expected, 1, 0.3) << z;
    EXPECT_NEAR(s.mean_m, z, 0.4 * expected) << z;
    EXPECT_LT(s.missing, 0.03) << z;
    EXPECT_GT(s.missing, 0.0002) << z;
  }
}

TEST(SyntheticDepth, NothingIsMeasuredTooNearTooFarOrWhereNothingIs) {
  for (const double z : {0.0, 0.3, 0.49, 8.4, 20.0})
    EXPECT_EQ(measured(z, KinectNoise(), 1).missing, 1) << z;
  EXPECT_LT(measured(0.6, KinectNoise(), 1).missing, 0.1);
}

TEST(SyntheticDepth, ExactWhenAllNoiseIsOff) {
  KinectNoise none;
  none.axial0_m = none.axial2_per_m = none.disparity_steps_per_px = none.holes = 0;
  none.shadows = false;
  const Statistics s = measured(3.3333, none, 9);
  EXPECT_EQ(s.missing, 0);
  EXPECT_LT(s.deviation_m, 1.01e-4);
}

TEST(SyntheticDepth, ShadowLiesLeftOfANearObjectAndIsAsWideAsTheBaselineMakesIt) {
  cv::Mat exact(100, 640, CV_32FC1, cv::Scalar(3));
  exact.colRange(300, 400).setTo(1);
  KinectNoise noise;
  noise.holes = 0;
  const cv::Mat depth = measure_depth(exact, cv::Mat(), kinect(), noise, 5);
  const double width = 525 * 0.075 * (1 / 1.0 - 1 / 3.0);  // 26 pixels
  int left = 0, right = 0;
  for (int y = 0; y < depth.rows; ++y) {
    for (int x = 250; x < 300; ++x) left += depth.at<std::uint16_t>(y, x) == 0;
    for (int x = 402; x < 450; ++x) right += depth.at<std::uint16_t>(y, x) == 0;
  }
  EXPECT_NEAR(left / 100.0, width, 2);
  EXPECT_EQ(right, 0);
}

TEST(SyntheticDepth, DarkSurfacesHaveMoreHoles) {
  const cv::Mat exact(240, 640, CV_32FC1, cv::Scalar(2));
  cv::Mat dark(240, 640, CV_8UC1, cv::Scalar(0));
  dark.colRange(320, 640).setTo(255);
  const cv::Mat depth = measure_depth(exact, dark, kinect(), KinectNoise(), 6);
  const double share =
      cv::countNonZero(depth.colRange(320, 640) == 0) / static_cast<double>(240 * 320);
  EXPECT_NEAR(share, 0.28, 0.1);
}

TEST(SyntheticDepth, SameSeedSameValuesOtherSeedOthers) {
  const cv::Mat exact(60, 80, CV_32FC1, cv::Scalar(2.5));
  const cv::Mat a = measure_depth(exact, cv::Mat(), kinect(), KinectNoise(), 1);
  const cv::Mat b = measure_depth(exact, cv::Mat(), kinect(), KinectNoise(), 1);
  const cv::Mat c = measure_depth(exact, cv::Mat(), kinect(), KinectNoise(), 2);
  EXPECT_EQ(cv::countNonZero(a != b), 0);
  EXPECT_GT(cv::countNonZero(a != c), 1000);
}

}  // namespace
}  // namespace stillpoint
