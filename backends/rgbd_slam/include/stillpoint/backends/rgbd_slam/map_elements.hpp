// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <map>
#include <set>
#include <vector>

#include "stillpoint/backends/rgbd_slam/ids.hpp"
#include "stillpoint/backends/rgbd_slam/keypoint_frame.hpp"
#include "stillpoint/backends/rgbd_slam/patch.hpp"

namespace stillpoint::rgbd_slam {

/// Keypoint `keypoint` of keyframe `keyframe` shows a point.
struct Observation {
  KeyframeId keyframe;
  std::size_t keypoint;
};

/// A point of the static world.
struct MapPoint {
  PointId id;
  /// World coordinates, metres.
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  /// Mean of the unit vectors from the cameras that see it to the point.
  Eigen::Vector3d view_direction = Eigen::Vector3d::Zero();
  Descriptor descriptor{};
  /// Distance at which it would be seen on level 0 of the pyramid.
  float level0_distance_m = 0;
  Patch patch;
  /// In ascending order of keyframes; one per keyframe.
  std::vector<Observation> observations;
  /// Moves with this keyframe when a loop is closed; the first one that saw it.
  KeyframeId reference, first_keyframe;
  /// Frames in whose view it should have been, and those that found it.
  int visible = 1, found = 1;
};

/// A frame that the map is built of.
struct Keyframe {
  KeyframeId id;
  Eigen::Isometry3d T_camera_world = Eigen::Isometry3d::Identity();
  KeypointFrame frame;
  /// The point of each keypoint, or none.
  std::vector<PointId> points;
  /// Keyframes that see the same points, and how many.
  std::map<KeyframeId, int> covisible;
  /// Spanning tree: an earlier keyframe; none for the origin. Accepted loops.
  KeyframeId parent;
  std::set<KeyframeId> loop_edges;

  double timestamp() const { return frame.timestamp; }
  Eigen::Vector3d center() const { return T_camera_world.inverse().translation(); }
};

}  // namespace stillpoint::rgbd_slam
