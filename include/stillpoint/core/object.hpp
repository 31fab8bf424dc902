// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <optional>
#include <string>

namespace stillpoint {

/// Where an object is and how it moves, along the axes of one coordinate frame.
struct ObjectState {
  /// Centroid of the object's visible surface, metres. It lies before the middle of a body, by 0.1
  /// m or so of a person.
  Eigen::Vector3d centroid_m = Eigen::Vector3d::Zero();
  /// Velocity against the static world (not against the camera), m/s.
  Eigen::Vector3d velocity_m_s = Eigen::Vector3d::Zero();
  /// Covariance of (centroid, velocity).
  Eigen::Matrix<double, 6, 6, Eigen::DontAlign> covariance =
      Eigen::Matrix<double, 6, 6>::Identity();
};

/// A dynamic object of a frame, and what is known of it from the frames before.
struct DynamicObject {
  /// From 0; stays with the object, also while it is hidden for a moment (see
  /// ObjectTrackerSettings::max_lost_s).
  int id = 0;
  /// Class by name; empty: found by its motion, and never named by the segmenter.
  std::string class_name;
  /// The segmenter's confidence, 0 to 1.
  float score = 1;
  /// Bounding box in pixels, inside the image.
  cv::Rect box;
  /// CV_8UC1 of the box's size, 255 = object, before dilation; shares its data with the front end.
  /// Empty: only the box is known.
  cv::Mat mask;
  /// The mask was carried here: the segmenter and the motion check missed it in this frame, or the
  /// segmenter's result is late.
  bool predicted = false;
  /// Median depth of the mask's pixels, metres; 0: not measured.
  float depth_m = 0;
  /// How far the centre of its mask has moved in the image since the frame before, by the camera's
  /// motion and its own, pixels; 0 in its first frame and after a gap.
  cv::Point2f shift_px;
  /// Seconds since it was first seen, and since it was last seen (0: in this frame; behind a slow
  /// segmenter, how late its result is).
  double tracked_s = 0, unseen_s = 0;
  /// Along the camera's axes: x right, y down, z forward. Empty until its depth was measured; then
  /// predicted where it is not. Where the camera's motion is not known, the velocity is 0 and its
  /// covariance large.
  std::optional<ObjectState> in_camera;
  /// In the world of the poses that the host tells (FrontEnd::correct_pose()); empty where it tells
  /// none.
  std::optional<ObjectState> in_world;
};

}  // namespace stillpoint
