// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "stillpoint/backends/rgbd_slam/keypoint_frame.hpp"

namespace stillpoint::rgbd_slam {

/// Limits of a match between descriptors.
struct MatchLimits {
  /// Largest accepted distance, bits of 256.
  int max_distance = 80;
  /// The best must be closer than this share of the second best on the same level.
  double ratio = 0.85;
};

/// Where a point is expected in a frame, and on which pyramid level.
struct Projection {
  Eigen::Vector2d pixel;
  int octave;
};

/// The nearest of the descriptors that were tried, and the distance of the second nearest.
struct NearestDescriptor {
  int index = -1, distance = 257, second_distance = 257;

  void try_one(int i, int d) {
    if (d < distance)
      second_distance = distance, distance = d, index = i;
    else if (d < second_distance)
      second_distance = d;
  }
  bool within(const MatchLimits& limits) const {
    return distance <= limits.max_distance && distance <= limits.ratio * second_distance;
  }
};

/// Finds the keypoint within `radius_px` of a projection, a level up or down at most, whose
/// descriptor is nearest; -1 for none. Keypoints with taken[i] >= 0 are left out. `found` is
/// scratch memory. O(keypoints in the radius).
inline int match_at(const KeypointFrame& frame, const Projection& at, double radius_px,
                    const Descriptor& descriptor, const MatchLimits& limits,
                    const std::vector<int>& taken, std::vector<int>& found) {
  frame.find(at.pixel.x(), at.pixel.y(), radius_px, at.octave - 1, at.octave + 1, found);
  int best = -1, best_distance = 257, second_distance = 257, best_octave = -1, second_octave = -2;
  for (const int index : found) {
    const auto i = static_cast<std::size_t>(index);
    if (taken[i] >= 0) continue;
    const int distance = hamming_distance(descriptor, frame.descriptors[i]);
    if (distance < best_distance) {
      second_distance = best_distance, second_octave = best_octave;
      best_distance = distance, best = index, best_octave = frame.keypoints[i].octave;
    } else if (distance < second_distance) {
      second_distance = distance, second_octave = frame.keypoints[i].octave;
    }
  }
  if (best_distance > limits.max_distance) return -1;
  // The same corner often shows on neighboring levels: only rivals of one level are rivals.
  if (best_octave == second_octave && best_distance > limits.ratio * second_distance) return -1;
  return best;
}

/// A pair of descriptors: index in the first list, index in the second.
struct DescriptorMatch {
  int first, second;
};

/// Matches two lists without any guess of where: nearest both ways, distance and ratio limits.
/// O(n m).
inline std::vector<DescriptorMatch> match_all(const std::vector<Descriptor>& first,
                                              const std::vector<Descriptor>& second,
                                              const MatchLimits& limits) {
  std::vector<NearestDescriptor> back(second.size());
  std::vector<DescriptorMatch> forward;
  for (std::size_t i = 0; i < first.size(); ++i) {
    NearestDescriptor nearest;
    for (std::size_t k = 0; k < second.size(); ++k) {
      const int distance = hamming_distance(first[i], second[k]);
      nearest.try_one(static_cast<int>(k), distance);
      back[k].try_one(static_cast<int>(i), distance);
    }
    if (nearest.within(limits)) forward.push_back({static_cast<int>(i), nearest.index});
  }
  const auto one_way = [&](const DescriptorMatch& m) {
    return back[static_cast<std::size_t>(m.second)].index != m.first;
  };
  forward.erase(std::remove_if(forward.begin(), forward.end(), one_way), forward.end());
  return forward;
}

/// Distance range over which a point, seen at `distance_m` on `octave`, stays in the pyramid.
struct ScaleRange {
  /// Distance at which the point would be seen on level 0.
  float level0_distance_m = 0;

  ScaleRange() = default;
  ScaleRange(double distance_m, double scale)
      : level0_distance_m(static_cast<float>(distance_m * scale)) {}

  /// Level on which the point is expected at a distance; may lie outside the pyramid.
  int octave_at(double distance_m, double log_scale_factor) const {
    return static_cast<int>(
        std::lround(std::log(level0_distance_m / distance_m) / log_scale_factor));
  }
};

}  // namespace stillpoint::rgbd_slam
