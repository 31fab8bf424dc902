// SPDX-License-Identifier: BSD-2-Clause
#include <gtest/gtest.h>

#include "slam_fixture.hpp"

namespace {

using namespace stillpoint;
using namespace stillpoint::rgbd_slam;
using namespace test_scene;

// What fills most of the image moves, takes the first frames along, and goes.
struct Start {
  Trajectory tracked, finished;
};

Start start_among_movers(const SlamSystem::Settings& settings, double covered_s, double rate_hz,
                         double speed_m_s = 0.47, double blind_s = 0) {
  SlamSystem slam(camera(), settings);
  Start start;
  for (double t = -blind_s; t < -1e-6; t += 1 / rate_hz) {
    RgbdFrame black = render(path_at(0), t);
    black.color.setTo(0);
    EXPECT_FALSE(feed(slam, black));
  }
  for (int step = 0; step < 3 * rate_hz; ++step) {
    const double t = step / rate_hz;
    const Eigen::Isometry3d T = path_at(t);
    RgbdFrame frame = render(T, t);
    if (t < covered_s - 1e-6) {
      // It looks like the walls behind the camera, which are not seen else.
      Eigen::Isometry3d moved = Eigen::AngleAxisd(3.14159, Eigen::Vector3d::UnitY()) * T;
      moved.pretranslate(speed_m_s * t * Eigen::Vector3d(3, 0, 1).normalized());
      cover_left(frame, 0.6, moved);
    }
    const auto pose = feed(slam, frame);
    EXPECT_TRUE(pose) << step;
    if (pose) start.tracked.push_back({t, *pose});
    if (settings.threaded) slam.finish();  // else frames come faster than the map is built
  }
  slam.finish();
  start.finished = slam.trajectory();
  return start;
}

void expect_corrected(const SlamSystem::Settings& settings, double covered_s, double rate_hz,
                      double blind_s = 0) {
  const Start start = start_among_movers(settings, covered_s, rate_hz, 0.47, blind_s);
  ASSERT_EQ(start.finished.size(), start.tracked.size());
  EXPECT_GT(worst_error(start.tracked), 0.08) << "or there is nothing to correct";
  EXPECT_LT(worst_error(start.finished), 0.05);
  EXPECT_LT(distance(start.finished.back().T_world_camera, start.tracked.back().T_world_camera),
            0.01)
      << "where it is now has not changed";
}

TEST(SlamSystem, CorrectsAStartThatWentAlongWithAMover) {
  expect_corrected(small_settings(), 8 / 30.0, 30);
  expect_corrected(threaded_settings(), 8 / 30.0, 30);
}

TEST(SlamSystem, CorrectsAStartAfterALensThatWasCovered) {
  expect_corrected(small_settings(), 8 / 30.0, 30, 2);
}

// Keyframes that are 10 frames later have the mover in their map, too.
TEST(SlamSystem, CorrectsALongWrongStart) { expect_corrected(small_settings(), 20 / 30.0, 30); }

TEST(SlamSystem, CorrectsTheStartOfASlowCamera) {
  expect_corrected(small_settings(), 20 / 30.0, 10);
}

// Of a camera that turns by 60 degrees per second, and of whose first frames few keypoints are
// kept: the frames with less than 0.7 times the matches right after the newest keyframe.
struct Fallen {
  int frames = 0, keyframes = 0;
};

Fallen turn_after_a_thin_start(const SlamSystem::Settings& settings) {
  SlamSystem slam(camera(), settings);
  Fallen fallen;
  int known = 0, since = 0;
  for (int step = 0; step < 40; ++step) {
    Eigen::Isometry3d T = path(0);
    T.rotate(Eigen::AngleAxisd(step * std::acos(-1.0) / 90, Eigen::Vector3d::UnitY()));
    const RgbdFrame frame = render(T, step / 30.0);
    Selection selection = keep_all(slam.extract(frame, {}).size());
    if (step < 8) selection.kept.resize(selection.kept.size() / 3);
    EXPECT_TRUE(slam.track(frame, {}, selection)) << step;
    const auto& stats = slam.stats();
    if (since == 1) known = stats.inliers;
    if (since > 1 && stats.inliers < 0.7 * known)
      ++fallen.frames, fallen.keyframes += stats.keyframe;
    since = stats.keyframe ? 1 : since + 1;
  }
  return fallen;
}

TEST(SlamSystem, MakesAKeyframeWhereMatchesFallThoughItsReferenceKnowsLittle) {
  SlamSystem::Settings settings = small_settings();
  const Fallen fallen = turn_after_a_thin_start(settings);
  EXPECT_GT(fallen.frames, 0);
  EXPECT_EQ(fallen.keyframes, fallen.frames);
  settings.tracking.fallen_ratio = 0;
  const Fallen without = turn_after_a_thin_start(settings);
  EXPECT_LT(without.keyframes, without.frames);
}

TEST(SlamSystem, LeavesTheStartOfAnOdometryAsItWasTracked) {
  const Start start =
      start_among_movers(small_settings(SlamSystem::Settings::odometry()), 8 / 30.0, 30);
  expect_same(start.finished, start.tracked);
}

// Most points still fit a pose that is off by two centimetres, but they fit another one better.
TEST(SlamSystem, CorrectsAStartThatIsOffByALittle) {
  for (const double speed_m_s : {0.05, 0.06}) {
    const Start start = start_among_movers(small_settings(), 8 / 30.0, 30, speed_m_s);
    EXPECT_GT(worst_error(start.tracked), 0.02) << "or there is nothing to correct";
    EXPECT_LT(worst_error(start.finished), 0.6 * worst_error(start.tracked)) << speed_m_s;
  }
}

// Few frames in the first seconds, with gaps.
TEST(SlamSystem, ReviewsAStartOfFewFrames) {
  SlamSystem slam(camera(), small_settings());
  Trajectory tracked;
  int step = 0;
  for (const double t : {0.0, 0.4, 1.9, 3.1, 3.2, 6.0}) {
    const auto pose = feed(slam, render(path(step++), t));
    ASSERT_TRUE(pose) << t;
    tracked.push_back({t, *pose});
  }
  slam.finish();
  ASSERT_EQ(slam.trajectory().size(), tracked.size());
  for (std::size_t i = 0; i < tracked.size(); ++i)
    EXPECT_LT(distance(slam.trajectory()[i].T_world_camera, tracked[i].T_world_camera), 0.01) << i;
}

}  // namespace
