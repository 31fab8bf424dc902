// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <ceres/ceres.h>
#include <ceres/version.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <map>
#include <mutex>
#include <vector>

#include "stillpoint/backends/rgbd_slam/fair_mutex.hpp"
#include "stillpoint/backends/rgbd_slam/map.hpp"
#include "stillpoint/backends/rgbd_slam/map_changes.hpp"
#include "stillpoint/backends/rgbd_slam/tracked_frame.hpp"

namespace stillpoint::rgbd_slam {

/// A pose as Ceres sees it.
struct PoseBlock {
  KeyframeId id;
  bool fixed;
  Eigen::Quaterniond q;
  Eigen::Vector3d t;

  PoseBlock(KeyframeId keyframe, const Eigen::Isometry3d& T, bool is_fixed)
      : id(keyframe), fixed(is_fixed), q(T.linear()), t(T.translation()) {}
  Eigen::Isometry3d pose() const { return Eigen::Translation3d(t) * q.normalized(); }
};

/// Makes a pose known to a problem: its four numbers (x, y, z, w) are a unit quaternion.
inline void add_pose(ceres::Problem& problem, PoseBlock& pose) {
  problem.AddParameterBlock(pose.q.coeffs().data(), 4);
  problem.AddParameterBlock(pose.t.data(), 3);
#if CERES_VERSION_MAJOR > 2 || (CERES_VERSION_MAJOR == 2 && CERES_VERSION_MINOR >= 1)
  problem.SetManifold(pose.q.coeffs().data(), new ceres::EigenQuaternionManifold);
#else
  problem.SetParameterization(pose.q.coeffs().data(), new ceres::EigenQuaternionParameterization);
#endif
  if (!pose.fixed) return;
  problem.SetParameterBlockConstant(pose.q.coeffs().data());
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
    Eigen::Vector3d position;
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

  Eigen::Vector3d in_camera(const Residual& r) const {
    return poses[r.pose].pose() * points[r.point].position;
  }
};

/// Reprojection (two rows, in sigmas) and inverse depth (one row; zero without depth). With its own
/// derivatives: automatic ones take a quarter of the mapping's time.
class ReprojectionCost final : public ceres::SizedCostFunction<3, 4, 3, 3> {
 public:
  ReprojectionCost(const Camera& camera, const BundleProblem::Residual& seen, bool use_depth)
      : camera_(camera), seen_(seen), use_depth_(use_depth) {}

  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override {
    const Eigen::Map<const Eigen::Quaterniond> q(parameters[0]);
    const Eigen::Map<const Eigen::Vector3d> t(parameters[1]), point(parameters[2]);
    const Eigen::Matrix3d R = q.toRotationMatrix();
    const Eigen::Vector3d p = R * point + t;
    // A point that a step took behind the camera counts as a far miss, without a pull in depth.
    const bool front = p.z() > 0.02;
    const double iz = 1 / (front ? p.z() : 0.02);
    const double per_px = 1 / seen_.sigma_px,
                 per_depth = use_depth_ ? 1 / seen_.sigma_inverse_depth : 0;
    const double fx = camera_.fx * per_px, fy = camera_.fy * per_px;
    residuals[0] = fx * p.x() * iz + (camera_.cx - seen_.pixel.x()) * per_px;
    residuals[1] = fy * p.y() * iz + (camera_.cy - seen_.pixel.y()) * per_px;
    residuals[2] = (iz - seen_.inverse_depth) * per_depth;
    if (!jacobians) return true;
    using Block = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
    const double iz2 = front ? iz * iz : 0;
    Block by_p;
    by_p << fx * iz, 0, -fx * p.x() * iz2, 0, fy * iz, -fy * p.y() * iz2, 0, 0, -iz2 * per_depth;
    if (jacobians[0]) {
      // Of q X q* by (x, y, z, w).
      const Eigen::Vector3d v = q.vec(), X = point;
      Eigen::Matrix<double, 3, 4> by_q;
      by_q.leftCols<3>() = v.dot(X) * Eigen::Matrix3d::Identity() + v * X.transpose() -
                           X * v.transpose() - q.w() * cross_matrix(X);
      by_q.col(3) = q.w() * X + v.cross(X);
      Eigen::Map<Eigen::Matrix<double, 3, 4, Eigen::RowMajor>> by_pose(jacobians[0]);
      by_pose = 2 * by_p * by_q;
    }
    if (jacobians[1]) Eigen::Map<Block>(jacobians[1], 3, 3) = by_p;
    if (jacobians[2]) Eigen::Map<Block>(jacobians[2], 3, 3) = by_p * R;
    return true;
  }

 private:
  static Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& v) {
    Eigen::Matrix3d m;
    m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
    return m;
  }

  const Camera& camera_;
  const BundleProblem::Residual& seen_;
  bool use_depth_;
};

/// Copies the given keyframes, the points that they see, and, fixed, every other keyframe that sees
/// these. The first keyframe of the map is always fixed: it is the origin.
inline BundleProblem collect_bundle(const Map& map, const CameraModel& model,
                                    const std::vector<KeyframeId>& free_keyframes) {
  BundleProblem b;
  std::map<KeyframeId, std::size_t> index_of;
  const auto add_pose = [&](KeyframeId id, bool fixed) {
    if (!index_of.emplace(id, b.poses.size()).second) return;
    b.poses.emplace_back(id, map.keyframe(id)->T_camera_world, fixed);
  };
  for (const KeyframeId id : free_keyframes) add_pose(id, !map.keyframe(id)->parent);
  for (const PointId point_id : map.points_of(free_keyframes)) {
    const MapPoint& p = *map.point(point_id);
    const double repeated = model.noise.sensor.repeated(p.observations.size());
    for (const Observation& o : p.observations) {
      add_pose(o.keyframe, true);
      const FrameKeypoint& k = map.keypoint(o);
      const double inverse_depth = k.depth_m > 0 ? 1.0 / k.depth_m : 0;
      b.residuals.push_back({index_of.at(o.keyframe), b.points.size(), k.pixel(), inverse_depth,
                             repeated * model.noise.sigma_inverse_depth(inverse_depth),
                             model.sigma_px(k)});
    }
    b.points.push_back({point_id, p.position});
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
  const auto depth_fits = [&](const BundleProblem::Residual& r) {
    const double z = r.inverse_depth > 0 ? b.in_camera(r).z() : 0;
    return z > 0.02 &&
           std::abs(1 / z - r.inverse_depth) < 3 * model.noise.sigma_inverse_depth(r.inverse_depth);
  };
  ceres::Problem::Options problem_options;
  problem_options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(problem_options);
  ceres::HuberLoss huber(std::sqrt(kChi2));
  auto* ordering = new ceres::ParameterBlockOrdering;
  for (BundleProblem::Point& point : b.points) {
    problem.AddParameterBlock(point.position.data(), 3);
    ordering->AddElementToGroup(point.position.data(), 0);
  }
  for (PoseBlock& pose : b.poses) {
    add_pose(problem, pose);
    ordering->AddElementToGroup(pose.q.coeffs().data(), 1);
    ordering->AddElementToGroup(pose.t.data(), 1);
  }
  for (const BundleProblem::Residual& r : b.residuals)
    problem.AddResidualBlock(new ReprojectionCost(model.camera, r, depth_fits(r)), &huber,
                             b.poses[r.pose].q.coeffs().data(), b.poses[r.pose].t.data(),
                             b.points[r.point].position.data());
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
    const Eigen::Vector3d p = b.in_camera(r);
    r.inlier = p.z() > 0.02 && (model.camera.project(p) - r.pixel).squaredNorm() <=
                                   kPixelChi2 * r.sigma_px * r.sigma_px;
  }
  return true;
}

/// Adjusts keyframes (none named: all) and the points that they see, and takes back the
/// observations that do not fit. Solves without the lock; what tracking adds meanwhile moves along.
/// With the lock O(map), and a pass over the points adjusted.
inline void adjust_keyframes(Map& map, FairMutex& lock, const CameraModel& model,
                             const std::vector<KeyframeId>& keyframes, int max_iterations,
                             const std::atomic<bool>* stop = nullptr) {
  const bool all = keyframes.empty();
  BundleProblem b;
  std::map<KeyframeId, Eigen::Isometry3d> poses;
  {
    const std::lock_guard<FairMutex> guard(lock);
    b = collect_bundle(map, model, all ? map.keyframe_ids() : keyframes);
    poses = map.poses();
  }
  if (!solve_bundle(b, model, max_iterations, stop, all)) return;
  for (const PoseBlock& pose : b.poses)
    if (!pose.fixed) poses[pose.id] = pose.pose();
  const std::lock_guard<FairMutex> guard(lock);
  move_map(map, poses);
  for (const BundleProblem::Point& point : b.points)
    if (MapPoint* p = map.point(point.id)) p->position = point.position;
  for (const BundleProblem::Residual& r : b.residuals)
    if (!r.inlier) map.forget(b.points[r.point].id, b.poses[r.pose].id);
  for (const BundleProblem::Point& point : b.points)
    if (MapPoint* p = map.point(point.id)) map.refresh(*p);
}

}  // namespace stillpoint::rgbd_slam
