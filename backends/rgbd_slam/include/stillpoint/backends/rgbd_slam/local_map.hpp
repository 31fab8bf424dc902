// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <vector>

#include "stillpoint/backends/rgbd_slam/map.hpp"

namespace stillpoint::rgbd_slam {

/// The part of the map around a frame.
struct LocalMap {
  /// The keyframe that shares most points with the frame; none if no one does.
  KeyframeId reference;
  /// The points of the keyframes around, each once.
  std::vector<PointId> points;
};

/// Gathers the keyframes that see the given points, most first, and their neighbors in
/// covisibility, and lists the points of these. O(points of the local keyframes).
inline LocalMap gather_local_map(const Map& map, const std::vector<PointId>& seen,
                                 std::size_t max_keyframes) {
  LocalMap local;
  std::vector<KeyframeId> keyframes;
  std::vector<char> taken(map.keyframe_end(), 0), listed(map.point_end(), 0);
  const auto take = [&](KeyframeId id) {
    if (keyframes.size() >= max_keyframes || taken[id.index()]) return;
    taken[id.index()] = 1;
    keyframes.push_back(id);
  };
  for (const KeyframeId id : Map::most_first(map.count_observers(seen), max_keyframes)) take(id);
  if (!keyframes.empty()) local.reference = keyframes.front();
  for (const KeyframeId id : std::vector<KeyframeId>(keyframes))
    for (const KeyframeId n : map.neighbors(id, 5)) take(n);
  for (const KeyframeId id : keyframes)
    for (const PointId p : map.keyframe(id)->points) {
      if (!p || listed[p.index()]) continue;
      listed[p.index()] = 1;
      local.points.push_back(p);
    }
  return local;
}

}  // namespace stillpoint::rgbd_slam
