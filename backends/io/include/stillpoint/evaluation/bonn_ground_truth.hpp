// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "stillpoint/core/trajectory.hpp"
#include "stillpoint/evaluation/alignment.hpp"

namespace stillpoint {

/// Turns ground truth of the Bonn RGB-D Dynamic data set, whose groundtruth.txt is of the body of
/// motion-capture markers on the camera, into poses of the camera: T_ROS^-1 T T_ROS T_m.
///
/// T_ROS and T_m stand on the data set's page,
/// https://www.ipb.uni-bonn.de/data/rgbd-dynamic-dataset/. Loaders of newer systems (WildGS-SLAM's
/// and others) apply them, the RGB-D SLAM papers before them do not. The page's T_m carries a scale
/// of 1.06 in its rotation; the nearest rotation is taken. The camera is 19 mm from the body's
/// origin. O(n).
inline Trajectory camera_of_bonn_body(Trajectory body) {
  Eigen::Matrix3d ros, marker;
  ros << -1, 0, 0, 0, 0, 1, 0, 1, 0;
  marker << 1.0157, 0.1828, -0.2389, 0.0009, -0.8431, -0.6413, -0.3009, 0.6147, -0.8085;
  Eigen::Isometry3d T_ros = Eigen::Isometry3d::Identity(), T_m = T_ros;
  T_ros.linear() = ros;
  T_m.linear() = detail::nearest_rotation(marker);
  T_m.translation() << 0.0113, -0.0098, 0.0111;
  for (StampedPose& pose : body)
    pose.T_world_camera = T_ros.inverse() * pose.T_world_camera * T_ros * T_m;
  return body;
}

}  // namespace stillpoint
