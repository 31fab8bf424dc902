// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "stillpoint/core/error.hpp"
#include "stillpoint/core/trajectory.hpp"
#include "stillpoint/evaluation/error_statistics.hpp"
#include "stillpoint/evaluation/timestamps.hpp"

namespace stillpoint {

/// Which poses rpe() compares.
struct RpeSettings {
  /// Poses i and i + delta_frames of the estimate; not used when delta_s is positive.
  int delta_frames = 1;
  /// Positive: pose i and the one nearest to delta_s later.
  double delta_s = 0;
  /// With delta_s: pairs further off than this are left out, e.g. across a gap in the estimate.
  double max_delta_error_s = 0.05;
  /// A pose without ground truth this near is left out. 0: twice the ground truth's median
  /// interval.
  double max_difference_s = 0.02;

  /// The literal rule of the TUM benchmark's evaluate_rpe.py with --fixed_delta and its defaults:
  /// 1 s; the nearest pose is taken however far off, even the pose itself.
  static RpeSettings tum() {
    RpeSettings s;
    s.delta_s = 1;
    s.max_delta_error_s = std::numeric_limits<double>::infinity();
    s.max_difference_s = 0;
    return s;
  }
  /// Drift over `seconds`, without pairs across gaps.
  static RpeSettings over_seconds(double seconds) {
    RpeSettings s;
    s.delta_s = seconds;
    return s;
  }
};

/// Relative pose error: drift of the motion between two poses.
struct RpeResult {
  /// Metres and degrees; NaN when no two poses could be compared.
  ErrorStatistics translation_m, rotation_deg;
  std::size_t pairs = 0;
};

/// Relative pose error of the TUM RGB-D benchmark: for two estimated poses i and j, the motion
/// between them is compared with the motion between the ground truth poses nearest in time,
/// E = (P_j^-1 P_i)^-1 (G_j^-1 G_i); the errors are the length of E's translation and its angle.
///
/// By default over one frame of the estimate (j = i + 1); RpeSettings::tum() gives the benchmark's
/// 1 s. Throws Error if the timestamps of either are not ascending. O(n log n).
inline RpeResult rpe(const Trajectory& groundtruth, const Trajectory& estimate,
                     const RpeSettings& settings = RpeSettings()) {
  detail::check(settings.delta_s > 0 || settings.delta_frames > 0, [&] {
    return "RpeSettings: expected delta_frames of at least 1, found " +
           std::to_string(settings.delta_frames);
  });
  const std::vector<double> g = detail::timestamps_of(groundtruth);
  const std::vector<double> e = detail::timestamps_of(estimate);
  detail::check_ascending(g, "groundtruth");
  detail::check_ascending(e, "estimate");
  RpeResult result;
  if (g.empty() || e.empty()) return result;
  double max_difference_s = settings.max_difference_s;
  if (!(max_difference_s > 0)) {
    std::vector<double> intervals;
    for (std::size_t i = 1; i < g.size(); ++i) intervals.push_back(g[i] - g[i - 1]);
    max_difference_s = intervals.empty() ? 0 : 2 * error_statistics(std::move(intervals)).median;
  }
  std::vector<double> translations, rotations;
  for (std::size_t i = 0; i < e.size(); ++i) {
    std::size_t j = i + static_cast<std::size_t>(std::max(settings.delta_frames, 0));
    if (settings.delta_s > 0) {
      j = detail::nearest(e, e[i] + settings.delta_s);
      // The last pose is the nearest one for every target behind the end.
      if (j + 1 == e.size()) continue;
      // So is a pose to itself, if the time apart is less than that to the next.
      if (j == i && std::isfinite(settings.max_delta_error_s)) continue;
      if (std::abs(e[j] - (e[i] + settings.delta_s)) > settings.max_delta_error_s) continue;
    }
    if (j >= e.size()) break;
    const std::size_t gi = detail::nearest(g, e[i]), gj = detail::nearest(g, e[j]);
    if (std::abs(g[gi] - e[i]) > max_difference_s || std::abs(g[gj] - e[j]) > max_difference_s)
      continue;
    const Eigen::Isometry3d moved =
        estimate[j].T_world_camera.inverse() * estimate[i].T_world_camera;
    const Eigen::Isometry3d truly =
        groundtruth[gj].T_world_camera.inverse() * groundtruth[gi].T_world_camera;
    const Eigen::Isometry3d error = moved.inverse() * truly;
    detail::check(error.matrix().allFinite(), [&] {
      return "rpe: expected finite poses, found NaN or infinity near " + std::to_string(e[i]) +
             " s";
    });
    translations.push_back(error.translation().norm());
    const double cosine = (error.linear().trace() - 1) / 2;
    rotations.push_back(std::acos(std::min(1.0, std::max(-1.0, cosine))) * 180 /
                        static_cast<double>(EIGEN_PI));
  }
  result.pairs = translations.size();
  result.translation_m = error_statistics(std::move(translations));
  result.rotation_deg = error_statistics(std::move(rotations));
  return result;
}

}  // namespace stillpoint
