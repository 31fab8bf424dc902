// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cstddef>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "stillpoint/backends/rgbd_slam/map_elements.hpp"

namespace stillpoint::rgbd_slam {

/// Keyframes, points, who sees whom. Knows no thread: the caller locks.
///
/// Identifiers are never used again; what was removed is found as nullptr. All walks are in order
/// of identifiers, so that the same calls give the same map.
class Map {
 public:
  /// Covisibility below so many shared points makes no edge (but the best one always does).
  static constexpr int kMinShared = 15;

  Keyframe* keyframe(KeyframeId id) { return at(keyframes_, id); }
  const Keyframe* keyframe(KeyframeId id) const { return at(keyframes_, id); }
  MapPoint* point(PointId id) { return at(points_, id); }
  const MapPoint* point(PointId id) const { return at(points_, id); }

  /// One past the largest identifier.
  std::size_t keyframe_end() const { return keyframes_.size(); }
  std::size_t point_end() const { return points_.size(); }
  /// Those that are alive, in ascending order. O(all).
  std::vector<KeyframeId> keyframe_ids() const { return ids_of<KeyframeId>(keyframes_); }
  std::vector<PointId> point_ids() const { return ids_of<PointId>(points_); }
  std::size_t keyframe_count() const { return keyframe_count_; }
  std::size_t point_count() const { return point_count_; }

  Keyframe& add_keyframe(KeypointFrame frame, const Eigen::Isometry3d& T_camera_world) {
    auto k = std::make_unique<Keyframe>();
    k->id = KeyframeId(keyframes_.size());
    k->T_camera_world = T_camera_world;
    k->points.resize(frame.size());
    k->frame = std::move(frame);
    keyframes_.push_back(std::move(k));
    culled_.emplace_back();
    ++keyframe_count_;
    return *keyframes_.back();
  }

  /// Adds a point first seen at a keypoint of a keyframe.
  MapPoint& add_point(const Eigen::Vector3d& position, Keyframe& keyframe, std::size_t keypoint) {
    auto p = std::make_unique<MapPoint>();
    p->id = PointId(points_.size());
    p->position = position;
    p->reference = p->first_keyframe = keyframe.id;
    points_.push_back(std::move(p));
    ++point_count_;
    MapPoint& added = *points_.back();
    observe(added, keyframe, keypoint);
    refresh(added);
    return added;
  }

  /// Notes that a keypoint shows a point; nothing happens if the keyframe sees it already.
  void observe(MapPoint& point, Keyframe& keyframe, std::size_t keypoint) {
    const auto place = find(point.observations, keyframe.id);
    if (place != point.observations.end() && place->keyframe == keyframe.id) return;
    point.observations.insert(place, Observation{keyframe.id, keypoint});
    keyframe.points[keypoint] = point.id;
  }

  static bool observed_by(const MapPoint& point, KeyframeId keyframe) {
    const auto place = find(point.observations, keyframe);
    return place != point.observations.end() && place->keyframe == keyframe;
  }

  /// Takes an observation back. A point that no depth and no second view holds goes with it.
  void forget(PointId point_id, KeyframeId keyframe_id) {
    MapPoint* p = point(point_id);
    if (!p || !observed_by(*p, keyframe_id)) return;
    const auto place = find(p->observations, keyframe_id);
    keyframe(keyframe_id)->points[place->keypoint] = PointId();
    p->observations.erase(place);
    if (p->observations.empty() ||
        (p->observations.size() == 1 && keypoint(p->observations[0]).depth_m <= 0))
      erase_point(point_id);
    else if (p->reference == keyframe_id)
      p->reference = p->observations.front().keyframe;
  }

  void erase_point(PointId id) {
    MapPoint* p = point(id);
    if (!p) return;
    for (const Observation& o : p->observations) keyframe(o.keyframe)->points[o.keypoint] = {};
    points_[id.index()].reset();
    --point_count_;
  }

  /// Merges point `from` into `to`: its observations, except where `to` is seen already.
  void replace_point(PointId from, PointId to) {
    MapPoint *f = point(from), *t = point(to);
    if (!f || !t || from == to) return;
    const std::vector<Observation> moved = f->observations;
    t->visible += f->visible, t->found += f->found;
    erase_point(from);
    for (const Observation& o : moved) observe(*t, *keyframe(o.keyframe), o.keypoint);
    refresh(*t);
  }

  /// Renews direction, scale and descriptor of a point from its observations. O(observations).
  void refresh(MapPoint& p) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const Observation& o : p.observations) {
      const Keyframe& k = *keyframe(o.keyframe);
      const Eigen::Vector3d ray = p.position - k.center();
      sum += ray.normalized();
      if (o.keyframe == p.reference)
        p.level0_distance_m = static_cast<float>(ray.norm() * keypoint(o).scale);
    }
    p.view_direction = sum.normalized();
    const Observation& oldest = p.observations.front();
    p.descriptor = keyframe(oldest.keyframe)->frame.descriptors[oldest.keypoint];
  }

  /// Recounts the covisibility of a keyframe, on both sides, and adds it to the spanning tree.
  void update_connections(KeyframeId id) {
    Keyframe& k = *keyframe(id);
    std::map<KeyframeId, int> shared = count_observers(k.points);
    shared.erase(id);
    const auto most = [&](const auto& asked) {
      KeyframeId best;
      for (const auto& [other, n] : shared)
        if (asked(other) && (!best || n > shared[best])) best = other;
      return best;
    };
    const KeyframeId best = most([](KeyframeId) { return true; });
    for (const auto& [other, n] : k.covisible) keyframe(other)->covisible.erase(id);
    k.covisible.clear();
    for (const auto& [other, n] : shared)
      if (n >= kMinShared || other == best) k.covisible[other] = keyframe(other)->covisible[id] = n;
    // Only an earlier keyframe can be the parent: so the tree has no circle.
    if (k.parent) return;
    k.parent = most([&](KeyframeId other) { return other < id; });
    for (std::size_t i = id.index(); !k.parent && i-- > 0;)
      if (keyframes_[i]) k.parent = KeyframeId(i);
  }

  /// How many of the points each keyframe sees.
  std::map<KeyframeId, int> count_observers(const std::vector<PointId>& points) const {
    std::map<KeyframeId, int> count;
    for (const PointId id : points)
      if (const MapPoint* p = point(id))
        for (const Observation& o : p->observations) ++count[o.keyframe];
    return count;
  }

  /// The keyframes with most points in common, best first; at most `max`.
  std::vector<KeyframeId> neighbors(KeyframeId id,
                                    std::size_t max = static_cast<std::size_t>(-1)) const {
    return most_first(keyframe(id)->covisible, max);
  }

  /// The keys of a count, those with most first; at most `max`.
  static std::vector<KeyframeId> most_first(const std::map<KeyframeId, int>& count,
                                            std::size_t max) {
    std::vector<std::pair<int, KeyframeId>> sorted;
    for (const auto& [id, n] : count) sorted.emplace_back(-n, id);
    std::sort(sorted.begin(), sorted.end());
    if (sorted.size() > max) sorted.resize(max);
    std::vector<KeyframeId> ids;
    for (const auto& entry : sorted) ids.push_back(entry.second);
    return ids;
  }

  /// Removes a keyframe; its children go to its parent, and its pose stays known relative to it.
  /// The first keyframe (the origin) is never removed. O(keyframes).
  void cull_keyframe(KeyframeId id) {
    Keyframe* k = keyframe(id);
    if (!k || !k->parent) return;
    for (const PointId point_id : std::vector<PointId>(k->points)) forget(point_id, id);
    for (const auto& [other, n] : k->covisible) keyframe(other)->covisible.erase(id);
    for (const auto& other : keyframes_)
      if (other && other->parent == id) other->parent = k->parent;
    culled_[id.index()] = {k->parent,
                           k->T_camera_world * keyframe(k->parent)->T_camera_world.inverse()};
    keyframes_[id.index()].reset();
    --keyframe_count_;
  }

  /// T_camera_world of a keyframe, also of one that was removed.
  Eigen::Isometry3d pose_of(KeyframeId id) const {
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    for (; !keyframe(id); id = culled_[id.index()].parent)
      T = T * culled_[id.index()].T_this_parent;
    return T * keyframe(id)->T_camera_world;
  }

  /// T_camera_world of all that are alive.
  std::map<KeyframeId, Eigen::Isometry3d> poses() const {
    std::map<KeyframeId, Eigen::Isometry3d> poses;
    for (const auto& k : keyframes_)
      if (k) poses[k->id] = k->T_camera_world;
    return poses;
  }

  /// The keypoint of an observation.
  const FrameKeypoint& keypoint(const Observation& o) const {
    return keyframe(o.keyframe)->frame.keypoints[o.keypoint];
  }

  /// The points that keyframes see, each once, in ascending order. O(n log n).
  std::vector<PointId> points_of(const std::vector<KeyframeId>& keyframes) const {
    std::vector<PointId> points;
    for (const KeyframeId k : keyframes)
      for (const PointId p : keyframe(k)->points)
        if (p) points.push_back(p);
    std::sort(points.begin(), points.end());
    points.erase(std::unique(points.begin(), points.end()), points.end());
    return points;
  }

 private:
  struct Culled {
    KeyframeId parent;
    Eigen::Isometry3d T_this_parent = Eigen::Isometry3d::Identity();
  };

  template <class T, class AnyId>
  static T* at(const std::vector<std::unique_ptr<T>>& all, AnyId id) {
    return id ? all[id.index()].get() : nullptr;
  }

  template <class AnyId, class T>
  static std::vector<AnyId> ids_of(const std::vector<std::unique_ptr<T>>& all) {
    std::vector<AnyId> ids;
    for (const auto& one : all)
      if (one) ids.push_back(one->id);
    return ids;
  }

  // The observation by the keyframe, or where it would stand.
  static std::vector<Observation>::const_iterator find(const std::vector<Observation>& observations,
                                                       KeyframeId keyframe) {
    return std::lower_bound(observations.begin(), observations.end(), keyframe,
                            [](const Observation& o, KeyframeId id) { return o.keyframe < id; });
  }

  std::vector<std::unique_ptr<Keyframe>> keyframes_;
  std::vector<Culled> culled_;
  std::vector<std::unique_ptr<MapPoint>> points_;
  std::size_t keyframe_count_ = 0, point_count_ = 0;
};

}  // namespace stillpoint::rgbd_slam
