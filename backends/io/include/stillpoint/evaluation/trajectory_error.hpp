// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <string>
#include <vector>

#include "stillpoint/core/error.hpp"
#include "stillpoint/core/trajectory.hpp"
#include "stillpoint/evaluation/alignment.hpp"
#include "stillpoint/evaluation/associate.hpp"
#include "stillpoint/evaluation/error_statistics.hpp"
#include "stillpoint/evaluation/relative_error.hpp"
#include "stillpoint/evaluation/timestamps.hpp"

namespace stillpoint {

/// What may be fitted before errors are taken. Figures of the two must not stand in one column:
/// with the scale fitted, an error of the scale is none.
enum class Alignment {
  kSE3,  ///< rotation and translation: for a camera with depth
  kSim3  ///< and the scale: for one eye, or to see how much of an error is scale
};

/// Absolute trajectory error, over the matched poses.
struct AteResult {
  double rmse_m = 0, sd_m = 0, mean_m = 0, median_m = 0, min_m = 0, max_m = 0;
  std::size_t pairs = 0;
  /// Maps the estimate's world to the ground truth's: p becomes T * (scale * p).
  Eigen::Isometry3d T_groundtruth_estimate = Eigen::Isometry3d::Identity();
  /// 1 with Alignment::kSE3.
  double scale = 1;
  /// The matched poses: first = index in the ground truth, second = index in the estimate.
  std::vector<TimestampPair> matches;
  /// Distance of each matched pair after alignment, metres.
  std::vector<double> errors_m;
};

/// Absolute trajectory error as the TUM RGB-D benchmark's evaluate_ate.py defines it: poses are
/// paired when less than `max_difference_s` apart (see associate()), the estimate is aligned to the
/// ground truth by least squares over the positions in SE(3), without scale (or in Sim(3), see
/// Alignment), and the statistics are taken over the distances that remain. The same as
/// `evo_ape tum GROUNDTRUTH ESTIMATE --align --t_max_diff 0.02` (with --correct_scale for Sim(3)),
/// unless two poses have one nearest partner: here each is used once.
///
/// A low error means little when most of the trajectory is lost: state coverage() beside it.
/// Throws Error with the counts and time ranges of both when fewer than 3 poses match. O(n log n).
inline AteResult ate(const Trajectory& groundtruth, const Trajectory& estimate,
                     double max_difference_s = 0.02, Alignment alignment = Alignment::kSE3) {
  AteResult result;
  result.matches = associate(detail::timestamps_of(groundtruth), detail::timestamps_of(estimate),
                             max_difference_s);
  result.pairs = result.matches.size();
  detail::check(result.pairs >= 3, [&] {
    return "ate: expected at least 3 poses less than " + std::to_string(max_difference_s) +
           " s apart, found " + std::to_string(result.pairs) +
           "; ground truth: " + detail::range_text(groundtruth) +
           ", estimate: " + detail::range_text(estimate) +
           "; do both belong to the same sequence and clock?";
  });
  std::vector<Eigen::Vector3d> from, to;
  for (const TimestampPair& m : result.matches) {
    to.push_back(groundtruth[m.first].T_world_camera.translation());
    from.push_back(estimate[m.second].T_world_camera.translation());
    detail::check(to.back().allFinite() && from.back().allFinite(), [&] {
      return "ate: expected finite positions, found NaN or infinity at " +
             std::to_string(estimate[m.second].timestamp) + " s";
    });
  }
  const Similarity best =
      alignment == Alignment::kSim3 ? align_with_scale(from, to) : Similarity{align(from, to), 1};
  result.T_groundtruth_estimate = best.T;
  result.scale = best.scale;
  for (std::size_t i = 0; i < from.size(); ++i)
    result.errors_m.push_back((best.T * (best.scale * from[i]) - to[i]).norm());
  const ErrorStatistics s = error_statistics(result.errors_m);
  result.rmse_m = s.rmse, result.sd_m = s.sd, result.mean_m = s.mean, result.median_m = s.median;
  result.min_m = s.min, result.max_m = s.max;
  return result;
}

}  // namespace stillpoint
