// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <ceres/ceres.h>

#include <Eigen/Geometry>
#include <cstddef>
#include <map>
#include <memory>
#include <vector>

#include "stillpoint/backends/rgbd_slam/bundle_adjustment.hpp"

namespace stillpoint::rgbd_slam {

/// A measured relative pose T_first_second between two keyframes.
struct PoseGraphEdge {
  KeyframeId first, second;
  Eigen::Isometry3d T_first_second;
  double weight = 1;
};

/// Difference between an edge and the poses of its ends: translation in centimetres, rotation in
/// hundredths of a radian, so that both weigh alike at the depth of a room.
struct PoseGraphCost {
  PoseGraphCost(const Eigen::Isometry3d& T, double weight)
      : q(T.linear()), t(T.translation()), scale(100 * weight) {}

  template <class T>
  bool operator()(const T* q1, const T* t1, const T* q2, const T* t2, T* residuals) const {
    using Vector = Eigen::Matrix<T, 3, 1>;
    using Quaternion = Eigen::Quaternion<T>;
    const Eigen::Map<const Quaternion> Q1(q1), Q2(q2);
    const Eigen::Map<const Vector> T1(t1), T2(t2);
    const Quaternion relative = Q1 * Q2.conjugate();
    const Vector translation = T1 - relative * T2;
    const Quaternion turn = q.cast<T>().conjugate() * relative;
    Eigen::Map<Vector> rt(residuals), rr(residuals + 3);
    rt = (translation - t.cast<T>()) * T(scale);
    rr = turn.vec() * T(turn.w() < T(0) ? -2 * scale : 2 * scale);
    return true;
  }

  Eigen::Quaterniond q;
  Eigen::Vector3d t;
  double scale;
};

/// Moves the poses (T_camera_world by keyframe) so that all edges fit as well as they can; `fixed`
/// stays. Ceres. Deterministic. False if nothing was solved.
inline bool optimize_pose_graph(std::map<KeyframeId, Eigen::Isometry3d>& poses,
                                const std::vector<PoseGraphEdge>& edges, KeyframeId fixed,
                                int max_iterations = 30) {
  if (edges.empty() || poses.size() < 2) return false;
  std::map<KeyframeId, PoseBlock> blocks;
  ceres::Problem problem;
  for (const auto& [id, T] : poses) {
    PoseBlock& b = blocks[id];
    b = PoseBlock(id, T, id == fixed);
    problem.AddParameterBlock(b.q.data(), 4);
    problem.AddParameterBlock(b.t.data(), 3);
    set_quaternion(problem, b.q.data());
    if (!b.fixed) continue;
    problem.SetParameterBlockConstant(b.q.data());
    problem.SetParameterBlockConstant(b.t.data());
  }
  for (const PoseGraphEdge& e : edges) {
    PoseBlock &a = blocks.at(e.first), &b = blocks.at(e.second);
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<PoseGraphCost, 6, 4, 3, 4, 3>(
                                 new PoseGraphCost(e.T_first_second, e.weight)),
                             nullptr, a.q.data(), a.t.data(), b.q.data(), b.t.data());
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  options.sparse_linear_algebra_library_type = ceres::EIGEN_SPARSE;
  options.max_num_iterations = max_iterations;
  options.num_threads = 1;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  if (!summary.IsSolutionUsable()) return false;
  for (auto& [id, T] : poses) T = blocks.at(id).pose();
  return true;
}

}  // namespace stillpoint::rgbd_slam
