// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <string>
#include <vector>

#include "stillpoint/core/error.hpp"
#include "stillpoint/core/trajectory.hpp"
#include "stillpoint/evaluation/associate.hpp"

namespace stillpoint {

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

/// A rotation, a translation and a scale: p becomes T * (scale * p).
struct Similarity {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  double scale = 1;
};

/// As align(), with the scale that is best, too (Umeyama's closed form): for systems that cannot
/// know the scale, and to see how far another is off. The scale is 1 where all of `from` is one
/// point. O(n).
inline Similarity align_with_scale(const std::vector<Eigen::Vector3d>& from,
                                   const std::vector<Eigen::Vector3d>& to) {
  // The best rotation does not depend on the scale.
  Similarity best{align(from, to), 1};
  const double n = static_cast<double>(from.size());
  Eigen::Vector3d mean_from = Eigen::Vector3d::Zero(), mean_to = mean_from;
  for (std::size_t i = 0; i < from.size(); ++i) mean_from += from[i], mean_to += to[i];
  mean_from /= n;
  mean_to /= n;
  double along = 0, squares = 0;
  for (std::size_t i = 0; i < from.size(); ++i) {
    along += (to[i] - mean_to).dot(best.T.linear() * (from[i] - mean_from));
    squares += (from[i] - mean_from).squaredNorm();
  }
  if (squares > 0 && along > 0) best.scale = along / squares;
  best.T.translation() = mean_to - best.T.linear() * (best.scale * mean_from);
  return best;
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

}  // namespace stillpoint
