// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cstddef>
#include <map>
#include <vector>

#include "stillpoint/backends/rgbd_slam/bundle_adjustment.hpp"
#include "stillpoint/backends/rgbd_slam/map.hpp"
#include "stillpoint/backends/rgbd_slam/tracked_frame.hpp"

namespace stillpoint::rgbd_slam {

/// Looks for points in a keyframe that does not see them yet. A keypoint that fits takes the point
/// on; one that has a point already merges both, into the one with more observations (or always
/// into the given one with `keep_given`). Returns the number of points found. O(points).
inline int fuse_points(const Optics& optics, Map& map, Keyframe& keyframe,
                       const std::vector<PointId>& points, double radius_px, bool keep_given) {
  const std::vector<int> free(keyframe.frame.size(), kNone);
  std::vector<int> scratch;
  Projection projection;
  int fused = 0;
  for (const PointId id : points) {
    MapPoint* p = map.point(id);
    if (!p || Map::observed_by(*p, keyframe.id)) continue;
    if (!project(optics, keyframe.frame, *p, keyframe.T_camera_world, projection)) continue;
    const double scale = std::pow(optics.scale_factor, std::clamp(projection.octave, 0, 6));
    const int k = match_at(
        keyframe.frame,
        {projection.pixel, radius_px * scale, projection.octave - 1, projection.octave + 1},
        p->descriptor, {50, 1.0}, free, scratch);
    if (k < 0) continue;
    const FrameKeypoint& f = keyframe.frame.keypoints[static_cast<std::size_t>(k)];
    if (!keep_given) {
      // Poses agree here: so must the keypoint.
      const double sigma_px = optics.noise.sigma_px * f.scale;
      if ((f.pixel() - projection.pixel).squaredNorm() > 5.991 * sigma_px * sigma_px) continue;
      const double z = (keyframe.T_camera_world * p->position).z();
      if (f.depth_m > 0 &&
          std::abs(1 / z - 1 / f.depth_m) > 4 * optics.noise.sigma_inverse_depth(1 / f.depth_m))
        continue;
    }
    const PointId other = keyframe.points[static_cast<std::size_t>(k)];
    if (const MapPoint* o = map.point(other)) {
      if (!keep_given && o->observations.size() > p->observations.size())
        map.replace_point(id, other);
      else
        map.replace_point(other, id);
    } else {
      map.observe(*p, keyframe, k);
    }
    ++fused;
  }
  return fused;
}

/// Moves keyframes to new poses and points to new places; keyframes that are not named move with
/// their parent, points that are not named with their reference keyframe. O(map).
inline void move_map(Map& map, const std::map<KeyframeId, Eigen::Isometry3d>& poses,
                     const std::map<PointId, Eigen::Vector3d>& points = {}) {
  std::vector<Eigen::Isometry3d> step(static_cast<std::size_t>(map.keyframe_end()),
                                      Eigen::Isometry3d::Identity());
  // Parents are older than their children. step = T_world'_camera T_camera_world: moves points.
  for (int id = 0; id < map.keyframe_end(); ++id) {
    Keyframe* k = map.keyframe(id);
    if (!k) continue;
    const auto named = poses.find(id);
    const auto i = static_cast<std::size_t>(id);
    if (named != poses.end()) {
      step[i] = named->second.inverse() * k->T_camera_world;
      k->T_camera_world = named->second;
    } else if (k->parent != kNone) {
      step[i] = step[static_cast<std::size_t>(k->parent)];
      k->T_camera_world = k->T_camera_world * step[i].inverse();
    }
  }
  for (int id = 0; id < map.point_end(); ++id) {
    MapPoint* p = map.point(id);
    if (!p) continue;
    const auto named = points.find(id);
    if (named != points.end())
      p->position = named->second;
    else
      p->position = step[static_cast<std::size_t>(p->reference)] * p->position;
  }
}

/// Writes a solved local problem back and takes back the observations that do not fit.
inline void apply_local_bundle(Map& map, const BundleProblem& b) {
  for (const PoseBlock& pose : b.poses)
    if (Keyframe* k = map.keyframe(pose.id); k && !pose.fixed) k->T_camera_world = pose.pose();
  for (const BundleProblem::Point& point : b.points)
    if (MapPoint* p = map.point(point.id)) p->position = {point.p[0], point.p[1], point.p[2]};
  for (const BundleProblem::Residual& r : b.residuals)
    if (!r.inlier) map.forget(b.points[r.point].id, b.poses[r.pose].id);
  for (const BundleProblem::Point& point : b.points)
    if (MapPoint* p = map.point(point.id)) map.refresh(*p);
}

/// Writes a solved problem over the whole map back; what came in meanwhile moves along.
inline void apply_global_bundle(Map& map, const BundleProblem& b) {
  std::map<KeyframeId, Eigen::Isometry3d> poses;
  std::map<PointId, Eigen::Vector3d> points;
  for (const PoseBlock& pose : b.poses) poses[pose.id] = pose.pose();
  for (const BundleProblem::Point& point : b.points)
    points[point.id] = {point.p[0], point.p[1], point.p[2]};
  move_map(map, poses, points);
  for (const BundleProblem::Residual& r : b.residuals)
    if (!r.inlier) map.forget(b.points[r.point].id, b.poses[r.pose].id);
  for (int id = 0; id < map.point_end(); ++id)
    if (MapPoint* p = map.point(id)) map.refresh(*p);
}

}  // namespace stillpoint::rgbd_slam
