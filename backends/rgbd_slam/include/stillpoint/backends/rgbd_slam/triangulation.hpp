// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "stillpoint/backends/rgbd_slam/map.hpp"
#include "stillpoint/backends/rgbd_slam/tracked_frame.hpp"

namespace stillpoint::rgbd_slam {

/// The point nearest to two rays, in the first camera; no value for a parallax under about one
/// degree. `ray2`: in the second camera.
inline std::optional<Eigen::Vector3d> nearest_to_rays(const Eigen::Vector3d& ray1,
                                                      const Eigen::Vector3d& ray2,
                                                      const Eigen::Isometry3d& T_second_first) {
  const Eigen::Vector3d baseline = T_second_first.inverse().translation();
  const Eigen::Vector3d a = ray1.normalized();
  const Eigen::Vector3d b = (T_second_first.linear().transpose() * ray2).normalized();
  const double cosine = a.dot(b), determinant = 1 - cosine * cosine;
  if (determinant < 3e-4) return std::nullopt;
  const double s = (a.dot(baseline) - cosine * b.dot(baseline)) / determinant;
  const double u = (cosine * a.dot(baseline) - b.dot(baseline)) / determinant;
  return (s * a + baseline + u * b) / 2;
}

/// Makes points of keypoints without depth that two keyframes see from different places.
///
/// Keypoints without a point are matched by descriptor near the other's epipolar line,
/// triangulated, and taken when both rays agree: parallax over about a degree, before both cameras,
/// reprojection within the noise. Returns the new points. O(free keypoints squared).
inline std::vector<PointId> triangulate_between(const CameraModel& model, Map& map, Keyframe& first,
                                                Keyframe& second) {
  std::vector<PointId> created;
  const Eigen::Isometry3d T21 = second.T_camera_world * first.T_camera_world.inverse();
  if (T21.inverse().translation().norm() < 0.02) return created;
  const auto ray_of = [&](const FrameKeypoint& k) { return model.camera.unproject(k.x, k.y, 1); };
  std::vector<std::pair<std::size_t, Eigen::Vector3d>> candidates;
  for (std::size_t k = 0; k < second.points.size(); ++k)
    if (second.points[k] == kNone) candidates.emplace_back(k, ray_of(second.frame.keypoints[k]));
  const Eigen::Matrix3d E = cross_matrix(T21.translation()) * T21.linear();
  for (std::size_t i = 0; i < first.points.size(); ++i) {
    const FrameKeypoint& f1 = first.frame.keypoints[i];
    if (first.points[i] != kNone || f1.depth_m > 0) continue;
    const Eigen::Vector3d line = E * ray_of(f1);
    const double norm = std::hypot(line.x() / model.camera.fx, line.y() / model.camera.fy);
    NearestDescriptor nearest;
    for (const auto& [k, ray2] : candidates) {
      const FrameKeypoint& f2 = second.frame.keypoints[k];
      if (second.points[k] == kNone &&
          std::abs(line.dot(ray2)) <= 2 * norm * model.noise.sigma_px * f2.scale)
        nearest.try_one(static_cast<int>(k),
                        hamming_distance(first.frame.descriptors[i], second.frame.descriptors[k]));
    }
    if (!nearest.within({40, 0.8})) continue;
    const FrameKeypoint& f2 = second.frame.keypoints[static_cast<std::size_t>(nearest.index)];
    const auto p = nearest_to_rays(ray_of(f1), ray_of(f2), T21);
    if (!p || !agrees(model, f1, *p, 3) || !agrees(model, f2, T21 * *p, 3)) continue;
    MapPoint& point =
        map.add_point(first.T_camera_world.inverse() * *p, first, static_cast<int>(i));
    map.observe(point, second, nearest.index);
    map.refresh(point);
    created.push_back(point.id);
  }
  return created;
}

}  // namespace stillpoint::rgbd_slam
