// SPDX-License-Identifier: BSD-2-Clause
#include <gtest/gtest.h>

#include <functional>

#include "slam_fixture.hpp"

namespace {

using namespace stillpoint;
using namespace stillpoint::rgbd_slam;
using namespace test_scene;

Eigen::Isometry3d path_at_10_hz(double t) { return path_at(t * 20 / 30); }

TEST(SlamSystem, SaysThatItIsLostAndGoesOnInTheSameFrameOfReference) {
  SlamSystem slam(camera(), small_settings());
  walk(slam, 20);
  RgbdFrame black = render(path(0), 2.0);
  black.color.setTo(0);
  for (int i = 0; i < 3; ++i) {
    black.timestamp = 2.0 + 0.1 * i;
    EXPECT_FALSE(feed(slam, black).has_value());
    EXPECT_FALSE(slam.predicted_motion().has_value());
  }
  // Back at a place seen long ago.
  const auto T = feed(slam, render(path(6), 2.4));
  ASSERT_TRUE(T.has_value());
  EXPECT_TRUE(slam.stats().recovered);
  EXPECT_LT(distance(*T, path(0).inverse() * path(6)), 0.02);
  EXPECT_EQ(slam.trajectory().size(), 21u);
}

TEST(SlamSystem, ATrajectoryIsInOrderThoughTheClockWasSetBack) {
  for (const bool revise : {true, false}) {
    SlamSystem::Settings settings = small_settings();
    settings.revise_poses = revise;
    SlamSystem slam(camera(), settings);
    const double times[] = {1.0, 1.1, 1.2, 1.05, 1.15, 1.2, 1.25};
    for (int i = 0; i < 7; ++i) ASSERT_TRUE(feed(slam, render(path(3 * i), times[i])).has_value());
    const Trajectory trajectory = slam.trajectory();
    ASSERT_EQ(trajectory.size(), 6u) << "1.2 came twice";
    const int frames[] = {0, 3, 1, 4, 5, 6};
    for (std::size_t k = 0; k < 6; ++k) {
      EXPECT_DOUBLE_EQ(trajectory[k].timestamp, times[frames[k]]);
      EXPECT_LT(distance(trajectory[k].T_world_camera,
                         trajectory[0].T_world_camera * path(0).inverse() * path(3 * frames[k])),
                0.03);
    }
  }
}

// Two seconds of trouble at 10 Hz in the middle of a walk: what was tracked, and what was lost.
class Trouble : public testing::Test {
 protected:
  static constexpr int kFrames = 45, kBegin = 15, kEnd = 35;

  // `change` spoils a frame of the bad time and its mask.
  void walk(const std::function<void(RgbdFrame&, DynamicMask&)>& change) {
    for (int step = 0; step < kFrames; ++step) {
      RgbdFrame frame = render(path(2 * step), step * 0.1);
      DynamicMask mask;
      const bool bad = step >= kBegin && step < kEnd;
      if (bad) change(frame, mask);
      const bool tracked = feed(slam_, frame, mask).has_value();
      const MapTracking::Stats& stats = slam_.stats();
      (bad ? tracked_in_trouble_ : tracked_else_) += tracked;
      recovered_ += stats.recovered;
      if (bad) keypoints_ += stats.keypoints, with_depth_ += stats.with_depth;
      EXPECT_EQ(tracked, slam_.trajectory().size() > 0 &&
                             slam_.trajectory().back().timestamp == frame.timestamp)
          << step;
    }
  }

  void expect_lost_and_found_again() const {
    EXPECT_EQ(tracked_in_trouble_, 0) << "nothing there is like the map";
    EXPECT_EQ(tracked_else_, kFrames - (kEnd - kBegin));
    EXPECT_EQ(recovered_, 1);
    EXPECT_LT(worst_error(slam_.trajectory(), path_at_10_hz), 0.03);
  }

  SlamSystem slam_{camera(), small_settings()};
  int tracked_in_trouble_ = 0, tracked_else_ = 0, recovered_ = 0;
  int keypoints_ = 0, with_depth_ = 0;
};

TEST_F(Trouble, BlackImagesAreLostAndTheWayIsFoundAgain) {
  walk([](RgbdFrame& frame, DynamicMask&) { frame.color.setTo(0); });
  EXPECT_EQ(keypoints_, 0);
  expect_lost_and_found_again();
}

TEST_F(Trouble, FullMasksAreLostAndTheWayIsFoundAgain) {
  walk([](RgbdFrame& frame, DynamicMask& mask) {
    mask.image = cv::Mat(frame.color.size(), CV_8UC1, cv::Scalar(255));
  });
  EXPECT_EQ(keypoints_, 0);
  expect_lost_and_found_again();
}

TEST_F(Trouble, AKidnappedCameraIsLostUntilItSeesWhatItKnows) {
  // Half of the frames look the other way, at walls never seen.
  int step = kBegin;
  walk([&](RgbdFrame& frame, DynamicMask&) {
    Eigen::Isometry3d T = path(2 * step);
    T.linear() = T.linear() * Eigen::AngleAxisd(3.14, Eigen::Vector3d::UnitY()).toRotationMatrix();
    frame = render(T, frame.timestamp);
    ++step;
  });
  EXPECT_GT(keypoints_, 20 * 100);
  expect_lost_and_found_again();
}

// No mask covers the mover yet.
TEST(SlamSystem, IsNotTakenAlongByWhatMovesBeforeTheFirstMask) {
  SlamSystem slam(camera(), small_settings());
  Trajectory tracked;
  for (int step = 0; step < 5; ++step) {
    const RgbdFrame frame = render_with_mover(step);
    const auto pose = feed(slam, frame);
    ASSERT_TRUE(pose) << step;
    tracked.push_back({frame.timestamp, *pose});
  }
  EXPECT_LT(worst_error(tracked), 0.02);  // 0.055 if the pose is a compromise with it
}

// 30 cm from one frame to the next, seen by a small part of the image.
TEST(SlamSystem, ALeapThatFewMatchesTellOfIsLost) {
  SlamSystem slam(camera(), small_settings());
  walk(slam, 20, 1, 1 / 30.0);
  Eigen::Isometry3d beside = path(20);
  beside.translation().x() += 0.3;
  const DynamicMask mask{cv::Mat(camera().height, camera().width, CV_8UC1, cv::Scalar(255))};
  mask.image(cv::Rect(100, 90, 70, 50)).setTo(0);
  EXPECT_FALSE(feed(slam, render(beside, 20 / 30.0), mask));
  EXPECT_GE(slam.stats().inliers, 20) << "or it would be lost for too few";
  const auto next = feed(slam, render(path(21), 21 / 30.0));
  ASSERT_TRUE(next && !slam.stats().recovered);
  EXPECT_LT(distance(*next, path(0).inverse() * path(21)), 0.02);
}

TEST(SlamSystem, StartsAnewWhenAYoungMapIsLost) {
  SlamSystem::Settings settings = small_settings();
  settings.tracking.restart_after_s = 0.1;
  SlamSystem slam(camera(), settings);
  ASSERT_TRUE(feed(slam, render(path(0), 0)));
  RgbdFrame black = render(path(0), 0.1);
  black.color.setTo(0);
  for (int i = 0; i < 4; ++i) EXPECT_FALSE(feed(slam, black));
  EXPECT_TRUE(feed(slam, render(path(30), 1)));
  EXPECT_EQ(slam.trajectory().size(), 1u);
}

TEST(SlamSystem, StartsWithTheFirstFrameThatHasDepth) {
  SlamSystem slam(camera(), small_settings());
  RgbdFrame blind = render(path(0), 0);
  blind.depth.setTo(0);
  EXPECT_FALSE(feed(slam, blind));
  EXPECT_TRUE(feed(slam, render(path(0), 0.1)));
}

TEST_F(Trouble, MissingDepthIsBridged) {
  int step = 0;
  walk([&](RgbdFrame& frame, DynamicMask&) {
    // Both kinds of nothing: no value, no image.
    if (step++ % 2)
      frame.depth.setTo(0);
    else
      frame.depth.release();
  });
  EXPECT_EQ(with_depth_, 0);
  EXPECT_EQ(tracked_in_trouble_ + tracked_else_, kFrames);
  EXPECT_EQ(recovered_, 0);
  EXPECT_LT(worst_error(slam_.trajectory(), path_at_10_hz), 0.03);
}

}  // namespace
