// SPDX-License-Identifier: BSD-2-Clause
#pragma once

// Adapter for ORB_SLAM3 1.0, C++14. In the host, the hook: stillpoint::keep_static(), see host.hpp.
// In the runner: track_rgbd().

#include <opencv2/core.hpp>

#include "stillpoint/backends/host.hpp"

namespace stillpoint {
namespace orb_slam3 {

/// Runs one frame through front end and host: mask, TrackRGBD, pose back. `slam` is the host's
/// System, known by its members TrackRGBD and GetTrackingState only. Returns whether the host
/// tracked; `T_world_camera`, if given, takes the pose. The frame's color and depth must be what
/// the host extracts from: no resizing in its settings file. Throws Error for a frame that breaks
/// its rules.
template <class System>
bool track_rgbd(System& slam, HostFrontEnd& front_end, const RgbdFrame& frame,
                const Segmentation& segmentation, cv::Matx44d* T_world_camera = nullptr) {
  constexpr int kNotInitialized = 1, kOk = 2;  // the host's states; below: not even an image yet
  front_end.compute_mask(frame, segmentation);
  const auto T_camera_world = slam.TrackRGBD(frame.color, frame.depth, frame.timestamp).matrix();
  const int state = slam.GetTrackingState();
  if (state != kOk) {
    front_end.set_lost(state <= kNotInitialized);
    return false;
  }
  cv::Matx44d T = cv::Matx44d::eye();  // T_world_camera = [R' | -R' t]
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) {
      T(c, r) = T_camera_world(r, c);
      T(c, 3) -= T(c, r) * T_camera_world(r, 3);
    }
  front_end.correct_pose(frame.timestamp, T);
  if (T_world_camera) *T_world_camera = T;
  return true;
}

}  // namespace orb_slam3
}  // namespace stillpoint
