// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/io/depth_check.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "stillpoint/io/tum_sequence.hpp"

namespace {

using stillpoint::check_depth_scale;
using stillpoint::RgbdFrame;

RgbdFrame frame_of(int type, double value, double units_per_m) {
  RgbdFrame frame;
  frame.color = cv::Mat::zeros(9, 12, CV_8UC3);
  frame.depth = cv::Mat(9, 12, type, cv::Scalar(value));
  frame.depth(cv::Rect(0, 0, 12, 4)) = 0;  // no measurement
  frame.depth_units_per_m = units_per_m;
  return frame;
}

TEST(DepthCheck, SaysNothingWhenDepthMakesSense) {
  EXPECT_FALSE(check_depth_scale(frame_of(CV_16UC1, 10000, 5000)));
  EXPECT_FALSE(check_depth_scale(frame_of(CV_16UC1, 2000, 1000)));
  EXPECT_FALSE(check_depth_scale(frame_of(CV_32FC1, 2.5, 5000)));
}

TEST(DepthCheck, CallsOutAWrongFactorAndNamesABetterOne) {
  const auto near = check_depth_scale(frame_of(CV_16UC1, 400, 5000));  // 0.08 m
  ASSERT_TRUE(near);
  EXPECT_NE(near->find("nearer than 0.08 m"), std::string::npos) << *near;
  EXPECT_NE(near->find("5000 is likely wrong"), std::string::npos) << *near;
  const auto far = check_depth_scale(frame_of(CV_16UC1, 10000, 1));
  ASSERT_TRUE(far);
  EXPECT_NE(far->find("nearer than 10000 m"), std::string::npos) << *far;
  EXPECT_NE(far->find("5000 would give 2 m"), std::string::npos) << *far;
  const auto millimetres = check_depth_scale(frame_of(CV_16UC1, 1500, 20000));
  ASSERT_TRUE(millimetres);
  EXPECT_NE(millimetres->find("1000 would give 1.5 m"), std::string::npos) << *millimetres;
  const auto floats = check_depth_scale(frame_of(CV_32FC1, 1500, 5000));
  ASSERT_TRUE(floats);
  EXPECT_NE(floats->find("millimetres"), std::string::npos) << *floats;
}

TEST(DepthCheck, JudgesByMeasurementsOnly) {
  EXPECT_FALSE(check_depth_scale(frame_of(CV_16UC1, 0, 5000))) << "all black";
  EXPECT_FALSE(check_depth_scale(frame_of(CV_32FC1, std::numeric_limits<double>::quiet_NaN(), 1)));
  EXPECT_FALSE(check_depth_scale(RgbdFrame()));
  RgbdFrame mostly_far = frame_of(CV_32FC1, 2, 1);
  mostly_far.depth(cv::Rect(0, 4, 12, 2)) = 1000;  // 24 of 60 pixels
  EXPECT_FALSE(check_depth_scale(mostly_far));
}

// Stored in units of 1 / `units` m: a wall at 1.2 to 3.6 m.
RgbdFrame slanted_wall(double units, double given, double timestamp) {
  RgbdFrame frame;
  frame.timestamp = timestamp;
  frame.color = cv::Mat::zeros(120, 160, CV_8UC3);
  frame.depth.create(120, 160, CV_16UC1);
  for (int y = 0; y < 120; ++y)
    for (int x = 0; x < 160; ++x)
      frame.depth.at<std::uint16_t>(y, x) = cv::saturate_cast<std::uint16_t>(
          std::round(1000 * (1.2 + x * 0.015 + y * 0.0001)) * units / 1000);
  frame.depth_units_per_m = given;
  return frame;
}

TEST(DepthScaleCheck, TellsTheFactorsInUseApart) {
  for (const double units : {5000.0, 1000.0})
    for (const double given : {5000.0, 1000.0, 1.0}) {
      stillpoint::DepthScaleCheck check;
      for (int i = 0; i < 40; ++i) check.add(slanted_wall(units, given, 5 + i / 30.0));
      EXPECT_TRUE(check.is_over(6.1));
      const auto problem = check.problem();
      EXPECT_EQ(problem.has_value(), units != given) << units << " " << given;
      if (!problem) continue;
      EXPECT_NE(problem->find(units == 5000 ? "; 5000 would give" : "; 1000 would give"),
                std::string::npos)
          << *problem;
    }
}

TEST(DepthScaleCheck, BelievesWholeMillimetresTimesFive) {
  // A table top before an arm, 0.3 to 0.5 m: too near for 5000, were it not for the values.
  RgbdFrame frame;
  frame.color = cv::Mat::zeros(120, 160, CV_8UC3);
  frame.depth.create(120, 160, CV_16UC1);
  for (int y = 0; y < 120; ++y)
    for (int x = 0; x < 160; ++x)
      frame.depth.at<std::uint16_t>(y, x) = static_cast<std::uint16_t>(5 * (300 + x + y / 3));
  frame.depth_units_per_m = 5000;
  EXPECT_FALSE(check_depth_scale(frame));
  frame.depth += 1;
  EXPECT_TRUE(check_depth_scale(frame));
}

TEST(DepthScaleCheck, LooksAtPeople) {
  // A wall at 6 m by the given factor, at 1.2 m by another: who stands before it decides.
  stillpoint::Camera camera;
  camera.fx = camera.fy = 100, camera.cx = 80, camera.cy = 60;
  RgbdFrame frame = frame_of(CV_16UC1, 900, 1000);
  frame.color = cv::Mat::zeros(120, 160, CV_8UC3);
  frame.depth = cv::Mat(120, 160, CV_16UC1, cv::Scalar(6000));
  stillpoint::Instance person;
  person.class_name = "person", person.box = cv::Rect(60, 10, 40, 100);
  stillpoint::DepthScaleCheck alone(camera), with_person(camera);
  alone.add(frame);
  with_person.add(frame, {person});
  ASSERT_FALSE(alone.problem());
  ASSERT_TRUE(with_person.problem());
  EXPECT_NE(with_person.problem()->find("people are 6 m tall"), std::string::npos);
  EXPECT_NE(with_person.problem()->find("5000 would give 1.2 m"), std::string::npos);
}

// A room as Kinect v1 sees it: floor 1.3 m below, walls at 5 m, disparity in eighths of a pixel.
RgbdFrame kinect_room(const stillpoint::Camera& camera, double given) {
  RgbdFrame frame;
  frame.color = cv::Mat::zeros(camera.height, camera.width, CV_8UC3);
  frame.depth.create(frame.color.size(), CV_16UC1);
  frame.depth_units_per_m = given;
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      const double down = (y - camera.cy) / camera.fy, aside = (x - camera.cx) / camera.fx;
      double z = 5 / (1 + 0.5 * std::abs(aside));
      if (down > 0) z = std::min(z, 1.3 / down);
      const double eighths = std::round(8 * 580 * 0.075 / z);
      frame.depth.at<std::uint16_t>(y, x) =
          cv::saturate_cast<std::uint16_t>(5000 * 8 * 580 * 0.075 / eighths);
    }
  return frame;
}

TEST(DepthScaleCheck, NoticesAFactorOfTwoByKinectsSteps) {
  stillpoint::Camera camera;
  camera.width = 640, camera.height = 480;
  camera.fx = camera.fy = 525, camera.cx = 319.5, camera.cy = 239.5;
  for (const double given : {5000.0, 10000.0}) {
    stillpoint::DepthScaleCheck check(camera);
    check.add(kinect_room(camera, given));
    const auto problem = check.problem();
    ASSERT_EQ(problem.has_value(), given != 5000) << problem.value_or("");
    if (!problem) continue;
    EXPECT_NE(problem->find("; 5000 would give"), std::string::npos) << *problem;
    EXPECT_NE(problem->find(" m above the floor"), std::string::npos) << *problem;
  }
  // The angle of a RealSense D435, whose steps are half of Kinect's.
  camera.fx = camera.fy = 610;
  stillpoint::DepthScaleCheck check(camera);
  check.add(kinect_room(camera, 10000));
  EXPECT_FALSE(check.problem()) << *check.problem();
}

TEST(DepthScaleCheck, LooksAtTheFloor) {
  // Walls at 6.5 and 11 m, of a hall or, with 5000, of a room: that the floor is 4.5 m below
  // decides.
  stillpoint::Camera camera;
  camera.width = 320, camera.height = 240;
  camera.fx = camera.fy = 80, camera.cx = 160, camera.cy = 120;
  RgbdFrame frame;
  frame.color = cv::Mat::zeros(240, 320, CV_8UC3);
  frame.depth.create(240, 320, CV_16UC1);
  frame.depth_units_per_m = 1000;
  for (int y = 0; y < 240; ++y)
    frame.depth.row(y) = y < 80    ? 11000
                         : y < 176 ? 6500
                                   : std::min(6500.0, 4500 * camera.fy / (y - camera.cy));
  stillpoint::DepthScaleCheck without, with(camera);
  without.add(frame);
  with.add(frame);
  EXPECT_FALSE(without.problem()) << *without.problem();
  const auto problem = with.problem();
  ASSERT_TRUE(problem);
  EXPECT_NE(problem->find(" m above the floor"), std::string::npos) << *problem;
}

TEST(DepthScaleCheck, BelievesAMetricPathMoreThanTheScene) {
  RgbdFrame near = frame_of(CV_16UC1, 400, 5000);  // 0.08 m
  for (const double ratio : {1.0, 2.02, 0.5, 0.1}) {
    stillpoint::DepthScaleCheck check;
    check.add(ratio == 1 ? near : frame_of(CV_16UC1, 10000, 5000));
    for (int i = 0; i < 10; ++i) check.add_motion(ratio * 0.03 * i, 0.03 * i);
    const auto problem = check.problem();
    ASSERT_EQ(problem.has_value(), ratio != 1) << problem.value_or("");
    if (!problem) continue;
    const std::string fits = ratio > 1     ? "; about 10100 would fit"
                             : ratio > 0.2 ? "; about 2500 would fit"
                                           : "; 1000 would give";
    EXPECT_NE(problem->find(fits), std::string::npos) << *problem;
  }
  // Motions that disagree, or are too few, say nothing.
  stillpoint::DepthScaleCheck disagree, few;
  for (auto* check : {&disagree, &few}) check->add(frame_of(CV_16UC1, 10000, 5000));
  for (int i = 1; i < 20; ++i) disagree.add_motion(0.1 * i, 0.2);
  for (int i = 0; i < 4; ++i) few.add_motion(0.4, 0.2);
  EXPECT_FALSE(disagree.problem());
  EXPECT_FALSE(few.problem());
}

TEST(DepthScaleCheck, OfRealAndRenderedSequences) {
  int found = 0;
  for (const char* name : {"real/fr1_desk", "real/fr1_rpy_fast", "real/confusao",
                           "rendered/walking_xyz", "rendered/crowd_rpy"}) {
    const std::filesystem::path folder = std::string(STILLPOINT_SHARED_DATA "/") + name;
    if (!std::filesystem::exists(folder)) continue;
    ++found;
    const stillpoint::TumSequence sequence(folder);
    const double right = sequence.camera() ? sequence.camera()->depth_units_per_m : 5000;
    for (std::size_t begin = 0; begin < sequence.size(); begin += 30) {
      std::vector<RgbdFrame> second;
      for (std::size_t i = begin; i < std::min(begin + 30, sequence.size()); i += 6)
        second.push_back(sequence.load(i));
      for (const double given : {5000.0, 10000.0, 1000.0, 1.0}) {
        if (given == 10000 && (!sequence.camera() || right == 1000)) continue;
        stillpoint::DepthScaleCheck check(sequence.camera().value_or(stillpoint::Camera()));
        for (RgbdFrame& frame : second) {
          frame.depth_units_per_m = given;
          check.add(frame);
        }
        const auto problem = check.problem();
        EXPECT_EQ(problem.has_value(), given != right)
            << name << " from frame " << begin << " with " << given << ": " << problem.value_or("");
        const std::string would = right == 5000 ? "; 5000 would give" : "; 1000 would give";
        if (problem) {
          EXPECT_NE(problem->find(would), std::string::npos) << *problem;
        }
      }
    }
  }
  if (found == 0) GTEST_SKIP() << "no sequences in " << STILLPOINT_SHARED_DATA;
}

}  // namespace
