// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cstddef>
#include <map>
#include <vector>

#include "stillpoint/backends/rgbd_slam/map.hpp"
#include "stillpoint/backends/rgbd_slam/tracked_frame.hpp"

namespace stillpoint::rgbd_slam {

/// Looks for points in a keyframe that does not see them yet. A keypoint that fits takes the point
/// on; one that has a point already merges both, into the one with more observations (or always
/// into the given one with `keep_given`). O(points).
inline void fuse_points(const CameraModel& model, Map& map, Keyframe& keyframe,
                        const std::vector<PointId>& points, double radius_px, bool keep_given) {
  const std::vector<PointId> none_taken(keyframe.frame.size());
  std::vector<std::size_t> scratch;
  for (const PointId id : points) {
    MapPoint* p = map.point(id);
    if (!p || Map::observed_by(*p, keyframe.id)) continue;
    const auto projection = project(model, keyframe.frame, *p, keyframe.T_camera_world);
    if (!projection) continue;
    const double scale = std::pow(model.scale_factor, std::clamp(projection->octave, 0, 6));
    const auto k = match_at(keyframe.frame, *projection, radius_px * scale, p->descriptor,
                            {50, 1.0}, none_taken, scratch);
    if (!k) continue;
    // Where poses agree, so must the keypoint.
    if (!keep_given &&
        !agrees(model, keyframe.frame.keypoints[*k], keyframe.T_camera_world * p->position, 4))
      continue;
    const PointId other = keyframe.points[*k];
    if (const MapPoint* o = map.point(other)) {
      if (!keep_given && o->observations.size() > p->observations.size())
        map.replace_point(id, other);
      else
        map.replace_point(other, id);
    } else {
      map.observe(*p, keyframe, *k);
    }
  }
}

/// Moves keyframes to new poses; those that are not named move with their parent, points with their
/// reference keyframe. O(map).
inline void move_map(Map& map, const std::map<KeyframeId, Eigen::Isometry3d>& poses) {
  std::vector<Eigen::Isometry3d> step(map.keyframe_end(), Eigen::Isometry3d::Identity());
  // Parents are older than their children. step = T_world'_camera T_camera_world: moves points.
  for (const KeyframeId id : map.keyframe_ids()) {
    Keyframe* k = map.keyframe(id);
    const auto named = poses.find(id);
    if (named != poses.end()) {
      if (named->second.matrix() == k->T_camera_world.matrix()) continue;
      step[id.index()] = named->second.inverse() * k->T_camera_world;
      k->T_camera_world = named->second;
    } else if (k->parent) {
      step[id.index()] = step[k->parent.index()];
      k->T_camera_world = k->T_camera_world * step[id.index()].inverse();
    }
  }
  for (const PointId id : map.point_ids()) {
    MapPoint* p = map.point(id);
    p->position = step[p->reference.index()] * p->position;
  }
}

}  // namespace stillpoint::rgbd_slam
