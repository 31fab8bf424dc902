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
/// of identifiers, so that the same calls give the same map. A call that throws (memory) may be
/// done in part, but leaves no link to what is not there.
class Map {
 public:
  /// Covisibility below so many shared points makes no edge (but the best one always does).
  static constexpr int kMinShared = 15;

  Keyframe* keyframe(KeyframeId id) { return at(keyframes_, id); }
  const Keyframe* keyframe(KeyframeId id) const { return at(keyframes_, id); }
  MapPoint* point(PointId id) { return at(points_, id); }
  const MapPoint* point(PointId id) const { return at(points_, id); }

  /// One past the largest identifier.
  int keyframe_end() const { return static_cast<int>(keyframes_.size()); }
  int point_end() const { return static_cast<int>(points_.size()); }
  /// Those that are alive, in ascending order. O(all).
  std::vector<KeyframeId> keyframe_ids() const { return ids_of(keyframes_); }
  std::vector<PointId> point_ids() const { return ids_of(points_); }
  std::size_t keyframe_count() const { return keyframe_count_; }
  std::size_t point_count() const { return point_count_; }

  /// The point itself, or the one that it was merged into, or kNone.
  PointId resolve(PointId id) const {
    while (id != kNone && !point(id)) id = replaced_by_[static_cast<std::size_t>(id)];
    return id;
  }

  Keyframe& add_keyframe(KeypointFrame frame, const Eigen::Isometry3d& T_camera_world) {
    auto k = std::make_unique<Keyframe>();
    k->id = keyframe_end();
    k->T_camera_world = T_camera_world;
    k->points.assign(frame.size(), kNone);
    k->frame = std::move(frame);
    keyframes_.push_back(std::move(k));
    ++keyframe_count_;
    culled_.resize(keyframes_.size());  // by size: one that failed before is made up for
    return *keyframes_.back();
  }

  /// Adds a point first seen at a keypoint of a keyframe.
  MapPoint& add_point(const Eigen::Vector3d& position, Keyframe& keyframe, int keypoint) {
    auto p = std::make_unique<MapPoint>();
    p->id = point_end();
    p->position = position;
    p->reference = p->first_keyframe = keyframe.id;
    points_.push_back(std::move(p));
    ++point_count_;
    replaced_by_.resize(points_.size(), kNone);  // as in add_keyframe()
    MapPoint& added = *points_.back();
    observe(added, keyframe, keypoint);
    refresh(added);
    return added;
  }

  /// Notes that a keypoint shows a point; nothing happens if the keyframe sees it already.
  void observe(MapPoint& point, Keyframe& keyframe, int keypoint) {
    const auto place = find(point, keyframe.id);
    if (place != point.observations.end() && place->keyframe == keyframe.id) return;
    point.observations.insert(place, Observation{keyframe.id, keypoint});
    keyframe.points[static_cast<std::size_t>(keypoint)] = point.id;
  }

  static bool observed_by(const MapPoint& point, KeyframeId keyframe) {
    const auto place = find(const_cast<MapPoint&>(point), keyframe);
    return place != point.observations.end() && place->keyframe == keyframe;
  }

  /// Takes an observation back. A point that no depth and no second view holds goes with it.
  void forget(PointId point_id, KeyframeId keyframe_id) {
    MapPoint* p = point(point_id);
    if (!p) return;
    const auto place = find(*p, keyframe_id);
    if (place == p->observations.end() || place->keyframe != keyframe_id) return;
    if (Keyframe* k = keyframe(keyframe_id))
      k->points[static_cast<std::size_t>(place->keypoint)] = kNone;
    p->observations.erase(place);
    if (p->observations.empty() ||
        (p->observations.size() == 1 && keypoint(p->observations[0]).depth_m <= 0)) {
      erase_point(point_id);
    } else if (p->reference == keyframe_id) {
      p->reference = p->observations.front().keyframe;
    }
  }

  void erase_point(PointId id) {
    MapPoint* p = point(id);
    if (!p) return;
    for (const Observation& o : p->observations)
      if (Keyframe* k = keyframe(o.keyframe))
        k->points[static_cast<std::size_t>(o.keypoint)] = kNone;
    points_[static_cast<std::size_t>(id)].reset();
    --point_count_;
  }

  /// Merges point `from` into `to`: its observations, except where `to` is seen already.
  void replace_point(PointId from, PointId to) {
    MapPoint *f = point(from), *t = point(to);
    if (!f || !t || from == to) return;
    const std::vector<Observation> moved = f->observations;
    t->visible += f->visible, t->found += f->found;
    erase_point(from);
    replaced_by_[static_cast<std::size_t>(from)] = to;
    for (const Observation& o : moved)
      if (Keyframe* k = keyframe(o.keyframe)) observe(*t, *k, o.keypoint);
    refresh(*t);
  }

  /// Renews direction, scale and descriptor of a point from its observations. O(observations^2).
  void refresh(MapPoint& p) {
    if (p.observations.empty()) return;
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    std::vector<Descriptor> descriptors;
    for (const Observation& o : p.observations) {
      const Keyframe* k = keyframe(o.keyframe);
      sum += (p.position - k->center()).normalized();
      descriptors.push_back(k->frame.descriptors[static_cast<std::size_t>(o.keypoint)]);
    }
    p.view_direction = sum.normalized();
    p.descriptor = descriptors[most_typical_descriptor(descriptors)];
    for (const Observation& o : p.observations)
      if (o.keyframe == p.reference)
        p.scale =
            ScaleRange((p.position - keyframe(o.keyframe)->center()).norm(), keypoint(o).scale);
  }

  /// Recounts the covisibility of a keyframe, on both sides, and adds it to the spanning tree.
  void update_connections(KeyframeId id) {
    Keyframe& k = *keyframe(id);
    std::map<KeyframeId, int> shared;
    for (const PointId point_id : k.points)
      if (const MapPoint* p = point(point_id))
        for (const Observation& o : p->observations)
          if (o.keyframe != id) ++shared[o.keyframe];
    KeyframeId best = kNone;
    for (const auto& [other, n] : shared)
      if (best == kNone || n > shared[best]) best = other;
    for (const auto& [other, n] : k.covisible)
      if (Keyframe* o = keyframe(other)) o->covisible.erase(id);
    k.covisible.clear();
    for (const auto& [other, n] : shared) {
      if (n < kMinShared && other != best) continue;
      k.covisible[other] = n;
      try {
        keyframe(other)->covisible[id] = n;
      } catch (...) {  // both sides or none
        k.covisible.erase(other);
        throw;
      }
    }
    // Only an earlier keyframe can be the parent: so the tree has no circle.
    if (k.parent != kNone || id == 0) return;
    KeyframeId parent = kNone;
    for (const auto& [other, n] : shared)
      if (other < id && (parent == kNone || n > shared[parent])) parent = other;
    for (int i = id - 1; parent == kNone && i >= 0; --i)
      if (keyframe(i)) parent = i;
    if (parent == kNone) return;
    keyframe(parent)->children.insert(id);
    k.parent = parent;
  }

  /// The keyframes with most points in common, best first; all for max < 0.
  std::vector<KeyframeId> neighbors(KeyframeId id, int max = -1, int min_shared = 0) const {
    std::vector<std::pair<int, KeyframeId>> sorted;
    for (const auto& [other, n] : keyframe(id)->covisible)
      if (n >= min_shared) sorted.emplace_back(-n, other);
    std::sort(sorted.begin(), sorted.end());
    if (max >= 0 && sorted.size() > static_cast<std::size_t>(max))
      sorted.resize(static_cast<std::size_t>(max));
    std::vector<KeyframeId> ids;
    for (const auto& entry : sorted) ids.push_back(entry.second);
    return ids;
  }

  /// Removes a keyframe; its children go to its parent, and its pose stays known relative to it.
  /// The first keyframe (the origin) is never removed.
  void cull_keyframe(KeyframeId id) {
    Keyframe* k = keyframe(id);
    if (!k || k->parent == kNone) return;
    for (const PointId point_id : std::vector<PointId>(k->points))
      if (point_id != kNone) forget(point_id, id);
    for (const auto& [other, n] : k->covisible)
      if (Keyframe* o = keyframe(other)) o->covisible.erase(id);
    Keyframe* parent = keyframe(k->parent);
    parent->children.erase(id);
    for (const KeyframeId child : k->children) keyframe(child)->parent = k->parent;
    parent->children.merge(
        k->children);  // takes no memory: half of them moved would break the tree
    culled_[static_cast<std::size_t>(id)] = {k->parent,
                                             k->T_camera_world * parent->T_camera_world.inverse()};
    keyframes_[static_cast<std::size_t>(id)].reset();
    --keyframe_count_;
  }

  /// T_camera_world of a keyframe, also of one that was removed.
  Eigen::Isometry3d pose_of(KeyframeId id) const {
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    while (!keyframe(id)) {
      const Culled& c = culled_[static_cast<std::size_t>(id)];
      T = T * c.T_this_parent;
      id = c.parent;
    }
    return T * keyframe(id)->T_camera_world;
  }

  /// The keypoint of an observation.
  const FrameKeypoint& keypoint(const Observation& o) const {
    return keyframe(o.keyframe)->frame.keypoints[static_cast<std::size_t>(o.keypoint)];
  }

  /// The points that keyframes see, each once, in ascending order. O(n log n).
  std::vector<PointId> points_of(const std::vector<KeyframeId>& keyframes) const {
    std::vector<PointId> points;
    for (const KeyframeId k : keyframes)
      for (const PointId p : keyframe(k)->points)
        if (p != kNone) points.push_back(p);
    std::sort(points.begin(), points.end());
    points.erase(std::unique(points.begin(), points.end()), points.end());
    return points;
  }

  void clear() { *this = Map(); }

 private:
  struct Culled {
    KeyframeId parent = kNone;
    Eigen::Isometry3d T_this_parent = Eigen::Isometry3d::Identity();
  };

  template <class T>
  static T* at(const std::vector<std::unique_ptr<T>>& all, int id) {
    return id < 0 ? nullptr : all[static_cast<std::size_t>(id)].get();
  }

  template <class T>
  static std::vector<int> ids_of(const std::vector<std::unique_ptr<T>>& all) {
    std::vector<int> ids;
    for (const auto& one : all)
      if (one) ids.push_back(one->id);
    return ids;
  }

  static std::vector<Observation>::iterator find(MapPoint& point, KeyframeId keyframe) {
    return std::lower_bound(point.observations.begin(), point.observations.end(), keyframe,
                            [](const Observation& o, KeyframeId id) { return o.keyframe < id; });
  }

  std::vector<std::unique_ptr<Keyframe>> keyframes_;
  std::vector<Culled> culled_;
  std::vector<std::unique_ptr<MapPoint>> points_;
  std::vector<PointId> replaced_by_;
  std::size_t keyframe_count_ = 0, point_count_ = 0;
};

}  // namespace stillpoint::rgbd_slam
