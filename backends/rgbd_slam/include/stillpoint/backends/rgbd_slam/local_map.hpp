// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <map>
#include <utility>
#include <vector>

#include "stillpoint/backends/rgbd_slam/map.hpp"

namespace stillpoint::rgbd_slam {

/// The part of the map around a frame.
struct LocalMap {
  /// The keyframe that shares most points with the frame; kNone when none does.
  KeyframeId reference = kNone;
  /// Keyframes that share points, most first, then their neighbors.
  std::vector<KeyframeId> keyframes;
  /// All their points, each once.
  std::vector<PointId> points;
};

/// Gathers the keyframes that see the given points, their neighbors in covisibility and spanning
/// tree, and all the points of these. O(points of the local keyframes).
inline LocalMap gather_local_map(const Map& map, const std::vector<PointId>& seen,
                                 std::size_t max_keyframes) {
  LocalMap local;
  std::map<KeyframeId, int> shared;
  for (const PointId id : seen)
    if (const MapPoint* p = map.point(id))
      for (const Observation& o : p->observations) ++shared[o.keyframe];
  std::vector<std::pair<int, KeyframeId>> sorted;
  for (const auto& [id, n] : shared) sorted.emplace_back(-n, id);
  std::sort(sorted.begin(), sorted.end());
  std::vector<char> taken(static_cast<std::size_t>(map.keyframe_end()), 0);
  const auto take = [&](KeyframeId id) {
    if (id == kNone || local.keyframes.size() >= max_keyframes || !map.keyframe(id) ||
        taken[static_cast<std::size_t>(id)])
      return;
    taken[static_cast<std::size_t>(id)] = 1;
    local.keyframes.push_back(id);
  };
  for (const auto& entry : sorted) take(entry.second);
  if (!local.keyframes.empty()) local.reference = local.keyframes.front();
  const std::size_t direct = local.keyframes.size();
  for (std::size_t i = 0; i < direct; ++i) {
    const Keyframe* k = map.keyframe(local.keyframes[i]);
    for (const KeyframeId n : map.neighbors(k->id, 5)) take(n);
    for (const KeyframeId child : k->children) take(child);
    take(k->parent);
  }
  std::vector<char> listed(static_cast<std::size_t>(map.point_end()), 0);
  for (const KeyframeId id : local.keyframes)
    for (const PointId p : map.keyframe(id)->points) {
      if (p == kNone || listed[static_cast<std::size_t>(p)]) continue;
      listed[static_cast<std::size_t>(p)] = 1;
      local.points.push_back(p);
    }
  return local;
}

}  // namespace stillpoint::rgbd_slam
