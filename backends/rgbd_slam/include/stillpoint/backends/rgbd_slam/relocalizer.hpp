// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cstddef>
#include <optional>
#include <vector>

#include "stillpoint/backends/rgbd_slam/local_map.hpp"
#include "stillpoint/backends/rgbd_slam/place_index.hpp"
#include "stillpoint/backends/rgbd_slam/pnp.hpp"
#include "stillpoint/backends/rgbd_slam/tracked_frame.hpp"

namespace stillpoint::rgbd_slam {

/// Descriptors of the keypoints that show a map point: what a keyframe is recognised by.
inline std::vector<Descriptor> place_descriptors(const Keyframe& keyframe) {
  std::vector<Descriptor> descriptors;
  for (std::size_t i = 0; i < keyframe.points.size(); ++i)
    if (keyframe.points[i]) descriptors.push_back(keyframe.frame.descriptors[i]);
  return descriptors;
}

/// Matches a frame with the points around a keyframe without any guess, and finds its pose there
/// (PnP in RANSAC, then guided matching). Leaves pose and matches in `f`, whose old matches are
/// dropped. Returns the number of matches that agree, 0 for failure. Costs about 10 ms.
inline int find_pose_at_place(const CameraModel& model, const Map& map, KeyframeId place,
                              int min_inliers, TrackedFrame& f) {
  std::vector<KeyframeId> around = map.neighbors(place, 4);
  around.push_back(place);
  const std::vector<PointId> ids = map.points_of(around);
  std::vector<Descriptor> known;
  known.reserve(ids.size());
  for (const PointId id : ids) known.push_back(map.point(id)->descriptor);

  std::vector<PoseObservation> observations;
  for (const auto& [keypoint, known_index] : match_all(f.frame.descriptors, known, {60, 0.9}))
    observations.push_back(pose_observation(model, f.frame.keypoints[keypoint], keypoint,
                                            map.point(ids[known_index])->position));
  const auto T =
      solve_pnp_ransac(model.camera, model.noise, observations, std::max(8, min_inliers / 2));
  if (!T) return 0;
  f.T_camera_world = *T;
  int inliers = 0;
  const LocalMap local = gather_local_map(map, map.keyframe(place)->points, 20);
  for (const double radius_px : {10.0, 4.0}) {
    f.points.assign(f.frame.size(), PointId());
    match_projections(model, map, local.points, radius_px, f);
    inliers = refine_pose(model, map, f);
    if (inliers < min_inliers) return 0;
  }
  return inliers;
}

/// Finds the frame's pose anywhere in the map. Returns the number of agreeing matches, 0 for
/// failure. Costs up to five times find_pose_at_place().
inline int relocalize(const CameraModel& model, const Map& map, const PlaceIndex& index,
                      int min_inliers, TrackedFrame& f) {
  int tried = 0;
  for (const PlaceIndex::Vote& vote : index.query(f.frame.descriptors)) {
    if (vote.votes < 8 || tried == 5) break;
    if (!map.keyframe(vote.place)) continue;
    ++tried;
    if (const int inliers = find_pose_at_place(model, map, vote.place, min_inliers, f))
      return inliers;
  }
  return 0;
}

}  // namespace stillpoint::rgbd_slam
