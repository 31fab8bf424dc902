// SPDX-License-Identifier: BSD-2-Clause
// A small SlamSystem that walks through the room of test_scene.hpp.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>

#include "stillpoint/backends/rgbd_slam/slam_system.hpp"
#include "test_scene.hpp"

namespace test_scene {

using stillpoint::rgbd_slam::SlamSystem;

inline SlamSystem::Settings small_settings(SlamSystem::Settings settings = {}) {
  settings.features.features = 500;
  return settings;
}

inline SlamSystem::Settings threaded_settings() {
  SlamSystem::Settings settings = small_settings();
  settings.threaded = true;
  return settings;
}

/// Tracks a frame on all of its keypoints.
inline std::optional<Eigen::Isometry3d> feed(stillpoint::Tracker& tracker,
                                             const stillpoint::RgbdFrame& frame,
                                             const stillpoint::DynamicMask& mask = {}) {
  const std::size_t n = tracker.extract(frame, mask).size();
  return tracker.track(frame, mask, keep_all(n));
}

/// Tracks frames at path(stride step), `dt` seconds apart; returns the poses as they came. None may
/// be lost.
inline stillpoint::Trajectory walk(stillpoint::Tracker& tracker, int frames, int stride = 3,
                                   double dt = 0.1) {
  stillpoint::Trajectory tracked;
  for (int step = 0; step < frames; ++step) {
    const auto pose = feed(tracker, render(path(stride * step), step * dt));
    EXPECT_TRUE(pose) << step;
    if (pose) tracked.push_back({step * dt, *pose});
  }
  return tracked;
}

inline void expect_same(const stillpoint::Trajectory& a, const stillpoint::Trajectory& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i)
    EXPECT_EQ(a[i].T_world_camera.matrix(), b[i].T_world_camera.matrix()) << i;
}

inline double distance(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
  return (a.translation() - b.translation()).norm();
}

/// Largest distance between the trajectory and the path it was rendered from, metres.
inline double worst_error(const stillpoint::Trajectory& trajectory,
                          const std::function<Eigen::Isometry3d(double)>& truth = path_at) {
  const Eigen::Isometry3d origin =
      trajectory.front().T_world_camera * truth(trajectory.front().timestamp).inverse();
  double worst = 0;
  for (const stillpoint::StampedPose& p : trajectory)
    worst = std::max(worst, distance(p.T_world_camera, origin * truth(p.timestamp)));
  return worst;
}

}  // namespace test_scene
