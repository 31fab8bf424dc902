// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <mutex>
#include <vector>

#include "stillpoint/backends/rgbd_slam/bundle_adjustment.hpp"
#include "stillpoint/backends/rgbd_slam/fair_mutex.hpp"
#include "stillpoint/backends/rgbd_slam/map.hpp"
#include "stillpoint/backends/rgbd_slam/map_changes.hpp"
#include "stillpoint/backends/rgbd_slam/place_index.hpp"

namespace stillpoint::rgbd_slam {

/// Builds the map around each new keyframe: culling of bad points, fusion of double ones, local
/// bundle adjustment, culling of keyframes that add nothing.
///
/// process() takes the map's lock in short pieces and solves without it, so that tracking goes on.
class LocalMapping {
 public:
  struct Settings {
    /// Keyframes that are adjusted at once (0: none), and the iterations of it.
    std::size_t bundle_keyframes = 12;
    int bundle_iterations = 8;
    /// Neighbors that new points are fused with.
    std::size_t fuse_with = 10;
    /// A young point must be found in this share of the frames that should see it.
    double min_found_ratio = 0.25;
    /// A keyframe goes when this share of its points is seen by three others as finely.
    double redundant_ratio = 0.9;
  };

  LocalMapping(const CameraModel& model, const Settings& settings)
      : model_(model), settings_(settings) {}

  /// Works a keyframe in. With `stop` set by another thread the long parts are cut short.
  void process(Map& map, FairMutex& lock, PlaceIndex& index, KeyframeId id,
               const std::atomic<bool>& stop) {
    {
      const std::lock_guard<FairMutex> guard(lock);
      register_points(map, id);
      cull_young_points(map, id);
    }
    fuse(map, lock, id);
    if (!stop.load()) adjust(map, lock, id, stop);
    const std::lock_guard<FairMutex> guard(lock);
    if (!stop.load()) cull_keyframes(map, index, id);
  }

 private:
  void register_points(Map& map, KeyframeId id) {
    for (const PointId point_id : map.keyframe(id)->points) {
      MapPoint* p = map.point(point_id);
      if (!p) continue;
      if (p->first_keyframe == id)
        young_.push_back(point_id);
      else
        map.refresh(*p);
    }
    map.update_connections(id);
  }

  void cull_young_points(Map& map, KeyframeId now) {
    std::size_t kept = 0;
    for (const PointId id : young_) {
      const MapPoint* p = map.point(id);
      if (!p) continue;
      const std::size_t age = now.index() - p->first_keyframe.index();
      if (p->found < settings_.min_found_ratio * p->visible ||
          (age >= 3 && p->observations.size() < 2 && p->found < 4)) {
        map.erase_point(id);
        continue;
      }
      if (age < 4) young_[kept++] = id;
    }
    young_.resize(kept);
  }

  void fuse(Map& map, FairMutex& lock, KeyframeId id) {
    std::vector<KeyframeId> targets;
    std::vector<PointId> own;
    {
      const std::lock_guard<FairMutex> guard(lock);
      targets = map.neighbors(id, settings_.fuse_with);
      own = map.points_of({id});
    }
    for (const KeyframeId target : targets) {
      const std::lock_guard<FairMutex> guard(lock);
      fuse_points(model_, map, *map.keyframe(target), own, 3, false);
    }
    const std::lock_guard<FairMutex> guard(lock);
    fuse_points(model_, map, *map.keyframe(id), map.points_of(targets), 3, false);
    for (const PointId p : map.points_of({id})) map.refresh(*map.point(p));
    map.update_connections(id);
  }

  void adjust(Map& map, FairMutex& lock, KeyframeId id, const std::atomic<bool>& stop) {
    std::vector<KeyframeId> local;
    {
      const std::lock_guard<FairMutex> guard(lock);
      if (map.keyframe_count() < 2 || settings_.bundle_keyframes < 1) return;
      local = map.neighbors(id, settings_.bundle_keyframes - 1);
    }
    local.push_back(id);
    std::sort(local.begin(), local.end());
    adjust_keyframes(map, lock, model_, local, settings_.bundle_iterations, &stop);
  }

  void cull_keyframes(Map& map, PlaceIndex& index, KeyframeId now) {
    for (const KeyframeId id : map.neighbors(now)) {
      const Keyframe& k = *map.keyframe(id);
      // The newest ones are what tracking stands on; loops hang on the ones they were closed at.
      if (!k.parent || !k.loop_edges.empty() || id.index() + 1 >= now.index()) continue;
      int total = 0, redundant = 0;
      for (std::size_t i = 0; i < k.points.size(); ++i) {
        const MapPoint* p = map.point(k.points[i]);
        if (!p) continue;
        ++total;
        if (p->observations.size() <= 3) continue;
        int others = 0;
        const int octave = k.frame.keypoints[i].octave;
        for (const Observation& o : p->observations)
          others += o.keyframe != id && map.keypoint(o).octave <= octave + 1;
        redundant += others >= 3;
      }
      if (redundant <= settings_.redundant_ratio * total) continue;
      index.remove(id);
      map.cull_keyframe(id);
    }
  }

  CameraModel model_;
  Settings settings_;
  std::vector<PointId> young_;
};

}  // namespace stillpoint::rgbd_slam
