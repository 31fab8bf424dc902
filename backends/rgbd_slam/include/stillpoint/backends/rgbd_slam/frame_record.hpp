// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <vector>

#include "stillpoint/backends/rgbd_slam/map.hpp"
#include "stillpoint/backends/rgbd_slam/pose_optimizer.hpp"
#include "stillpoint/backends/rgbd_slam/tracked_frame.hpp"

namespace stillpoint::rgbd_slam {

/// Where a frame was tracked: relative to a keyframe, with which it moves. Until it is settled it
/// remembers which points it saw, and where.
class FrameRecord {
 public:
  FrameRecord(const Map& map, KeyframeId reference, const TrackedFrame& frame)
      : timestamp_(frame.frame.timestamp) {
    attach_to(map, reference, frame.T_camera_world);
    for (std::size_t i = 0; i < frame.points.size(); ++i)
      if (frame.points[i] != kNone) sights_.push_back({frame.points[i], frame.frame.keypoints[i]});
  }

  double timestamp() const { return timestamp_; }

  /// T_camera_world.
  Eigen::Isometry3d pose(const Map& map) const {
    return T_camera_reference_ * map.pose_of(reference_);
  }

  /// From now on it moves with another keyframe.
  void attach_to(const Map& map, KeyframeId reference, const Eigen::Isometry3d& T_camera_world) {
    reference_ = reference;
    T_camera_reference_ = T_camera_world * map.pose_of(reference).inverse();
  }

  /// Takes another pose. What the frame saw belongs to the old one and is forgotten.
  void correct(const Map& map, KeyframeId reference, const Eigen::Isometry3d& T_camera_world) {
    attach_to(map, reference, T_camera_world);
    std::vector<Sight>().swap(sights_);
  }

  /// Refines the pose on the points as the map knows them by now, better than when the frame was
  /// tracked: later keyframes see them, too. Forgets what it saw. A keyframe's own pose is the
  /// map's, and stays. O(points).
  void settle(const CameraModel& model, const Map& map) {
    std::vector<Sight> sights;
    sights.swap(sights_);
    const Keyframe* keyframe = map.keyframe(reference_);
    if (keyframe && keyframe->timestamp() == timestamp_) return;
    std::vector<PoseObservation> observations;
    for (const Sight& s : sights)
      if (const MapPoint* point = map.point(map.resolve(s.point)))
        observations.push_back(
            pose_observation(model, s.keypoint, observations.size(), point->position));
    if (observations.size() < kFewest) return;
    Eigen::Isometry3d T_camera_world = pose(map);
    const int fitting = optimize_pose(model.camera, model.noise, observations, T_camera_world);
    // The points may have moved in between as no one pose explains.
    if (fitting >= kFitting * static_cast<double>(observations.size()))
      attach_to(map, reference_, T_camera_world);
  }

 private:
  static constexpr std::size_t kFewest = 20;
  static constexpr double kFitting = 0.7;

  struct Sight {
    PointId point;
    FrameKeypoint keypoint;
  };

  double timestamp_;
  KeyframeId reference_ = kNone;
  Eigen::Isometry3d T_camera_reference_ = Eigen::Isometry3d::Identity();
  std::vector<Sight> sights_;
};

}  // namespace stillpoint::rgbd_slam
