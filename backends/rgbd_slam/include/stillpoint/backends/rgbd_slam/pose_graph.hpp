// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <ceres/ceres.h>

#include <Eigen/Geometry>
#include <map>
#include <vector>

#include "stillpoint/backends/rgbd_slam/bundle_adjustment.hpp"

namespace stillpoint::rgbd_slam {

/// A measured relative pose T_first_second between two keyframes.
struct PoseGraphEdge {
  KeyframeId first, second;
  Eigen::Isometry3d T_first_second;
};

/// Difference between an edge and the poses of its ends: translation in centimetres, rotation in
/// hundredths of a radian, so that both weigh alike at the depth of a room.
struct PoseGraphCost {
  Eigen::Quaterniond q;
  Eigen::Vector3d t;

  template <class T>
  bool operator()(const T* q1, const T* t1, const T* q2, const T* t2, T* residuals) const {
    using Vector = Eigen::Matrix<T, 3, 1>;
    using Quaternion = Eigen::Quaternion<T>;
    const Eigen::Map<const Quaternion> Q1(q1), Q2(q2);
    const Eigen::Map<const Vector> T1(t1), T2(t2);
    const Quaternion relative = Q1 * Q2.conjugate();
    const Vector translation = T1 - relative * T2;
    const Quaternion rotation = q.cast<T>().conjugate() * relative;
    Eigen::Map<Vector> rt(residuals), rr(residuals + 3);
    rt = (translation - t.cast<T>()) * T(100);
    rr = rotation.vec() * T(rotation.w() < T(0) ? -200 : 200);
    return true;
  }
};

/// Moves the poses (T_camera_world by keyframe) so that all edges fit as well as they can; `fixed`
/// stays. Ceres. Deterministic. False if nothing was solved.
inline bool optimize_pose_graph(std::map<KeyframeId, Eigen::Isometry3d>& poses,
                                const std::vector<PoseGraphEdge>& edges, KeyframeId fixed,
                                int max_iterations = 30) {
  std::map<KeyframeId, PoseBlock> blocks;
  ceres::Problem problem;
  for (const auto& [id, T] : poses)
    add_pose(problem, blocks.try_emplace(id, id, T, id == fixed).first->second);
  for (const PoseGraphEdge& e : edges) {
    PoseBlock &a = blocks.at(e.first), &b = blocks.at(e.second);
    const Eigen::Isometry3d& T = e.T_first_second;
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<PoseGraphCost, 6, 4, 3, 4, 3>(
            new PoseGraphCost{Eigen::Quaterniond(T.linear()), T.translation()}),
        nullptr, a.q.coeffs().data(), a.t.data(), b.q.coeffs().data(), b.t.data());
  }
  ceres::Solver::Summary summary;
  ceres::Solve(deterministic_options(ceres::SPARSE_NORMAL_CHOLESKY, max_iterations), &problem,
               &summary);
  if (!summary.IsSolutionUsable()) return false;
  for (auto& [id, T] : poses) T = blocks.at(id).pose();
  return true;
}

}  // namespace stillpoint::rgbd_slam
