// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/motion/motion_check.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "check_alone.hpp"
#include "small_camera.hpp"
#include "stillpoint/core/random.hpp"

namespace stillpoint {
namespace {

const Eigen::Vector2d kBoxM(0.5, 0.8);

/// A wall 4 m ahead with a pillar at 2 m (static), and a box at `box_m` in world coordinates.
RgbdFrame render(double timestamp, const Eigen::Isometry3d& T_world_camera,
                 const std::optional<Eigen::Vector3d>& box_m, const Eigen::Vector2d& size_m = kBoxM,
                 std::uint64_t seed = 0) {
  const Camera camera = small_camera();
  RgbdFrame frame;
  frame.timestamp = timestamp;
  frame.depth_units_per_m = 5000;
  frame.color = cv::Mat(kHeight, kWidth, CV_8UC1, cv::Scalar(90));
  frame.depth = cv::Mat::zeros(kHeight, kWidth, CV_16UC1);
  RandomGenerator random(seed + static_cast<std::uint64_t>(timestamp * 1000));
  const Eigen::Vector3d o = T_world_camera.translation();
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; ++x) {
      const Eigen::Vector3d d = T_world_camera.linear() * camera.unproject(x, y, 1);
      double z = (4 - o.z()) / d.z();
      const auto front = [&](double plane, double x0, double x1, double y0, double y1) {
        const double t = (plane - o.z()) / d.z();
        const Eigen::Vector3d p = o + t * d;
        if (t > 0 && t < z && p.x() > x0 && p.x() < x1 && p.y() > y0 && p.y() < y1) z = t;
      };
      front(2.0, -0.9, -0.5, -2, 2);
      if (box_m)
        front(box_m->z(), box_m->x() - size_m.x() / 2, box_m->x() + size_m.x() / 2,
              box_m->y() - size_m.y() / 2, box_m->y() + size_m.y() / 2);
      const double noise = 0.002 * z * z * (random.uniform() - 0.5);
      frame.depth.at<std::uint16_t>(y, x) =
          static_cast<std::uint16_t>(std::lround((z + noise) * 5000));
    }
  return frame;
}

double share_of_box(const std::vector<Instance>& found, const Eigen::Vector3d& box_m,
                    const Eigen::Isometry3d& T_world_camera, const Eigen::Vector2d& size_m,
                    double* outside = nullptr) {
  const Camera camera = small_camera();
  cv::Mat mask = cv::Mat::zeros(kHeight, kWidth, CV_8UC1);
  for (const Instance& s : found) mask(s.box).setTo(255, s.mask);
  int in = 0, hit = 0, out = 0;
  const Eigen::Isometry3d T = T_world_camera.inverse();
  const Eigen::Vector3d half(size_m.x() / 2, size_m.y() / 2, 0);
  const Eigen::Vector2d a = camera.project(T * (box_m - half));
  const Eigen::Vector2d b = camera.project(T * (box_m + half));
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; ++x) {
      const bool inside = x > a.x() && x < b.x() && y > a.y() && y < b.y();
      in += inside, hit += inside && mask.at<uchar>(y, x), out += !inside && mask.at<uchar>(y, x);
    }
  if (outside) *outside = out / static_cast<double>(kWidth * kHeight);
  return in ? hit / static_cast<double>(in) : 0;
}

struct Outcome {
  double found = 0, outside = 0;                // of the last frame
  double static_inside = 0, static_around = 0;  // what it clears: shares of the box, of the rest
  cv::Mat cleared, cleared_wide;                // the same: 255; what is wide only
  cv::Mat known_static;                         // asked pixel by pixel: 255
  int frames_with_finds = 0;
};

/// Drives the check over a sequence with a moving box and a moving camera.
Outcome drive(const Eigen::Vector3d& box_speed_m_s, double turn_deg_s, int frames,
              bool with_box = true, const Eigen::Vector3d& start_m = {-0.1, 0, 1.5},
              const Eigen::Vector2d& size_m = kBoxM) {
  CheckAlone check(small_camera());
  Outcome result;
  Eigen::Isometry3d last = Eigen::Isometry3d::Identity();
  for (int i = 0; i < frames; ++i) {
    const double t = i / 30.0;
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    const double angle = 0.2 * std::sin(turn_deg_s * 3.14159265 / 180 / 0.2 * t);
    pose.linear() = Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitY()).toRotationMatrix();
    pose.translation().x() = 0.05 * std::sin(3 * t);
    const Eigen::Vector3d box = start_m + box_speed_m_s * t;
    const RgbdFrame frame =
        render(t, pose, with_box ? std::optional<Eigen::Vector3d>(box) : std::nullopt, size_m);
    std::optional<Eigen::Isometry3d> motion;
    if (i > 0) motion = pose.inverse() * last;
    const auto& found = check.find(frame, motion);
    result.frames_with_finds += !found.empty();
    result.found = share_of_box(found, box, pose, size_m, &result.outside);
    Instance standing;
    standing.box = cv::Rect(0, 0, kWidth, kHeight);
    cv::Mat moved(kHeight, kWidth, CV_8UC1, cv::Scalar(255));
    check.context.labels.clear_static(standing.box, moved, false);
    cv::bitwise_not(moved, standing.mask);
    result.cleared = standing.mask;
    cv::Mat left(kHeight, kWidth, CV_8UC1, cv::Scalar(255));
    check.context.labels.clear_static(standing.box, left, true);
    cv::bitwise_not(left, result.cleared_wide);
    result.known_static = cv::Mat::zeros(kHeight, kWidth, CV_8UC1);
    for (int y = 0; y < kHeight; ++y)
      for (int x = 0; x < kWidth; ++x)
        if (check.context.labels.known_static({x, y})) result.known_static.at<uchar>(y, x) = 255;
    result.static_inside = share_of_box({standing}, box, pose, size_m, &result.static_around);
    cv::Mat dynamic = cv::Mat::zeros(kHeight, kWidth, CV_8UC1);
    for (const Instance& s : found) dynamic(s.box).setTo(255, s.mask);
    check.correct(pose);
    check.remember(dynamic);
    last = pose;
  }
  return result;
}

TEST(MotionCheck, FindsAMoverWithoutAName) {
  const Outcome r = drive({0.5, 0, 0}, 0, 25);
  EXPECT_GT(r.found, 0.55);  // cells on its outline say nothing
  EXPECT_LT(r.outside, 0.01);
  EXPECT_GT(r.static_around, 0.5);
  EXPECT_LT(r.static_inside, 0.5 * r.static_around);  // it lies over where it was
}

TEST(MotionCheck, TellsWideStaticSurfacesFromThinOnes) {
  const Outcome r = drive({0.5, 0, 0}, 0, 25);
  EXPECT_EQ(cv::countNonZero(r.cleared_wide & ~r.cleared), 0);
  EXPECT_GT(cv::countNonZero(r.cleared_wide), 0.9 * cv::countNonZero(r.cleared));
  EXPECT_EQ(cv::countNonZero(r.known_static != r.cleared_wide), 0);
  // Opened by a cross of cells 4 pixels wide; what lies beyond the image may be static.
  const cv::Mat cross = cv::getStructuringElement(cv::MORPH_CROSS, {3, 3});
  cv::Mat cells, opened;
  cv::resize(r.cleared, cells, cv::Size(), 0.25, 0.25, cv::INTER_NEAREST);
  cv::morphologyEx(cells, opened, cv::MORPH_OPEN, cross);
  EXPECT_LT(cv::countNonZero(opened), cv::countNonZero(cells)) << "nothing thin was there";
  cv::resize(r.cleared_wide, cells, cv::Size(), 0.25, 0.25, cv::INTER_NEAREST);
  EXPECT_EQ(cv::countNonZero(cells != opened), 0);
}

// What hangs together with a mover may be part of it, however still it is held.
TEST(MotionCheck, WhatTouchesAMoverDoesNotStandAlone) {
  CheckAlone check(small_camera());
  cv::Mat dynamic(kHeight, kWidth, CV_8UC1, cv::Scalar(0));
  dynamic(cv::Rect(150, 80, 20, 40)).setTo(255);  // a part of a board 1.5 m away
  for (int i = 0; i < 60; ++i) {
    check.find(render(i / 30.0, Eigen::Isometry3d::Identity(), Eigen::Vector3d(0, 0, 1.5)),
               Eigen::Isometry3d::Identity());
    check.remember(dynamic);
  }
  const CellLabels& labels = check.context.labels;
  const cv::Point beside(186, 100), wall(250, 100);
  EXPECT_TRUE(labels.known_static(beside));
  EXPECT_FALSE(labels.stood_alone(beside));
  EXPECT_TRUE(labels.stood_alone(wall));
}

TEST(MotionCheck, FindsAMoverWhileTheCameraTurns) {
  const Outcome r = drive({0.5, 0, 0}, 60, 25);
  EXPECT_GT(r.found, 0.55);  // cells on its outline say nothing
  EXPECT_LT(r.outside, 0.02);
}

TEST(MotionCheck, FindsAMoverThatComesNearerAndASlowOne) {
  EXPECT_GT(drive({0, 0, -0.5}, 20, 30).found, 0.55);
  EXPECT_GT(drive({0.2, 0, 0}, 0, 45).found, 0.3);  // 10 cm in half a second
}

TEST(MotionCheck, FindsAHandThatFillsMuchOfTheImage) {
  // 100 square centimetres, at arm's length.
  const Outcome r = drive({0.3, 0, 0}, 0, 25, true, {-0.1, 0, 0.6}, {0.1, 0.1});
  EXPECT_GT(r.found, 0.55);
  EXPECT_LT(r.outside, 0.01);
}

TEST(MotionCheck, FindsNothingInAStaticWorld) {
  EXPECT_EQ(drive({0, 0, 0}, 0, 40).frames_with_finds, 0);
  EXPECT_EQ(drive({0, 0, 0}, 60, 40).frames_with_finds, 0);
  EXPECT_EQ(drive({0, 0, 0}, 60, 40, false).frames_with_finds, 0);
}

// Nothing is measured of him, and the wall beside him is at the end of the range.
TEST(MotionCheck, WhoPassesRightBeforeTheLensLeavesNoMover) {
  CheckAlone check(small_camera());
  const Eigen::Isometry3d still = Eigen::Isometry3d::Identity();
  for (int i = 0; i < 60; ++i) {
    RgbdFrame frame = render(i / 30.0, still, std::nullopt);
    const cv::Rect hidden(24 * (i - 15) - 120, 0, 120, kHeight);
    frame.depth(hidden & cv::Rect(0, 0, kWidth, kHeight)).setTo(0);
    EXPECT_TRUE(check.find(frame, still).empty()) << "frame " << i;
    check.remember(cv::Mat::zeros(kHeight, kWidth, CV_8UC1));
  }
}

TEST(MotionCheck, SaysNothingWithoutDepthOrMotion) {
  CheckAlone check(small_camera());
  for (int i = 0; i < 20; ++i) {
    RgbdFrame frame =
        render(i / 30.0, Eigen::Isometry3d::Identity(), Eigen::Vector3d(-0.1 + 0.03 * i, 0, 1.5));
    EXPECT_TRUE(check.find(frame, std::nullopt).empty()) << "no motion given, frame " << i;
    check.remember(cv::Mat::zeros(kHeight, kWidth, CV_8UC1));
    frame.timestamp += 0.01;
    frame.depth = cv::Mat();
    EXPECT_TRUE(check.find(frame, Eigen::Isometry3d::Identity()).empty()) << "no depth";
    check.remember(cv::Mat::zeros(kHeight, kWidth, CV_8UC1));
  }
}

TEST(MotionCheck, ForgetsAtACutAndAtRepeatedTimestamps) {
  CheckAlone check(small_camera());
  const Eigen::Isometry3d still = Eigen::Isometry3d::Identity();
  const cv::Mat nothing = cv::Mat::zeros(kHeight, kWidth, CV_8UC1);
  const auto feed = [&](double t, double x, const Eigen::Isometry3d& motion) {
    const bool any = !check.find(render(t, still, Eigen::Vector3d(x, 0, 1.5)), motion).empty();
    check.remember(nothing);
    return any;
  };
  for (int i = 0; i < 15; ++i) feed(i / 30.0, -0.4, still);
  EXPECT_TRUE(feed(0.5, 0.4, still));
  Eigen::Isometry3d jump = still;
  jump.translation().x() = 3;
  EXPECT_FALSE(feed(0.55, -0.4, jump));
  for (int i = 0; i < 15; ++i) feed(1 + i / 30.0, -0.4, still);
  EXPECT_FALSE(feed(1.2, 0.4, still)) << "a timestamp that goes back starts anew";
}

TEST(MotionCheck, FollowsTheHostsPoseNotItsPrediction) {
  // The prediction is wrong by 2 degrees each frame; the host's pose puts it right.
  CheckAlone check(small_camera());
  int finds = 0;
  for (int i = 0; i < 30; ++i) {
    const Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    Eigen::Isometry3d wrong = Eigen::Isometry3d::Identity();
    wrong.linear() =
        Eigen::AngleAxisd((i % 2 ? 0.004 : -0.004), Eigen::Vector3d::UnitY()).toRotationMatrix();
    finds += !check.find(render(i / 30.0, pose, std::nullopt), wrong).empty();
    check.correct(pose);
    check.remember(cv::Mat::zeros(kHeight, kWidth, CV_8UC1));
  }
  EXPECT_EQ(finds, 0);
}

TEST(MotionCheck, RefusesSettingsThatMakeNoSense) {
  MotionCheckSettings settings;
  settings.block_px = 7;
  EXPECT_THROW(MotionCheck check(settings), Error);
  settings = {};
  settings.movers.min_moved_share = 2;
  EXPECT_THROW(MotionCheck check(settings), Error);
  CheckAlone check(small_camera());
  check.find(render(0, Eigen::Isometry3d::Identity(), std::nullopt), std::nullopt);
  EXPECT_THROW(check.remember(cv::Mat::zeros(10, 10, CV_8UC1)), Error);
}

}  // namespace
}  // namespace stillpoint
