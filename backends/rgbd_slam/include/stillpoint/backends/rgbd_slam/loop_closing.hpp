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

#include "stillpoint/backends/rgbd_slam/bundle_adjustment.hpp"
#include "stillpoint/backends/rgbd_slam/fair_mutex.hpp"
#include "stillpoint/backends/rgbd_slam/local_map.hpp"
#include "stillpoint/backends/rgbd_slam/map_changes.hpp"
#include "stillpoint/backends/rgbd_slam/place_index.hpp"
#include "stillpoint/backends/rgbd_slam/pose_graph.hpp"
#include "stillpoint/backends/rgbd_slam/relocalizer.hpp"

namespace stillpoint::rgbd_slam {

/// Notices that the camera is back at a known place, and takes out the drift of the way between.
///
/// A keyframe votes for places by its descriptors; a place that is not its neighbor anyway is
/// verified by pose (PnP, guided matching), and by the keyframe's neighbors, which must find it too
/// when moved along. Then both sides are fused, the essential graph (spanning tree, loops, strong
/// covisibility) is optimised, and everything is adjusted once more.
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
    int min_gap = 8;
    /// Points shared by two keyframes that make an edge of the essential graph.
    int strong_covisibility = 80;
    int bundle_iterations = 15;
  };

  LoopClosing(const Optics& optics, const Settings& settings)
      : optics_(optics), settings_(settings) {}

  /// Enters a keyframe into the index and closes a loop if it sees one. `mapping_lock` keeps local
  /// mapping out while the map is corrected; `lock` is the map's. Returns true if one was closed.
  bool process(Map& map, std::mutex& mapping_lock, FairMutex& lock, PlaceIndex& index,
               KeyframeId id) {
    std::vector<KeyframeId> candidates;
    {
      const std::lock_guard<FairMutex> guard(lock);
      if (!map.keyframe(id)) return false;
      const std::vector<Descriptor> descriptors = place_descriptors(*map.keyframe(id));
      if (settings_.enabled && id - last_loop_ >= settings_.min_gap)
        candidates = find_candidates(map, index.query(descriptors), id);
      index.add(id, descriptors);
    }
    Loop loop;
    for (const KeyframeId place : candidates) {
      // One at a time: each takes about 10 ms, and tracking may wait.
      const std::lock_guard<FairMutex> guard(lock);
      loop = confirm(map, id, place);
      if (loop.place != kNone) break;
    }
    if (loop.place == kNone) return false;
    {
      const std::lock_guard<std::mutex> no_mapping(mapping_lock);
      if (!correct(map, lock, id, loop)) return false;
    }
    last_loop_ = id;
    ++closed_;
    adjust_all(map, mapping_lock, lock);
    return true;
  }

  int closed() const { return closed_; }
  void reset() { last_loop_ = -1000; }

  /// Adjusts all keyframes and points at once (full bundle adjustment).
  void adjust_all(Map& map, std::mutex& mapping_lock, FairMutex& lock) {
    BundleProblem bundle;
    {
      const std::lock_guard<FairMutex> guard(lock);
      std::vector<KeyframeId> all;
      for (int i = 0; i < map.keyframe_end(); ++i)
        if (map.keyframe(i)) all.push_back(i);
      bundle = collect_bundle(map, optics_, all);
    }
    if (!solve_bundle(bundle, optics_, settings_.bundle_iterations, nullptr, true)) return;
    const std::lock_guard<std::mutex> no_mapping(mapping_lock);
    const std::lock_guard<FairMutex> guard(lock);
    apply_global_bundle(map, bundle);
  }

 private:
  struct Loop {
    KeyframeId place = kNone;
    Eigen::Isometry3d T_camera_world = Eigen::Isometry3d::Identity();
    std::vector<PointId> points;  // per keypoint of the keyframe
  };

  // Places that look like the keyframe and are not linked to it, most alike first.
  std::vector<KeyframeId> find_candidates(const Map& map,
                                          const std::vector<PlaceIndex::Vote>& votes,
                                          KeyframeId id) const {
    const Keyframe& k = *map.keyframe(id);
    // Neighbors, and their neighbors: places that the map links already.
    std::set<KeyframeId> linked{id};
    int best_neighbor = 0;
    for (const auto& [n, shared] : k.covisible) {
      linked.insert(n);
      for (const auto& [second, shared_by_both] : map.keyframe(n)->covisible) linked.insert(second);
    }
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

  // The loop from the keyframe to the place, if its points and its neighbors agree. Either keyframe
  // may have been culled meanwhile.
  Loop confirm(const Map& map, KeyframeId id, KeyframeId place) const {
    const Keyframe* k = map.keyframe(id);
    if (!k || !map.keyframe(place)) return {};
    TrackedFrame f(k->frame);
    if (find_pose_at_place(optics_, map, place, settings_.min_inliers, f) == 0 ||
        !neighbors_agree(map, *k, place, f.T_camera_world))
      return {};
    return {place, f.T_camera_world, f.points};
  }

  // Moved along with the keyframe, its neighbors must find the place's points too.
  bool neighbors_agree(const Map& map, const Keyframe& k, KeyframeId place,
                       const Eigen::Isometry3d& T_camera_world) const {
    std::vector<PointId> seen;
    for (const PointId p : map.keyframe(place)->points)
      if (p != kNone) seen.push_back(p);
    const LocalMap local = gather_local_map(map, seen, 20);
    int asked = 0, agreeing = 0;
    for (const KeyframeId n : map.neighbors(k.id, 4)) {
      const Keyframe& neighbor = *map.keyframe(n);
      TrackedFrame f(neighbor.frame);
      const Eigen::Isometry3d expected =
          neighbor.T_camera_world * k.T_camera_world.inverse() * T_camera_world;
      f.T_camera_world = expected;
      match_projections(optics_, map, local.points, 8, MatchLimits(), f);
      const int inliers = refine_pose(optics_, map, f);
      const Eigen::Isometry3d off = f.T_camera_world * expected.inverse();
      ++asked;
      agreeing += inliers >= settings_.min_inliers / 2 && off.translation().norm() < 0.1 &&
                  Eigen::AngleAxisd(off.linear()).angle() < 0.05;
    }
    return 2 * agreeing >= asked;
  }

  // Moves the keyframe's surroundings onto the place, and the way between after them. If it fails
  // half-way, the keyframes go back to where they were: the map is not torn.
  bool correct(Map& map, FairMutex& lock, KeyframeId id, const Loop& loop) {
    std::map<KeyframeId, Eigen::Isometry3d> before;
    try {
      return correct(map, lock, id, loop, before);
    } catch (...) {
      const std::lock_guard<FairMutex> guard(lock);
      move_map(map, before);
      throw;
    }
  }

  // `before` takes the keyframes' poses as they were.
  bool correct(Map& map, FairMutex& lock, KeyframeId id, const Loop& loop,
               std::map<KeyframeId, Eigen::Isometry3d>& before) {
    std::map<KeyframeId, Eigen::Isometry3d> poses;
    std::vector<PoseGraphEdge> edges;
    KeyframeId origin = kNone;
    {
      const std::lock_guard<FairMutex> guard(lock);
      if (!map.keyframe(id) || !map.keyframe(loop.place)) return false;
      std::map<KeyframeId, std::map<KeyframeId, int>> linked_before;
      for (int i = 0; i < map.keyframe_end(); ++i)
        if (const Keyframe* k = map.keyframe(i)) {
          before[i] = k->T_camera_world;
          linked_before[i] = k->covisible;
        }
      std::vector<KeyframeId> group = map.neighbors(id);
      group.push_back(id);
      join(map, group, id, loop);
      edges = essential_graph(map, before, linked_before, group);
      for (const auto& entry : before) {
        poses[entry.first] = map.keyframe(entry.first)->T_camera_world;
        if (map.keyframe(entry.first)->parent == kNone && origin == kNone) origin = entry.first;
      }
    }
    if (!optimize_pose_graph(poses, edges, origin)) return false;
    const std::lock_guard<FairMutex> guard(lock);
    move_map(map, poses);
    return true;
  }

  // Moves the keyframe's surroundings onto the place and fuses the points of both sides.
  void join(Map& map, const std::vector<KeyframeId>& group, KeyframeId id, const Loop& loop) {
    const Eigen::Isometry3d step =
        loop.T_camera_world.inverse() * map.keyframe(id)->T_camera_world;  // moves points
    std::vector<PointId> seen;
    for (const PointId p : map.keyframe(loop.place)->points)
      if (p != kNone) seen.push_back(p);
    const std::vector<PointId> place_points = gather_local_map(map, seen, 20).points;
    const std::set<PointId> stay(place_points.begin(), place_points.end());
    std::set<PointId> moved;
    for (const KeyframeId g : group)
      for (const PointId p : map.keyframe(g)->points)
        if (p != kNone && !stay.count(p)) moved.insert(p);
    for (const PointId p : moved) map.point(p)->position = step * map.point(p)->position;
    for (const KeyframeId g : group)
      map.keyframe(g)->T_camera_world = map.keyframe(g)->T_camera_world * step.inverse();
    Keyframe& k = *map.keyframe(id);
    for (std::size_t i = 0; i < loop.points.size(); ++i) {
      MapPoint* p = map.point(loop.points[i]);
      if (!p || Map::observed_by(*p, id)) continue;
      if (map.point(k.points[i]))
        map.replace_point(k.points[i], p->id);
      else
        map.observe(*p, k, static_cast<int>(i));
    }
    for (const KeyframeId g : group)
      fuse_points(optics_, map, *map.keyframe(g), place_points, 4, true);
    for (const KeyframeId g : group) map.update_connections(g);
    k.loop_edges.insert(loop.place);
    map.keyframe(loop.place)->loop_edges.insert(id);
  }

  std::vector<PoseGraphEdge> essential_graph(
      const Map& map, const std::map<KeyframeId, Eigen::Isometry3d>& before,
      const std::map<KeyframeId, std::map<KeyframeId, int>>& linked_before,
      const std::vector<KeyframeId>& group) const {
    std::vector<PoseGraphEdge> edges;
    std::set<std::pair<KeyframeId, KeyframeId>> listed;
    const std::set<KeyframeId> in_group(group.begin(), group.end());
    // New links across the loop hold the corrected poses; all others the poses as they were.
    for (const KeyframeId g : group) {
      const Keyframe& k = *map.keyframe(g);
      for (const auto& [other, shared] : k.covisible) {
        const bool known = in_group.count(other) || linked_before.at(g).count(other);
        const bool loop = k.loop_edges.count(other) && !linked_before.at(g).count(other);
        if (known || (shared < settings_.strong_covisibility && !loop)) continue;
        if (!listed.insert(std::minmax(g, other)).second) continue;
        edges.push_back(
            {g, other, k.T_camera_world * map.keyframe(other)->T_camera_world.inverse(), 1});
      }
      for (const KeyframeId other : k.loop_edges)
        if (!linked_before.at(g).count(other) && listed.insert(std::minmax(g, other)).second)
          edges.push_back(
              {g, other, k.T_camera_world * map.keyframe(other)->T_camera_world.inverse(), 1});
    }
    const auto add = [&](KeyframeId a, KeyframeId b) {
      if (b == kNone || !before.count(b) || !listed.insert(std::minmax(a, b)).second) return;
      edges.push_back({a, b, before.at(a) * before.at(b).inverse(), 1});
    };
    for (const auto& [id, T] : before) {
      const Keyframe& k = *map.keyframe(id);
      add(id, k.parent);
      for (const KeyframeId other : k.loop_edges) add(id, other);
      for (const auto& [other, shared] : linked_before.at(id))
        if (shared >= settings_.strong_covisibility) add(id, other);
    }
    return edges;
  }

  Optics optics_;
  Settings settings_;
  KeyframeId last_loop_ = -1000;
  std::atomic<int> closed_{0};
};

}  // namespace stillpoint::rgbd_slam
