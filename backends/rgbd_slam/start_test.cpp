// SPDX-License-Identifier: BSD-2-Clause
#include <gtest/gtest.h>

#include <vector>

#include "slam_fixture.hpp"

namespace {

using namespace stillpoint;
using namespace stillpoint::rgbd_slam;
using namespace test_scene;

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

// What fills most of the image takes the first frames along; then it goes, and they are corrected.
void expect_corrected_start(double covered_s, double rate_hz = 30) {
  for (const auto& settings : {small_settings(), threaded_settings()}) {
    const bool threaded = settings.threaded;
    if (threaded && rate_hz > 30) continue;  // slow, as the threads are waited for after each frame
    SlamSystem slam(camera(), settings);
    Trajectory tracked;
    for (int step = 0; step < 80 * rate_hz / 30; ++step) {
      const double t = step / rate_hz;
      const Eigen::Isometry3d T = path_at(t);
      RgbdFrame frame = render(T, t);
      if (t < covered_s - 1e-6) {
        // It looks like the walls behind the camera, which are not seen else.
        Eigen::Isometry3d moved = Eigen::AngleAxisd(3.14159, Eigen::Vector3d::UnitY()) * T;
        moved.pretranslate(Eigen::Vector3d(0.45, 0, 0.15) * t);
        cover_left(frame, frame.color.cols * 3 / 5, moved);
      }
      const auto pose = feed(slam, frame);
      ASSERT_TRUE(pose) << step;
      tracked.push_back({frame.timestamp, *pose});
      if (threaded) slam.finish();  // else frames come faster than the map is built
    }
    slam.finish();
    ASSERT_EQ(slam.trajectory().size(), tracked.size());
    EXPECT_GT(worst_error(tracked), 0.08) << threaded;  // else nothing to correct
    EXPECT_LT(worst_error(slam.trajectory()), 0.05) << threaded;
    // Where it is now has not changed.
    EXPECT_LT(distance(slam.trajectory().back().T_world_camera, tracked.back().T_world_camera),
              0.01)
        << threaded;
  }
}

TEST(SlamSystem, CorrectsTheStartOnceItKnowsWhatStandsStill) { expect_corrected_start(8 / 30.0); }

// Then keyframes of 10 frames later have it in their map, too.
TEST(SlamSystem, CorrectsALongWrongStart) { expect_corrected_start(20 / 30.0); }

// 1.5 s are 15 or 23 frames then.
TEST(SlamSystem, CorrectsTheStartOfASlowCamera) {
  expect_corrected_start(8 / 30.0, 15);
  expect_corrected_start(20 / 30.0, 10);
}

// And 90 or 135, of which every second or third is kept.
TEST(SlamSystem, CorrectsTheStartOfAFastCamera) {
  expect_corrected_start(20 / 30.0, 60);
  expect_corrected_start(0.85, 90);
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

TEST(SlamSystem, StartsAnewWhenAYoungMapIsLost) {
  SlamSystem::Settings settings = small_settings();
  settings.tracking.restart_after_s = 0.1;
  SlamSystem slam(camera(), settings);
  ASSERT_TRUE(feed(slam, render(path(0), 0)));
  RgbdFrame black = render(path(0), 0.1);
  black.color.setTo(0);
  for (int i = 0; i < 4; ++i) EXPECT_FALSE(feed(slam, black));
  EXPECT_TRUE(slam.trajectory().empty());
  EXPECT_TRUE(feed(slam, render(path(30), 1)));
  EXPECT_EQ(slam.trajectory().size(), 1u);
}

}  // namespace
