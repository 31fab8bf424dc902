// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "stillpoint/core/error.hpp"
#include "stillpoint/core/trajectory.hpp"
#include "stillpoint/evaluation/associate.hpp"
#include "stillpoint/evaluation/error_statistics.hpp"
#include "stillpoint/evaluation/timestamps.hpp"
#include "stillpoint/evaluation/trajectory_error.hpp"

namespace stillpoint {

/// How much of a sequence was tracked.
struct Coverage {
  /// Frames with a ground truth pose near in time; a dropout of the ground truth counts for
  /// nothing.
  std::size_t frames = 0;
  /// Those of them that have an estimated pose.
  std::size_t covered = 0;
  /// covered / frames; 0 when there are no such frames.
  double share = 0;
};

/// Counts the frames with ground truth less than `max_difference_s` away that have an estimated
/// pose (paired by associate(): each pose serves one frame). `frames`: the timestamps of the
/// camera's frames, seconds. O(n log n).
inline Coverage coverage(const Trajectory& groundtruth, const Trajectory& estimate,
                         const std::vector<double>& frames, double max_difference_s = 0.02) {
  std::vector<double> truth = detail::timestamps_of(groundtruth);
  std::sort(truth.begin(), truth.end());
  std::vector<double> measured;
  for (double t : frames)
    if (!truth.empty() && std::abs(truth[detail::nearest(truth, t)] - t) < max_difference_s)
      measured.push_back(t);
  Coverage result;
  result.frames = measured.size();
  // Paired over all frames: the pose of a frame without ground truth must not serve its neighbor.
  std::sort(measured.begin(), measured.end());
  for (const TimestampPair& pair :
       associate(frames, detail::timestamps_of(estimate), max_difference_s))
    if (std::binary_search(measured.begin(), measured.end(), frames[pair.first])) ++result.covered;
  if (result.frames > 0)
    result.share = static_cast<double>(result.covered) / static_cast<double>(result.frames);
  return result;
}

/// Guesses the camera's frames when only trajectories are at hand: the estimate's own timestamps,
/// and in every gap between them, and from the ground truth's first to its last pose, frames at the
/// camera's interval.
///
/// `frame_interval_s`: 0 = the estimate's median interval, but at most 1/30 s, so that an estimate
/// of keyframes only is not taken for a slow camera. Frames that the camera itself dropped count as
/// lost, so the coverage comes out a little low; give the real list (rgb.txt) where there is one.
inline std::vector<double> guess_frames(const Trajectory& groundtruth, const Trajectory& estimate,
                                        double frame_interval_s = 0) {
  std::vector<double> times = detail::timestamps_of(estimate);
  std::vector<double> truth = detail::timestamps_of(groundtruth);
  for (const auto* list : {&times, &truth})
    for (double t : *list)
      detail::check(std::isfinite(t), [] {
        return std::string("guess_frames: expected timestamps in seconds, found NaN or infinity");
      });
  std::sort(times.begin(), times.end());
  std::sort(truth.begin(), truth.end());
  if (!(frame_interval_s > 0)) {
    frame_interval_s = 1.0 / 30;
    std::vector<double> intervals;
    for (std::size_t i = 1; i < times.size(); ++i) intervals.push_back(times[i] - times[i - 1]);
    // 1 ms at least: a broken file must not ask for millions of frames.
    if (!intervals.empty())
      frame_interval_s =
          std::min(frame_interval_s, std::max(1e-3, error_statistics(std::move(intervals)).median));
  }
  const double span_s = truth.empty() ? 0 : truth.back() - truth.front();
  detail::check(span_s / frame_interval_s < 1e7, [&] {
    return "guess_frames: expected a ground truth of at most ten million frames, found " +
           std::to_string(span_s) + " s; are all timestamps in seconds?";
  });
  std::vector<double> frames;
  if (truth.empty()) return times;
  // Only where there is ground truth do frames count.
  const double begin = truth.front(), end = truth.back();
  const auto fill = [&](double from, double to) {  // frames strictly between two known ones
    const double steps = std::round((to - from) / frame_interval_s);
    for (double k = 1; k < steps; ++k) frames.push_back(from + (to - from) * k / steps);
  };
  std::vector<double> inside;
  for (double t : times)
    if (t > begin - frame_interval_s / 2 && t < end + frame_interval_s / 2) inside.push_back(t);
  if (inside.empty()) {
    frames.push_back(begin);
    fill(begin, end);
    return frames;
  }
  for (double t = inside.front() - frame_interval_s; t >= begin; t -= frame_interval_s)
    frames.push_back(t);
  std::reverse(frames.begin(), frames.end());
  for (std::size_t i = 0; i < inside.size(); ++i) {
    if (i) fill(inside[i - 1], inside[i]);
    frames.push_back(inside[i]);
  }
  for (double t = inside.back() + frame_interval_s; t <= end; t += frame_interval_s)
    frames.push_back(t);
  return frames;
}

/// As above, with the frames guessed by guess_frames().
inline Coverage coverage(const Trajectory& groundtruth, const Trajectory& estimate) {
  return coverage(groundtruth, estimate, guess_frames(groundtruth, estimate));
}

}  // namespace stillpoint
