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

/// A place in a frame where a point is expected.
struct Sighting {
  Eigen::Vector2d pixel;
  double radius_px;
  int min_octave, max_octave;
};

/// Finds the keypoint at a sighting whose descriptor is nearest; -1 for none. Keypoints with
/// taken[i] >= 0 are left out. `found` is scratch memory. O(keypoints in the radius).
inline int match_at(const KeypointFrame& frame, const Sighting& sighting,
                    const Descriptor& descriptor, const MatchLimits& limits,
                    const std::vector<int>& taken, std::vector<int>& found) {
  frame.find(sighting.pixel.x(), sighting.pixel.y(), sighting.radius_px, sighting.min_octave,
             sighting.max_octave, found);
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
  int first, second, distance;
};

/// Matches two lists without any guess of where: nearest both ways, distance and ratio limits.
/// O(n m).
inline std::vector<DescriptorMatch> match_all(const std::vector<Descriptor>& first,
                                              const std::vector<Descriptor>& second,
                                              const MatchLimits& limits) {
  std::vector<int> back(second.size(), -1), back_distance(second.size(), 257);
  std::vector<DescriptorMatch> forward;
  for (std::size_t i = 0; i < first.size(); ++i) {
    int best = -1, best_distance = 257, second_distance = 257;
    for (std::size_t k = 0; k < second.size(); ++k) {
      const int distance = hamming_distance(first[i], second[k]);
      if (distance < best_distance)
        second_distance = best_distance, best_distance = distance, best = static_cast<int>(k);
      else if (distance < second_distance)
        second_distance = distance;
      if (distance < back_distance[k]) back_distance[k] = distance, back[k] = static_cast<int>(i);
    }
    if (best >= 0 && best_distance <= limits.max_distance &&
        best_distance <= limits.ratio * second_distance)
      forward.push_back({static_cast<int>(i), best, best_distance});
  }
  std::vector<DescriptorMatch> mutual;
  for (const DescriptorMatch& m : forward)
    if (back[static_cast<std::size_t>(m.second)] == m.first) mutual.push_back(m);
  return mutual;
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
