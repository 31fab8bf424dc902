// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <ceres/ceres.h>
#include <ceres/version.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <map>
#include <vector>

#include "stillpoint/backends/rgbd_slam/map.hpp"
#include "stillpoint/backends/rgbd_slam/map_changes.hpp"
#include "stillpoint/backends/rgbd_slam/tracked_frame.hpp"

namespace stillpoint::rgbd_slam {

/// A pose as Ceres sees it.
struct PoseBlock {
  KeyframeId id = kNone;
  bool fixed = false;
  std::array<double, 4> q{0, 0, 0, 1};
  std::array<double, 3> t{0, 0, 0};

  PoseBlock() = default;
  PoseBlock(KeyframeId keyframe, const Eigen::Isometry3d& T, bool is_fixed)
      : id(keyframe), fixed(is_fixed) {
    Eigen::Map<Eigen::Quaterniond>(q.data()) = Eigen::Quaterniond(T.linear()).normalized();
    Eigen::Map<Eigen::Vector3d>(t.data()) = T.translation();
  }
  Eigen::Isometry3d pose() const {
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.linear() = Eigen::Map<const Eigen::Quaterniond>(q.data()).normalized().toRotationMatrix();
    T.translation() = Eigen::Map<const Eigen::Vector3d>(t.data());
    return T;
  }
};

/// Makes a pose known to a problem: its four numbers (x, y, z, w) are a unit quaternion.
inline void add_pose(ceres::Problem& problem, PoseBlock& pose) {
  problem.AddParameterBlock(pose.q.data(), 4);
  problem.AddParameterBlock(pose.t.data(), 3);
#if CERES_VERSION_MAJOR > 2 || (CERES_VERSION_MAJOR == 2 && CERES_VERSION_MINOR >= 1)
  problem.SetManifold(pose.q.data(), new ceres::EigenQuaternionManifold);
#else
  problem.SetParameterization(pose.q.data(), new ceres::EigenQuaternionParameterization);
#endif
  if (!pose.fixed) return;
  problem.SetParameterBlockConstant(pose.q.data());
  problem.SetParameterBlockConstant(pose.t.data());
}

/// For the same result everywhere: Eigen's sums don't depend on which BLAS is installed, nor on
/// threads.
inline ceres::Solver::Options deterministic_options(ceres::LinearSolverType solver,
                                                    int max_iterations) {
  ceres::Solver::Options options;
  options.linear_solver_type = solver;
  options.sparse_linear_algebra_library_type = ceres::EIGEN_SPARSE;
  options.max_num_iterations = max_iterations;
  options.num_threads = 1;
  options.logging_type = ceres::SILENT;
  return options;
}

/// A piece of the map to be adjusted: a copy, so that the map is free while it is solved.
struct BundleProblem {
  struct Point {
    PointId id;
    std::array<double, 3> p;
  };
  struct Residual {
    std::size_t pose, point;
    Eigen::Vector2d pixel;
    double inverse_depth, sigma_inverse_depth, sigma_px;
    bool inlier = true;
  };
  std::vector<PoseBlock> poses;
  std::vector<Point> points;
  std::vector<Residual> residuals;
};

/// Reprojection (two rows, in sigmas) and inverse depth (one row; zero without depth), with exact
/// derivatives by quaternion (x, y, z, w), translation and point.
class ReprojectionCost final : public ceres::SizedCostFunction<3, 4, 3, 3> {
 public:
  ReprojectionCost(const Camera& camera, const BundleProblem::Residual& residual, bool use_depth)
      : fx_(camera.fx),
        fy_(camera.fy),
        cx_(camera.cx),
        cy_(camera.cy),
        pixel_(residual.pixel),
        inverse_depth_(residual.inverse_depth),
        pixel_weight_(1 / residual.sigma_px),
        depth_weight_(use_depth ? 1 / residual.sigma_inverse_depth : 0) {}

  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override {
    const Eigen::Map<const Eigen::Quaterniond> q(parameters[0]);
    const Eigen::Map<const Eigen::Vector3d> t(parameters[1]), X(parameters[2]);
    const Eigen::Matrix3d R = q.toRotationMatrix();
    const Eigen::Vector3d p = R * X + t;
    // A point that a step took behind the camera counts as a far miss, without a pull.
    const bool front = p.z() > 0.02;
    const double z = front ? p.z() : 0.02, iz = 1 / z;
    Eigen::Map<Eigen::Vector3d> r(residuals);
    r << (fx_ * p.x() * iz + cx_ - pixel_.x()) * pixel_weight_,
        (fy_ * p.y() * iz + cy_ - pixel_.y()) * pixel_weight_,
        (iz - inverse_depth_) * depth_weight_;
    if (!jacobians) return true;
    Eigen::Matrix3d by_p;
    by_p << fx_ * iz * pixel_weight_, 0, -fx_ * p.x() * iz * iz * pixel_weight_, 0,
        fy_ * iz * pixel_weight_, -fy_ * p.y() * iz * iz * pixel_weight_, 0, 0,
        -iz * iz * depth_weight_;
    if (!front) by_p.setZero();
    if (jacobians[0]) {
      // d(q X q*) over (x, y, z, w).
      const Eigen::Vector3d v = q.vec();
      Eigen::Matrix<double, 3, 4> by_q;
      by_q.leftCols<3>() = 2 * (v.dot(X) * Eigen::Matrix3d::Identity() + v * X.transpose() -
                                X * v.transpose() - q.w() * cross_matrix(X));
      by_q.col(3) = 2 * (q.w() * X + v.cross(X));
      Eigen::Map<Eigen::Matrix<double, 3, 4, Eigen::RowMajor>>(jacobians[0]).noalias() =
          by_p * by_q;
    }
    using Block = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
    if (jacobians[1]) Eigen::Map<Block>(jacobians[1], 3, 3) = by_p;
    if (jacobians[2]) Eigen::Map<Block>(jacobians[2], 3, 3).noalias() = by_p * R;
    return true;
  }

 private:
  double fx_, fy_, cx_, cy_;
  Eigen::Vector2d pixel_;
  double inverse_depth_, pixel_weight_, depth_weight_;
};

/// Copies the given keyframes, the points that they see, and, fixed, every other keyframe that sees
/// these. The first keyframe of the map is always fixed: it is the origin.
inline BundleProblem collect_bundle(const Map& map, const CameraModel& model,
                                    const std::vector<KeyframeId>& free_keyframes) {
  BundleProblem b;
  std::vector<int> pose_of(static_cast<std::size_t>(map.keyframe_end()), -1);
  std::vector<char> listed(static_cast<std::size_t>(map.point_end()), 0);
  const auto add_pose = [&](KeyframeId id, bool fixed) {
    pose_of[static_cast<std::size_t>(id)] = static_cast<int>(b.poses.size());
    b.poses.emplace_back(id, map.keyframe(id)->T_camera_world, fixed);
  };
  for (const KeyframeId id : free_keyframes) add_pose(id, map.keyframe(id)->parent == kNone);
  for (const KeyframeId id : free_keyframes)
    for (const PointId point_id : map.keyframe(id)->points) {
      const MapPoint* p = map.point(point_id);
      if (!p || listed[static_cast<std::size_t>(point_id)]) continue;
      listed[static_cast<std::size_t>(point_id)] = 1;
      b.points.push_back({point_id, {p->position.x(), p->position.y(), p->position.z()}});
      const double repeated = model.noise.sensor.repeated(p->observations.size());
      for (const Observation& o : p->observations) {
        if (pose_of[static_cast<std::size_t>(o.keyframe)] < 0) add_pose(o.keyframe, true);
        const FrameKeypoint& k = map.keypoint(o);
        const double inverse_depth = k.depth_m > 0 ? 1.0 / k.depth_m : 0;
        b.residuals.push_back(
            {static_cast<std::size_t>(pose_of[static_cast<std::size_t>(o.keyframe)]),
             b.points.size() - 1, k.pixel(), inverse_depth,
             repeated * model.noise.sigma_inverse_depth(inverse_depth), model.sigma_px(k)});
      }
    }
  return b;
}

/// Ends a solve once a flag is set; null: never.
struct StopWhenAsked final : ceres::IterationCallback {
  explicit StopWhenAsked(const std::atomic<bool>* stop) : flag(stop) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary&) override {
    return flag && flag->load() ? ceres::SOLVER_TERMINATE_SUCCESSFULLY : ceres::SOLVER_CONTINUE;
  }
  const std::atomic<bool>* flag;
};

/// Adjusts poses and points (Ceres, Huber loss), then marks the residuals that do not fit. `stop`
/// ends it early. The same input gives the same output. Returns false if nothing was solved.
inline bool solve_bundle(BundleProblem& b, const CameraModel& model, int max_iterations,
                         const std::atomic<bool>* stop = nullptr, bool global = false) {
  const bool any_free =
      std::any_of(b.poses.begin(), b.poses.end(), [](const PoseBlock& p) { return !p.fixed; });
  if (!any_free || b.residuals.size() < 10) return false;
  constexpr double kChi2 = 7.815;
  const auto in_camera = [&](const BundleProblem::Residual& r) -> Eigen::Vector3d {
    return b.poses[r.pose].pose() * Eigen::Map<const Eigen::Vector3d>(b.points[r.point].p.data());
  };
  const auto depth_fits = [&](const BundleProblem::Residual& r) {
    const double z = r.inverse_depth > 0 ? in_camera(r).z() : 0;
    return z > 0.02 &&
           std::abs(1 / z - r.inverse_depth) < 3 * model.noise.sigma_inverse_depth(r.inverse_depth);
  };
  ceres::Problem::Options problem_options;
  problem_options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(problem_options);
  ceres::HuberLoss huber(std::sqrt(kChi2));
  auto* ordering = new ceres::ParameterBlockOrdering;
  for (auto& point : b.points) {
    problem.AddParameterBlock(point.p.data(), 3);
    ordering->AddElementToGroup(point.p.data(), 0);
  }
  for (PoseBlock& pose : b.poses) {
    add_pose(problem, pose);
    ordering->AddElementToGroup(pose.q.data(), 1);
    ordering->AddElementToGroup(pose.t.data(), 1);
  }
  for (const BundleProblem::Residual& r : b.residuals)
    problem.AddResidualBlock(new ReprojectionCost(model.camera, r, depth_fits(r)), &huber,
                             b.poses[r.pose].q.data(), b.poses[r.pose].t.data(),
                             b.points[r.point].p.data());
  ceres::Solver::Options options =
      deterministic_options(global ? ceres::SPARSE_SCHUR : ceres::DENSE_SCHUR, max_iterations);
  options.linear_solver_ordering.reset(ordering);
  options.function_tolerance = 1e-4;
  StopWhenAsked stop_when_asked(stop);
  options.callbacks.push_back(&stop_when_asked);
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  if (!summary.IsSolutionUsable()) return false;
  for (BundleProblem::Residual& r : b.residuals) {
    const Eigen::Vector3d p = in_camera(r);
    r.inlier = p.z() > 0.02 && (model.camera.project(p) - r.pixel).squaredNorm() <=
                                   kPixelChi2 * r.sigma_px * r.sigma_px;
  }
  return true;
}

/// Writes a solved problem back and takes back the observations that do not fit. `global`: it was
/// of the whole map; what came in meanwhile moves along.
inline void apply_bundle(Map& map, const BundleProblem& b, bool global = false) {
  std::map<KeyframeId, Eigen::Isometry3d> poses;
  std::map<PointId, Eigen::Vector3d> points;
  for (const PoseBlock& pose : b.poses)
    if (global || !pose.fixed) poses[pose.id] = pose.pose();
  for (const BundleProblem::Point& point : b.points)
    points[point.id] = {point.p[0], point.p[1], point.p[2]};
  if (global) {
    move_map(map, poses, points);
  } else {
    for (const auto& [id, T] : poses)
      if (Keyframe* k = map.keyframe(id)) k->T_camera_world = T;
    for (const auto& [id, position] : points)
      if (MapPoint* p = map.point(id)) p->position = position;
  }
  for (const BundleProblem::Residual& r : b.residuals)
    if (!r.inlier) map.forget(b.points[r.point].id, b.poses[r.pose].id);
  for (const PointId id : map.point_ids())
    if (global || points.count(id)) map.refresh(*map.point(id));
}

}  // namespace stillpoint::rgbd_slam
