// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/core/depth_view.hpp"

#include <gtest/gtest.h>

#include <limits>

namespace {

using stillpoint::Camera;
using stillpoint::DepthView;
using stillpoint::RgbdFrame;

RgbdFrame frame_of(const cv::Mat& depth) {
  RgbdFrame frame;
  frame.color = cv::Mat::zeros(depth.size(), CV_8UC1);
  frame.depth = depth;
  return frame;
}

TEST(DepthView, RefersTo16Bits) {
  cv::Mat depth = cv::Mat::zeros(4, 6, CV_16UC1);
  depth.at<std::uint16_t>(2, 3) = 12500;
  DepthView view;
  EXPECT_TRUE(view.empty());
  view.set(frame_of(depth), Camera());
  EXPECT_EQ(view.row(2), depth.ptr<std::uint16_t>(2)) << "not a copy";
  EXPECT_EQ(view.size(), cv::Size(6, 4));
  EXPECT_FLOAT_EQ(view.to_m(view.row(2)[3]), 2.5f);
  view.clear();
  EXPECT_TRUE(view.empty());
}

TEST(DepthView, TurnsMetresIntoMillimetres) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float infinity = std::numeric_limits<float>::infinity();
  const cv::Mat depth =
      (cv::Mat_<float>(2, 4) << 1.5f, nan, infinity, -infinity, -2.0f, 0.0f, 64.999f, 65.0f);
  DepthView view;
  view.set(frame_of(depth), Camera());
  const std::vector<int> expected{1500, 0, 0, 0, 0, 0, 64999, 0};
  for (int i = 0; i < 8; ++i)
    EXPECT_EQ(view.row(i / 4)[i % 4], expected[static_cast<std::size_t>(i)]);
  EXPECT_FLOAT_EQ(view.to_m(1500), 1.5f);
}

TEST(DepthView, SaysWhichUnitsLieInARange) {
  DepthView view;
  view.set(frame_of(cv::Mat::zeros(4, 6, CV_16UC1)), Camera());
  EXPECT_EQ(view.first_units(2.5f), 12500);
  EXPECT_EQ(view.last_units(2.5f), 12500);
  EXPECT_EQ(view.first_units(2.5001f), 12501);
  EXPECT_EQ(view.last_units(2.5001f), 12500);
  for (const float outside : {-1.0f, 0.0f, std::numeric_limits<float>::quiet_NaN()}) {
    EXPECT_EQ(view.first_units(outside), 0);
    EXPECT_EQ(view.last_units(outside), 0);
  }
  EXPECT_EQ(view.first_units(100), 65535);
  EXPECT_EQ(view.last_units(100), 65535);
  // At each whole millimetre.
  for (int mm = 1; mm < 13000; ++mm) {
    ASSERT_EQ(view.first_units(static_cast<float>(mm) * 0.001f), 5 * mm);
    ASSERT_EQ(view.last_units(static_cast<float>(mm) * 0.001f), 5 * mm);
  }
}

TEST(DepthView, ReadsPartsOfALargerPicture) {
  cv::Mat large = cv::Mat::zeros(10, 12, CV_32FC1);
  large.at<float>(4, 5) = 3;
  DepthView view;
  view.set(frame_of(large(cv::Rect(3, 2, 6, 5))), Camera());
  EXPECT_EQ(view.row(2)[2], 3000);
}

TEST(DepthView, KnowsTheRays) {
  Camera camera;
  camera.fx = 500, camera.fy = 400, camera.cx = 3, camera.cy = 2;
  DepthView view;
  view.set(frame_of(cv::Mat::zeros(4, 6, CV_16UC1)), camera);
  EXPECT_FLOAT_EQ(view.ray({8, 6}).x(), 0.01f);
  EXPECT_FLOAT_EQ(view.ray({8, 6}).y(), 0.01f);
  EXPECT_EQ(view.focal_px(), 500);
  view.set(frame_of(cv::Mat::zeros(4, 6, CV_16UC1)), Camera());
  EXPECT_FLOAT_EQ(view.focal_px(), 5.4f) << "0.9 widths without a camera";
  EXPECT_FLOAT_EQ(view.lens().ray(2.5f, 0).x(), 0);
}

}  // namespace
