// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <opencv2/features2d.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "stillpoint/backends/rgbd_slam/ids.hpp"
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

/// Finds the keypoint within `radius_px` of a projection, a level up or down at most, whose
/// descriptor is nearest. Keypoints that have a point in `taken` are left out. `found` is scratch
/// memory. O(keypoints in the radius).
inline std::optional<std::size_t> match_at(const KeypointFrame& frame, const Projection& at,
                                           double radius_px, const Descriptor& descriptor,
                                           const MatchLimits& limits,
                                           const std::vector<PointId>& taken,
                                           std::vector<std::size_t>& found) {
  frame.find(at.pixel.x(), at.pixel.y(), radius_px, at.octave - 1, at.octave + 1, found);
  std::size_t best = 0;
  int best_distance = 257, second_distance = 257, best_octave = -1, second_octave = -2;
  for (const std::size_t i : found) {
    if (taken[i]) continue;
    const int distance = hamming_distance(descriptor, frame.descriptors[i]);
    if (distance < best_distance) {
      second_distance = best_distance, second_octave = best_octave;
      best_distance = distance, best = i, best_octave = frame.keypoints[i].octave;
    } else if (distance < second_distance) {
      second_distance = distance, second_octave = frame.keypoints[i].octave;
    }
  }
  if (best_distance > limits.max_distance) return std::nullopt;
  // The same corner often shows on neighboring levels: only rivals of one level are rivals.
  if (best_octave == second_octave && best_distance > limits.ratio * second_distance)
    return std::nullopt;
  return best;
}

/// Matches two lists without any guess of where: nearest both ways, distance and ratio limits.
/// Gives pairs of indices. O(n m).
inline std::vector<std::pair<std::size_t, std::size_t>> match_all(
    const std::vector<Descriptor>& first, const std::vector<Descriptor>& second,
    const MatchLimits& limits) {
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  if (first.empty() || second.empty()) return pairs;
  const cv::BFMatcher matcher(cv::NORM_HAMMING);
  std::vector<std::vector<cv::DMatch>> nearest;
  std::vector<cv::DMatch> back;
  matcher.knnMatch(descriptor_rows(first), descriptor_rows(second), nearest, 2);
  matcher.match(descriptor_rows(second), descriptor_rows(first), back);
  for (const std::vector<cv::DMatch>& n : nearest) {
    const auto i = static_cast<std::size_t>(n[0].queryIdx);
    const auto k = static_cast<std::size_t>(n[0].trainIdx);
    const bool clear = n.size() < 2 || n[0].distance <= limits.ratio * n[1].distance;
    if (n[0].distance <= static_cast<float>(limits.max_distance) && clear &&
        back[k].trainIdx == n[0].queryIdx)
      pairs.emplace_back(i, k);
  }
  return pairs;
}

}  // namespace stillpoint::rgbd_slam
