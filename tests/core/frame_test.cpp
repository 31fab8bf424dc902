// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/core/frame.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "../io/temporary_folder.hpp"

namespace {

using stillpoint::check_frame;
using stillpoint::depth_m_at;
using stillpoint::RgbdFrame;

const double kNan = std::numeric_limits<double>::quiet_NaN();

RgbdFrame good_frame() {
  RgbdFrame frame;
  frame.color = cv::Mat::zeros(4, 5, CV_8UC3);
  frame.depth = cv::Mat::zeros(4, 5, CV_16UC1);
  frame.timestamp = 1.3e9;
  return frame;
}

TEST(Frame, ReadsDepthInItsUnits) {
  RgbdFrame frame = good_frame();
  frame.depth.at<std::uint16_t>(1, 2) = 10000;
  EXPECT_FLOAT_EQ(depth_m_at(frame, 2, 1), 2);
  EXPECT_EQ(depth_m_at(frame, 1, 2), 0);
  frame.depth_units_per_m = 1000;
  EXPECT_FLOAT_EQ(depth_m_at(frame, 2, 1), 10);
  EXPECT_FLOAT_EQ(stillpoint::metres_per_unit(frame), 0.001f);
}

TEST(Frame, ReadsMetresAndNoMeasurement) {
  RgbdFrame frame = good_frame();
  frame.depth = cv::Mat::zeros(4, 5, CV_32FC1);
  const float infinity = std::numeric_limits<float>::infinity();
  const float values[] = {1.25f, 0.0f, -1.0f, static_cast<float>(kNan), infinity};
  for (int x = 0; x < 5; ++x) frame.depth.at<float>(0, x) = values[x];
  EXPECT_EQ(depth_m_at(frame, 0, 0), 1.25f);
  for (int x = 1; x < 5; ++x) EXPECT_EQ(depth_m_at(frame, x, 0), 0) << values[x];
  EXPECT_EQ(stillpoint::metres_per_unit(frame), 1);
  frame.depth = cv::Mat();
  EXPECT_EQ(depth_m_at(frame, 0, 0), 0);
}

TEST(Frame, TakesWhatIsWrittenThere) {
  RgbdFrame frame = good_frame();
  EXPECT_NO_THROW(check_frame(frame));
  frame.color = cv::Mat::zeros(4, 5, CV_8UC1);
  frame.depth = cv::Mat::zeros(4, 5, CV_32FC1);
  frame.timestamp = -3;
  EXPECT_NO_THROW(check_frame(frame));
  frame.depth = cv::Mat();
  EXPECT_NO_THROW(check_frame(frame));
}

TEST(Frame, RefusesOtherColor) {
  RgbdFrame frame = good_frame();
  frame.color = cv::Mat();
  EXPECT_ERROR(check_frame(frame), "frame.color", "empty");
  frame.color = cv::Mat::zeros(4, 5, CV_8UC4);
  EXPECT_ERROR(check_frame(frame), "frame.color", "CV_8UC3", "found CV_8UC4");
  frame.color = cv::Mat::zeros(4, 5, CV_16UC3);
  EXPECT_ERROR(check_frame(frame), "frame.color", "found CV_16UC3");
}

TEST(Frame, RefusesOtherGray) {
  RgbdFrame frame = good_frame();
  frame.gray = cv::Mat::zeros(4, 5, CV_8UC1);
  EXPECT_NO_THROW(check_frame(frame));
  frame.gray = cv::Mat::zeros(4, 6, CV_8UC1);
  EXPECT_ERROR(check_frame(frame), "frame.gray", "5x4", "6x4");
  frame.gray = cv::Mat::zeros(4, 5, CV_8UC3);
  EXPECT_ERROR(check_frame(frame), "frame.gray", "CV_8UC1", "CV_8UC3");
}

TEST(Frame, RefusesOtherDepth) {
  RgbdFrame frame = good_frame();
  frame.depth = cv::Mat::zeros(5, 4, CV_16UC1);
  EXPECT_ERROR(check_frame(frame), "frame.depth", "5x4", "found 4x5");
  frame.depth = cv::Mat::zeros(4, 5, CV_8UC1);
  EXPECT_ERROR(check_frame(frame), "frame.depth", "CV_16UC1 or CV_32FC1", "found CV_8UC1");
  frame.depth = cv::Mat::zeros(4, 5, CV_64FC1);
  EXPECT_ERROR(check_frame(frame), "frame.depth", "found CV_64FC1");
  frame.depth = cv::Mat::zeros(4, 5, CV_16UC3);
  EXPECT_ERROR(check_frame(frame), "frame.depth", "found CV_16UC3");
}

TEST(Frame, RefusesNoNumber) {
  RgbdFrame frame = good_frame();
  for (const double bad : {kNan, 1 / 0.0, -1 / 0.0}) {
    frame.timestamp = bad;
    EXPECT_ERROR(check_frame(frame), "frame.timestamp", "seconds");
  }
  frame.timestamp = 1.7e18;
  EXPECT_ERROR(check_frame(frame), "frame.timestamp", "seconds", "nanoseconds by 1e9");
  frame = good_frame();
  for (const double bad : {0.0, -5000.0, 0.0002, 1 / 0.0, kNan}) {
    frame.depth_units_per_m = bad;
    EXPECT_ERROR(check_frame(frame), "depth_units_per_m", "units per metre, 1 or more");
  }
  frame.depth = cv::Mat::zeros(4, 5, CV_32FC1);
  EXPECT_NO_THROW(check_frame(frame)) << "metres have no units";
}

TEST(Frame, RefusesDepthOfAnotherTime) {
  RgbdFrame frame = good_frame();
  frame.timestamp = 1700000000;
  for (const double good : {kNan, 1700000000 - 0.4, 1700000000 + 0.4}) {
    frame.depth_timestamp = good;
    EXPECT_NO_THROW(check_frame(frame)) << good;
  }
  for (const double bad :
       {12.5, 1700000001.0, 1 / 0.0, -1 / 0.0}) {  // 12.5: since the camera's start
    frame.depth_timestamp = bad;
    EXPECT_ERROR(check_frame(frame), "frame.depth_timestamp", "clock of frame.timestamp", "NaN");
  }
}

}  // namespace
