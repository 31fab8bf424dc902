// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "stillpoint/core/camera.hpp"
#include "stillpoint/core/error.hpp"
#include "stillpoint/core/normal_equations.hpp"
#include "stillpoint/core/rigid_motion.hpp"
#include "stillpoint/sensor/sensor_model.hpp"

namespace stillpoint::rgbd_slam {

/// One sight of a known point.
struct PoseObservation {
  /// World coordinates, metres.
  Eigen::Vector3d point;
  /// Undistorted pixel.
  Eigen::Vector2d pixel;
  /// 1 / measured depth; 0 when there is none.
  double inverse_depth = 0;
  /// Standard deviation of `pixel`.
  double sigma_px = 1;
  /// Set by optimize_pose(): the pixel fits; the depth fits too.
  bool inlier = true, depth_inlier = true;
  /// The caller's.
  std::size_t index = 0;
};

/// How well a camera measures: the weights of pose and bundle adjustment.
struct NoiseModel {
  /// Of a keypoint on pyramid level 0; multiplied by the level's scale.
  double sigma_px = 0.7;
  /// The same for a keypoint that was aligned with the point's patch.
  double sigma_refined_px = 0.2;
  /// Of depths.
  SensorModel sensor;

  /// Throws Error for numbers that no sensor has.
  void check() const {
    for (const double sigma : {sigma_px, sigma_refined_px})
      stillpoint::detail::check(sigma > 0 && std::isfinite(sigma), [&] {
        return "NoiseModel: sigma_px, sigma_refined_px: expected pixels, more than 0, found " +
               std::to_string(sigma);
      });
    sensor.check();
  }

  /// Standard deviation of 1/depth where `inverse_depth` was measured, 1/m.
  double sigma_inverse_depth(double inverse_depth) const {
    return std::sqrt(sensor.inverse_depth_variance(inverse_depth));
  }
};

/// Errors at 95 % of a chi-square distribution: of a pixel (two numbers) and of a depth (one).
inline constexpr double kPixelChi2 = 5.991, kDepthChi2 = 3.841;

/// How far an observation is from a pose.
struct PoseError {
  /// The point in camera coordinates; if it is not in front, nothing else is set.
  Eigen::Vector3d p;
  bool front;
  /// Pixel and inverse depth (0 without one), and their variances.
  Eigen::Vector3d error, variance;
  double pixel_chi2, depth_chi2;

  PoseError(const Camera& camera, const NoiseModel& noise, const PoseObservation& o,
            const Eigen::Isometry3d& T_camera_world)
      : p(T_camera_world * o.point), front(p.z() > 0.05) {
    if (!front) return;
    error << camera.project(p) - o.pixel, o.inverse_depth > 0 ? 1 / p.z() - o.inverse_depth : 0;
    const double sigma2 = o.sigma_px * o.sigma_px;
    variance << sigma2, sigma2, noise.sensor.inverse_depth_variance(o.inverse_depth);
    pixel_chi2 = error.head<2>().squaredNorm() / sigma2;
    depth_chi2 = error.z() * error.z() / variance.z();
  }
};

/// Refines T_camera_world on observations with Huber losses on pixel and inverse depth.
///
/// Gauss-Newton on six unknowns in four rounds; after each, what does not fit (chi square at 95 %)
/// is set aside, and taken in again if it fits later. Sets `inlier` of each observation and returns
/// their number. With `start_gate` > 0, observations off by more than that many times the limit at
/// the given pose are left out of the first round: for lists that may hold any share of wrong ones,
/// and a pose that is already good. A small solver of our own: it runs a few times per frame,
/// 10 times as fast as a general one. O(n).
inline int optimize_pose(const Camera& camera, const NoiseModel& noise,
                         std::vector<PoseObservation>& observations,
                         Eigen::Isometry3d& T_camera_world, double start_gate = 0) {
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  using Matrix6 = Eigen::Matrix<double, 6, 6>;
  // Sets `inlier` and `depth_inlier` of each: within `gate` times the limits.
  const auto select = [&](double gate) {
    int inliers = 0;
    for (PoseObservation& o : observations) {
      const PoseError e(camera, noise, o, T_camera_world);
      o.inlier = e.front && e.pixel_chi2 <= gate * kPixelChi2;
      o.depth_inlier = e.front && e.depth_chi2 <= gate * kDepthChi2;
      // A point whose depth is far off is another point, however well its pixel fits.
      if (e.front && gate <= 1 && e.depth_chi2 > 9 * kDepthChi2) o.inlier = false;
      inliers += o.inlier;
    }
    return inliers;
  };
  // A step (translation, rotation) on the left of the pose.
  const auto step = [&](bool robust) -> std::optional<Vector6> {
    const auto weight = [&](double chi2, double limit) {
      return robust && chi2 > limit ? std::sqrt(limit / chi2) : 1.0;
    };
    Matrix6 H = Matrix6::Zero();
    Vector6 g = Vector6::Zero();
    for (const PoseObservation& o : observations) {
      if (!o.inlier) continue;
      const PoseError e(camera, noise, o, T_camera_world);
      if (!e.front) continue;
      const double iz = 1 / e.p.z(), x = e.p.x() * iz, y = e.p.y() * iz;
      const double fx = camera.fx, fy = camera.fy;
      Eigen::Matrix<double, 3, 6> J;
      J << fx * iz, 0, -fx * x * iz, -fx * x * y, fx * (1 + x * x), -fx * y,  //
          0, fy * iz, -fy * y * iz, -fy * (1 + y * y), fy * x * y, fy * x,    //
          0, 0, -iz * iz, -y * iz, x * iz, 0;
      const bool use_depth = o.inverse_depth > 0 && o.depth_inlier;
      const double pixel = weight(e.pixel_chi2, kPixelChi2);
      const double depth = use_depth ? weight(e.depth_chi2, kDepthChi2) : 0;
      const Eigen::Vector3d w = Eigen::Vector3d(pixel, pixel, depth).cwiseQuotient(e.variance);
      H.noalias() += J.transpose() * w.asDiagonal() * J;
      g.noalias() -= J.transpose() * w.cwiseProduct(e.error);
    }
    return stillpoint::detail::solve_normal_equations<6>(H, g);
  };
  for (PoseObservation& o : observations) o.inlier = o.depth_inlier = true;
  if (start_gate > 0) select(start_gate);
  int inliers = 0;
  for (int round = 0; round < 4; ++round) {
    for (int iteration = 0; iteration < 10; ++iteration) {
      const auto x = step(round < 3);
      if (!x) return 0;
      T_camera_world = stillpoint::detail::motion_of_step(*x) * T_camera_world;
      if (x->norm() < 1e-5) break;
    }
    inliers = select(1);
    if (inliers < 6) break;
  }
  stillpoint::detail::normalize_rotation(T_camera_world);
  return inliers;
}

}  // namespace stillpoint::rgbd_slam
