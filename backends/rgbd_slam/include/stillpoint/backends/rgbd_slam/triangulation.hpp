// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <cstddef>
#include <vector>

#include "stillpoint/backends/rgbd_slam/map.hpp"
#include "stillpoint/backends/rgbd_slam/tracked_frame.hpp"

namespace stillpoint::rgbd_slam {

/// Makes points of keypoints without depth that two keyframes see from different places.
///
/// Keypoints without a point are matched by descriptor near the other's epipolar line,
/// triangulated, and taken when both rays agree: parallax over about a degree, before both cameras,
/// reprojection within the noise. Returns the new points. O(free keypoints squared).
inline std::vector<PointId> triangulate_between(const Optics& optics, Map& map, Keyframe& first,
                                                Keyframe& second) {
  std::vector<PointId> created;
  const Eigen::Isometry3d T21 = second.T_camera_world * first.T_camera_world.inverse();
  const Eigen::Vector3d baseline = T21.inverse().translation();  // of the second, in the first
  if (baseline.norm() < 0.02) return created;
  const Camera& c = optics.camera;
  struct Free {
    int keypoint;
    Eigen::Vector3d ray;
  };
  std::vector<Free> candidates;
  for (std::size_t k = 0; k < second.points.size(); ++k) {
    const FrameKeypoint& f = second.frame.keypoints[k];
    if (second.points[k] == kNone)
      candidates.push_back({static_cast<int>(k), c.unproject(f.x, f.y, 1)});
  }
  Eigen::Matrix3d cross;
  const Eigen::Vector3d t = T21.translation();
  cross << 0, -t.z(), t.y(), t.z(), 0, -t.x(), -t.y(), t.x(), 0;
  const Eigen::Matrix3d E = cross * T21.linear();
  std::vector<char> used(second.points.size(), 0);
  const auto misses = [&](const Eigen::Vector3d& p, const FrameKeypoint& f) {
    const double sigma_px = optics.noise.sigma_px * f.scale;
    if (p.z() < 0.2 || (c.project(p) - f.pixel()).squaredNorm() > 5.991 * sigma_px * sigma_px)
      return true;
    return f.depth_m > 0 && std::abs(1 / p.z() - 1 / f.depth_m) >
                                3 * optics.noise.sigma_inverse_depth(1 / f.depth_m);
  };
  for (std::size_t i = 0; i < first.points.size(); ++i) {
    const FrameKeypoint& f1 = first.frame.keypoints[i];
    if (first.points[i] != kNone || f1.depth_m > 0) continue;
    const Eigen::Vector3d ray1 = c.unproject(f1.x, f1.y, 1);
    const Eigen::Vector3d line = E * ray1;
    const double norm = std::hypot(line.x() / c.fx, line.y() / c.fy);
    int best = -1, best_distance = 51, second_distance = 257;
    Eigen::Vector3d best_ray;
    for (const Free& candidate : candidates) {
      const auto k = static_cast<std::size_t>(candidate.keypoint);
      const FrameKeypoint& f2 = second.frame.keypoints[k];
      if (used[k] ||
          std::abs(line.dot(candidate.ray)) > 2 * norm * optics.noise.sigma_px * f2.scale)
        continue;
      const int distance =
          hamming_distance(first.frame.descriptors[i], second.frame.descriptors[k]);
      if (distance < best_distance)
        second_distance = best_distance, best_distance = distance, best = candidate.keypoint,
        best_ray = candidate.ray;
      else if (distance < second_distance)
        second_distance = distance;
    }
    if (best < 0 || best_distance > 0.8 * second_distance) continue;
    // The point nearest to both rays, in the first camera.
    const Eigen::Vector3d a = ray1.normalized();
    const Eigen::Vector3d b = (T21.linear().transpose() * best_ray).normalized();
    const double cosine = a.dot(b), determinant = 1 - cosine * cosine;
    if (determinant < 3e-4) continue;  // about one degree
    const double s = (a.dot(baseline) - cosine * b.dot(baseline)) / determinant;
    const double u = (cosine * a.dot(baseline) - b.dot(baseline)) / determinant;
    const Eigen::Vector3d p = (s * a + baseline + u * b) / 2;
    if (misses(p, f1) || misses(T21 * p, second.frame.keypoints[static_cast<std::size_t>(best)]))
      continue;
    used[static_cast<std::size_t>(best)] = 1;
    MapPoint& point = map.add_point(first.T_camera_world.inverse() * p, first, static_cast<int>(i));
    map.observe(point, second, best);
    map.refresh(point);
    created.push_back(point.id);
  }
  return created;
}

}  // namespace stillpoint::rgbd_slam
