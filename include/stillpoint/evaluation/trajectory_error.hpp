// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include "stillpoint/core/associate.hpp"
#include "stillpoint/core/error.hpp"
#include "stillpoint/core/trajectory.hpp"

namespace stillpoint {

/// Root mean square, standard deviation (of the population, as numpy's std), mean, median, smallest
/// and largest of some errors; all NaN when there are none.
struct ErrorStatistics {
  double rmse = std::numeric_limits<double>::quiet_NaN();
  double sd = rmse, mean = rmse, median = rmse, min = rmse, max = rmse;
  std::size_t count = 0;
};

/// Computes the statistics of a list of errors. O(n log n).
inline ErrorStatistics error_statistics(std::vector<double> errors) {
  ErrorStatistics s;
  s.count = errors.size();
  if (errors.empty()) return s;
  std::sort(errors.begin(), errors.end());
  const double n = static_cast<double>(errors.size());
  double sum = 0, squares = 0, deviations = 0;
  for (double e : errors) sum += e, squares += e * e;
  s.mean = sum / n;
  for (double e : errors) deviations += (e - s.mean) * (e - s.mean);
  s.rmse = std::sqrt(squares / n);
  s.sd = std::sqrt(deviations / n);
  const std::size_t half = errors.size() / 2;
  s.median = errors.size() % 2 ? errors[half] : (errors[half - 1] + errors[half]) / 2;
  s.min = errors.front();
  s.max = errors.back();
  return s;
}

namespace detail {

/// The rotation R that maximises the trace of R^T M (orthogonal Procrustes, by SVD).
inline Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& M) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(M, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d signs = Eigen::Vector3d::Ones();
  // Without this a mirrored solution would win for flat or noisy paths.
  if (svd.matrixU().determinant() * svd.matrixV().determinant() < 0) signs.z() = -1;
  return svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
}

}  // namespace detail

/// The rigid motion T, without scale, that minimises the sum of |T * from[i] - to[i]|^2 (Horn's
/// closed form, by SVD). Both lists have the same length, at least 1. O(n).
inline Eigen::Isometry3d align(const std::vector<Eigen::Vector3d>& from,
                               const std::vector<Eigen::Vector3d>& to) {
  detail::check(from.size() == to.size() && !from.empty(), [&] {
    return "align: expected two lists of the same length, at least 1, found " +
           std::to_string(from.size()) + " and " + std::to_string(to.size());
  });
  const double n = static_cast<double>(from.size());
  Eigen::Vector3d mean_from = Eigen::Vector3d::Zero(), mean_to = mean_from;
  for (std::size_t i = 0; i < from.size(); ++i) mean_from += from[i], mean_to += to[i];
  mean_from /= n;
  mean_to /= n;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < from.size(); ++i)
    covariance += (to[i] - mean_to) * (from[i] - mean_from).transpose();
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = detail::nearest_rotation(covariance);
  T.translation() = mean_to - T.linear() * mean_from;
  return T;
}

/// Absolute trajectory error, over the matched poses.
struct AteResult {
  double rmse_m = 0, sd_m = 0, mean_m = 0, median_m = 0, min_m = 0, max_m = 0;
  std::size_t pairs = 0;
  /// Maps the estimate's world to the ground truth's.
  Eigen::Isometry3d T_groundtruth_estimate = Eigen::Isometry3d::Identity();
  /// The matched poses: first = index in the ground truth, second = index in the estimate.
  std::vector<TimestampPair> matches;
  /// Distance of each matched pair after alignment, metres.
  std::vector<double> errors_m;
};

namespace detail {

inline std::vector<double> timestamps_of(const Trajectory& trajectory) {
  std::vector<double> times;
  times.reserve(trajectory.size());
  for (const StampedPose& pose : trajectory) times.push_back(pose.timestamp);
  return times;
}

inline std::string range_text(const Trajectory& trajectory) {
  std::string text = std::to_string(trajectory.size()) + " poses";
  if (trajectory.empty()) return text;
  const std::vector<double> times = timestamps_of(trajectory);
  const auto range = std::minmax_element(times.begin(), times.end());
  return text + " from " + std::to_string(*range.first) + " to " + std::to_string(*range.second) +
         " s";
}

/// Index of the time nearest to `t`; `times` is ascending and not empty. The earlier one of two
/// equally near ones.
inline std::size_t nearest(const std::vector<double>& times, double t) {
  const auto after = std::lower_bound(times.begin(), times.end(), t);
  if (after == times.begin()) return 0;
  const auto index = static_cast<std::size_t>(after - times.begin());
  if (after == times.end()) return index - 1;
  return t - times[index - 1] <= times[index] - t ? index - 1 : index;
}

inline void check_ascending(const std::vector<double>& times, const char* name) {
  for (std::size_t i = 0; i < times.size(); ++i)
    check(std::isfinite(times[i]) && (i == 0 || times[i - 1] < times[i]), [&] {
      return std::string(name) + "[" + std::to_string(i) +
             "].timestamp: expected ascending seconds, found " + std::to_string(times[i]) +
             (i ? " after " + std::to_string(times[i - 1]) : std::string());
    });
}

}  // namespace detail

/// Absolute trajectory error as the TUM RGB-D benchmark's evaluate_ate.py defines it: poses are
/// paired when less than `max_difference_s` apart (see associate()), the estimate is aligned to the
/// ground truth by least squares over the positions in SE(3), without scale, and the statistics are
/// taken over the distances that remain.
///
/// A low error means little when most of the trajectory is lost: state coverage() beside it.
/// Throws Error with the counts and time ranges of both when fewer than 3 poses match. O(n log n).
inline AteResult ate(const Trajectory& groundtruth, const Trajectory& estimate,
                     double max_difference_s = 0.02) {
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
  result.T_groundtruth_estimate = align(from, to);
  for (std::size_t i = 0; i < from.size(); ++i)
    result.errors_m.push_back((result.T_groundtruth_estimate * from[i] - to[i]).norm());
  const ErrorStatistics s = error_statistics(result.errors_m);
  result.rmse_m = s.rmse, result.sd_m = s.sd, result.mean_m = s.mean, result.median_m = s.median;
  result.min_m = s.min, result.max_m = s.max;
  return result;
}

/// Maps the estimate's world to the ground truth's by the whole poses, for maps. ate() aligns
/// positions alone, as the benchmark does: where the camera hardly moves but turns, that leaves a
/// rotation open by degrees, and a map tilted. Here the rotation is the chordal mean of the
/// orientations' differences. `matches` are associate()'s, as in AteResult. Throws Error without
/// any. O(n).
inline Eigen::Isometry3d align_poses(const Trajectory& groundtruth, const Trajectory& estimate,
                                     const std::vector<TimestampPair>& matches) {
  detail::check(!matches.empty(),
                [] { return std::string("align_poses: expected at least 1 match, found none"); });
  Eigen::Matrix3d turns = Eigen::Matrix3d::Zero();
  Eigen::Vector3d from = Eigen::Vector3d::Zero(), to = Eigen::Vector3d::Zero();
  for (const TimestampPair& m : matches) {
    const Eigen::Isometry3d& truth = groundtruth[m.first].T_world_camera;
    const Eigen::Isometry3d& found = estimate[m.second].T_world_camera;
    turns += truth.linear() * found.linear().transpose();
    to += truth.translation(), from += found.translation();
  }
  const double n = static_cast<double>(matches.size());
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = detail::nearest_rotation(turns);
  T.translation() = to / n - T.linear() * (from / n);
  return T;
}

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
