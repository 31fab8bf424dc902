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
#include "stillpoint/backends/rgbd_slam/local_map.hpp"
#include "stillpoint/backends/rgbd_slam/map_changes.hpp"
#include "stillpoint/backends/rgbd_slam/place_index.hpp"
#include "stillpoint/backends/rgbd_slam/pose_graph.hpp"
#include "stillpoint/backends/rgbd_slam/relocalizer.hpp"
#include "stillpoint/backends/rgbd_slam/threads.hpp"

namespace stillpoint::rgbd_slam {

/// Notices that the camera is back at a known place, and removes the drift since it was there.
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

  LoopClosing(const CameraModel& model, const Settings& settings)
      : model_(model), settings_(settings) {}

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
      bundle = collect_bundle(map, model_, map.keyframe_ids());
    }
    if (!solve_bundle(bundle, model_, settings_.bundle_iterations, nullptr, true)) return;
    const std::lock_guard<std::mutex> no_mapping(mapping_lock);
    const std::lock_guard<FairMutex> guard(lock);
    apply_bundle(map, bundle, true);
  }

 private:
  using Poses = std::map<KeyframeId, Eigen::Isometry3d>;
  using Links = std::map<KeyframeId, std::map<KeyframeId, int>>;
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
    if (find_pose_at_place(model_, map, place, settings_.min_inliers, f) == 0 ||
        !neighbors_agree(map, *k, place, f.T_camera_world))
      return {};
    return {place, f.T_camera_world, f.points};
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
                  Eigen::AngleAxisd(off.linear()).angle() < 0.05;
    }
    return 2 * agreeing >= asked;
  }

  // Moves the keyframe's surroundings onto the place, and the keyframes between with them. If it
  // fails half-way, the keyframes go back to where they were: the map is not torn.
  bool correct(Map& map, FairMutex& lock, KeyframeId id, const Loop& loop) {
    Poses before, poses;
    std::vector<PoseGraphEdge> edges;
    try {
      {
        const std::lock_guard<FairMutex> guard(lock);
        if (!map.keyframe(id) || !map.keyframe(loop.place)) return false;
        Links links_before;
        for (const KeyframeId i : map.keyframe_ids()) {
          before[i] = map.keyframe(i)->T_camera_world;
          links_before[i] = map.keyframe(i)->covisible;
        }
        std::vector<KeyframeId> group = map.neighbors(id);
        group.push_back(id);
        join(map, group, id, loop);
        edges = essential_graph(map, before, links_before, group);
        for (const auto& entry : before)
          poses[entry.first] = map.keyframe(entry.first)->T_camera_world;
      }
      // The map's first keyframe, its origin, is never removed.
      if (!optimize_pose_graph(poses, edges, poses.begin()->first)) return false;
      const std::lock_guard<FairMutex> guard(lock);
      move_map(map, poses);
      return true;
    } catch (...) {
      const std::lock_guard<FairMutex> guard(lock);
      move_map(map, before);
      throw;
    }
  }

  // Moves the keyframe's surroundings onto the place and fuses the points of both sides.
  void join(Map& map, const std::vector<KeyframeId>& group, KeyframeId id, const Loop& loop) {
    const Eigen::Isometry3d step =
        loop.T_camera_world.inverse() * map.keyframe(id)->T_camera_world;  // moves points
    const std::vector<PointId> place_points =
        gather_local_map(map, map.keyframe(loop.place)->points, 20).points;
    const std::set<PointId> stay(place_points.begin(), place_points.end());
    for (const PointId p : map.points_of(group))
      if (!stay.count(p)) map.point(p)->position = step * map.point(p)->position;
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
      fuse_points(model_, map, *map.keyframe(g), place_points, 4, true);
    for (const KeyframeId g : group) map.update_connections(g);
    k.loop_edges.insert(loop.place);
    map.keyframe(loop.place)->loop_edges.insert(id);
  }

  // The edges that must fit when the map is bent: new links across the loop as the poses are now,
  // all others as they were.
  std::vector<PoseGraphEdge> essential_graph(const Map& map, const Poses& before,
                                             const Links& links_before,
                                             const std::vector<KeyframeId>& group) const {
    std::vector<PoseGraphEdge> edges;
    std::set<std::pair<KeyframeId, KeyframeId>> listed;
    const auto add = [&](KeyframeId a, KeyframeId b, const auto& pose_of) {
      if (listed.insert(std::minmax(a, b)).second)
        edges.push_back({a, b, pose_of(a) * pose_of(b).inverse()});
    };
    const auto now = [&](KeyframeId id) { return map.keyframe(id)->T_camera_world; };
    const auto then = [&](KeyframeId id) { return before.at(id); };
    const std::set<KeyframeId> in_group(group.begin(), group.end());
    for (const KeyframeId g : group) {
      const Keyframe& k = *map.keyframe(g);
      const std::map<KeyframeId, int>& linked = links_before.at(g);
      for (const auto& [other, shared] : k.covisible)
        if (!in_group.count(other) && !linked.count(other) &&
            (shared >= settings_.strong_covisibility || k.loop_edges.count(other)))
          add(g, other, now);
      for (const KeyframeId other : k.loop_edges)
        if (!linked.count(other)) add(g, other, now);
    }
    for (const auto& [id, T] : before) {
      const Keyframe& k = *map.keyframe(id);
      if (k.parent != kNone) add(id, k.parent, then);
      for (const KeyframeId other : k.loop_edges)
        if (before.count(other)) add(id, other, then);
      for (const auto& [other, shared] : links_before.at(id))
        if (shared >= settings_.strong_covisibility) add(id, other, then);
    }
    return edges;
  }

  CameraModel model_;
  Settings settings_;
  KeyframeId last_loop_ = -1000;
  std::atomic<int> closed_{0};
};

}  // namespace stillpoint::rgbd_slam
