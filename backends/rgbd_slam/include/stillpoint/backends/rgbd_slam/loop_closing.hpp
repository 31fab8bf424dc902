// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <atomic>
#include <cstddef>
#include <map>
#include <mutex>
#include <set>
#include <vector>

#include "stillpoint/backends/rgbd_slam/fair_mutex.hpp"
#include "stillpoint/backends/rgbd_slam/local_map.hpp"
#include "stillpoint/backends/rgbd_slam/map_changes.hpp"
#include "stillpoint/backends/rgbd_slam/place_index.hpp"
#include "stillpoint/backends/rgbd_slam/pose_graph.hpp"
#include "stillpoint/backends/rgbd_slam/relocalizer.hpp"
#include "stillpoint/core/rigid_motion.hpp"

namespace stillpoint::rgbd_slam {

/// Notices that the camera is back at a known place, and removes the drift since it was there.
///
/// A keyframe votes for places by its descriptors; a place that is not its neighbor anyway is
/// verified by pose (PnP, guided matching), and by the keyframe's neighbors, which must find it too
/// when moved along. Then the essential graph (spanning tree, loops, strong covisibility) is
/// optimised, the points of both sides are fused, and the map is adjusted as a whole.
class LoopClosing {
 public:
  struct Settings {
    bool enabled = true;
    /// Votes that a place needs, also as a share of the best neighbor's.
    int min_votes = 15;
    double min_vote_share = 0.2;
    /// Matches that must agree with one pose.
    int min_inliers = 40;
    /// Keyframes between two closed loops.
    std::size_t min_gap = 8;
    /// Points shared by two keyframes that make an edge of the essential graph.
    int strong_covisibility = 80;
    /// Iterations of the bundle adjustment of all keyframes that follows; 6 s for 400.
    int bundle_iterations = 5;
  };

  LoopClosing(const CameraModel& model, const Settings& settings)
      : model_(model), settings_(settings) {}

  /// Enters a keyframe into the index and closes a loop if it sees one. Only tracking may work on
  /// the map meanwhile; `lock` is the map's. With `stop` set the adjustment is cut short.
  void process(Map& map, FairMutex& lock, PlaceIndex& index, KeyframeId id,
               const std::atomic<bool>& stop) {
    std::vector<KeyframeId> candidates;
    {
      const std::lock_guard<FairMutex> guard(lock);
      const std::vector<Descriptor> descriptors = place_descriptors(*map.keyframe(id));
      if (settings_.enabled &&
          (!last_loop_ || id.index() - last_loop_.index() >= settings_.min_gap))
        candidates = find_candidates(map, index.query(descriptors), id);
      index.add(id, descriptors);
    }
    for (const KeyframeId place : candidates) {
      TrackedFrame found;
      {
        // One at a time: each takes about 10 ms, and tracking may wait.
        const std::lock_guard<FairMutex> guard(lock);
        found = TrackedFrame(map.keyframe(id)->frame);
        if (find_pose_at_place(model_, map, place, settings_.min_inliers, found) == 0 ||
            !neighbors_agree(map, *map.keyframe(id), place, found.T_camera_world))
          continue;
      }
      if (!close(map, lock, id, place, found)) continue;
      adjust_keyframes(map, lock, model_, {}, settings_.bundle_iterations, &stop);
      last_loop_ = id;
      ++closed_;
      return;
    }
  }

  int closed() const { return closed_; }

 private:
  // Places that look like the keyframe and are not linked to it, most alike first.
  std::vector<KeyframeId> find_candidates(const Map& map,
                                          const std::vector<PlaceIndex::Vote>& votes,
                                          KeyframeId id) const {
    const Keyframe& k = *map.keyframe(id);
    // Neighbors, and their neighbors: places that the map links already.
    std::set<KeyframeId> linked{id};
    for (const auto& [n, shared] : k.covisible) {
      linked.insert(n);
      for (const auto& [second, shared_by_both] : map.keyframe(n)->covisible) linked.insert(second);
    }
    int best_neighbor = 0;
    for (const PlaceIndex::Vote& v : votes)
      if (k.covisible.count(v.place)) best_neighbor = std::max(best_neighbor, v.votes);
    const int needed =
        std::max(settings_.min_votes, static_cast<int>(settings_.min_vote_share * best_neighbor));
    std::vector<KeyframeId> candidates;
    for (const PlaceIndex::Vote& v : votes) {
      if (v.votes < needed || candidates.size() == 3) break;
      if (!linked.count(v.place) && map.keyframe(v.place)) candidates.push_back(v.place);
    }
    return candidates;
  }

  // Moved along with the keyframe, its neighbors must find the place's points too.
  bool neighbors_agree(const Map& map, const Keyframe& k, KeyframeId place,
                       const Eigen::Isometry3d& T_camera_world) const {
    const LocalMap local = gather_local_map(map, map.keyframe(place)->points, 20);
    int asked = 0, agreeing = 0;
    for (const KeyframeId n : map.neighbors(k.id, 4)) {
      const Keyframe& neighbor = *map.keyframe(n);
      TrackedFrame f(neighbor.frame);
      const Eigen::Isometry3d expected =
          neighbor.T_camera_world * k.T_camera_world.inverse() * T_camera_world;
      f.T_camera_world = expected;
      match_projections(model_, map, local.points, 8, f);
      const int inliers = refine_pose(model_, map, f);
      const Eigen::Isometry3d off = f.T_camera_world * expected.inverse();
      ++asked;
      agreeing += inliers >= settings_.min_inliers / 2 && off.translation().norm() < 0.1 &&
                  stillpoint::detail::rotation_angle(off.linear()) < 0.05;
    }
    return 2 * agreeing >= asked;
  }

  // Bends the map so that the keyframe stands where it was found at the place, and fuses the points
  // of both sides; false if nothing can be bent.
  bool close(Map& map, FairMutex& lock, KeyframeId id, KeyframeId place,
             const TrackedFrame& found) const {
    std::vector<PoseGraphEdge> edges;
    std::map<KeyframeId, Eigen::Isometry3d> poses;
    {
      const std::lock_guard<FairMutex> guard(lock);
      edges = essential_graph(map);
      edges.push_back(
          {id, place, found.T_camera_world * map.keyframe(place)->T_camera_world.inverse()});
      poses = map.poses();
    }
    if (!optimize_pose_graph(poses, edges, poses.begin()->first)) return false;
    const std::lock_guard<FairMutex> guard(lock);
    move_map(map, poses);
    const std::vector<PointId> place_points =
        gather_local_map(map, map.keyframe(place)->points, 20).points;
    Keyframe& k = *map.keyframe(id);
    for (std::size_t i = 0; i < found.points.size(); ++i) {
      MapPoint* p = map.point(found.points[i]);
      if (!p || Map::observed_by(*p, id)) continue;
      if (k.points[i])
        map.replace_point(k.points[i], p->id);
      else
        map.observe(*p, k, i);
    }
    std::vector<KeyframeId> group = map.neighbors(id);
    group.push_back(id);
    for (const KeyframeId g : group)
      fuse_points(model_, map, *map.keyframe(g), place_points, 4, true);
    for (const KeyframeId g : group) map.update_connections(g);
    k.loop_edges.insert(place);
    map.keyframe(place)->loop_edges.insert(id);
    return true;
  }

  // The poses of linked keyframes relative to each other, as they are.
  std::vector<PoseGraphEdge> essential_graph(const Map& map) const {
    std::vector<PoseGraphEdge> edges;
    for (const KeyframeId id : map.keyframe_ids()) {
      const Keyframe& k = *map.keyframe(id);
      const auto add = [&](KeyframeId earlier) {
        const Eigen::Isometry3d& T = map.keyframe(earlier)->T_camera_world;
        edges.push_back({id, earlier, k.T_camera_world * T.inverse()});
      };
      if (k.parent) add(k.parent);
      for (const KeyframeId other : k.loop_edges)
        if (other < id) add(other);
      for (const auto& [other, shared] : k.covisible)
        if (other < id && other != k.parent && shared >= settings_.strong_covisibility) add(other);
    }
    return edges;
  }

  CameraModel model_;
  Settings settings_;
  KeyframeId last_loop_;
  std::atomic<int> closed_{0};
};

}  // namespace stillpoint::rgbd_slam
