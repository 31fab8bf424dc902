// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "stillpoint/core/camera.hpp"
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
  int index = -1;
};

/// How well a camera measures: the weights of pose and bundle adjustment.
struct NoiseModel {
  /// Of a keypoint on pyramid level 0; multiplied by the level's scale.
  double sigma_px = 0.7;
  /// The same for a keypoint that was aligned with the point's patch.
  double sigma_refined_px = 0.2;
  /// Of depths.
  SensorModel sensor;

  /// Standard deviation of 1/depth where `inverse_depth` was measured, 1/m.
  double sigma_inverse_depth(double inverse_depth) const {
    return std::sqrt(sensor.inverse_depth_variance(inverse_depth));
  }
};

/// Exponential of a twist (translation, rotation).
inline Eigen::Isometry3d se3_exp(const Eigen::Matrix<double, 6, 1>& x) {
  const Eigen::Vector3d w = x.tail<3>();
  const double angle = w.norm();
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  Eigen::Matrix3d W;
  W << 0, -w.z(), w.y(), w.z(), 0, -w.x(), -w.y(), w.x(), 0;
  double a = 0.5, b = 1.0 / 6;
  if (angle > 1e-8) {
    a = (1 - std::cos(angle)) / (angle * angle);
    b = (angle - std::sin(angle)) / (angle * angle * angle);
    T.linear() = Eigen::AngleAxisd(angle, w / angle).toRotationMatrix();
  } else {
    T.linear() = Eigen::Matrix3d::Identity() + W;
  }
  T.translation() = x.head<3>() + a * (W * x.head<3>()) + b * (W * W * x.head<3>());
  return T;
}

/// Errors at 95 % of a chi-square distribution: of a pixel (two numbers) and of a depth (one).
inline constexpr double kPixelChi2 = 5.991, kDepthChi2 = 3.841;

/// How far an observation is from a pose. `p`: in camera coordinates; the others only if `front`.
struct PoseErrors {
  double pixel_chi2, depth_chi2;
  Eigen::Vector2d pixel;
  double depth;
  Eigen::Vector3d p;
  bool front;
};

inline PoseErrors pose_errors(const Camera& camera, const NoiseModel& noise,
                              const PoseObservation& o, const Eigen::Isometry3d& T_camera_world) {
  PoseErrors e;
  e.p = T_camera_world * o.point;
  e.front = e.p.z() > 0.05;
  if (!e.front) return e;
  e.pixel = camera.project(e.p) - o.pixel;
  e.pixel_chi2 = e.pixel.squaredNorm() / (o.sigma_px * o.sigma_px);
  e.depth = o.inverse_depth > 0 ? 1 / e.p.z() - o.inverse_depth : 0;
  e.depth_chi2 = e.depth * e.depth / noise.sensor.inverse_depth_variance(o.inverse_depth);
  return e;
}

/// Refines T_camera_world on observations with Huber losses on pixel and inverse depth.
///
/// Levenberg-Marquardt on six unknowns with exact derivatives, in four rounds; after each, what
/// does not fit (chi square at 95 %) is set aside, and taken in again if it fits later. Sets
/// `inlier` of each observation and returns their number. With `start_gate` > 0, observations off
/// by more than that many times the limit at the given pose are left out of the first round: for
/// lists that may hold any share of wrong ones, and a pose that is already good. A small solver of
/// our own: it runs up to three times per frame, 10 times as fast as a general one. O(n).
inline int optimize_pose(const Camera& camera, const NoiseModel& noise,
                         std::vector<PoseObservation>& observations,
                         Eigen::Isometry3d& T_camera_world, double start_gate = 0) {
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  using Matrix6 = Eigen::Matrix<double, 6, 6>;
  const auto rho = [](double chi2, double limit) {
    return chi2 <= limit ? chi2 : 2 * std::sqrt(chi2 * limit) - limit;
  };
  const auto weight = [](double chi2, double limit) {
    return chi2 <= limit ? 1.0 : std::sqrt(limit / chi2);
  };
  using Errors = PoseErrors;
  const auto errors_of = [&](const PoseObservation& o, const Eigen::Isometry3d& T) {
    return pose_errors(camera, noise, o, T);
  };
  const auto total_cost = [&](const Eigen::Isometry3d& T, bool robust) {
    double cost = 0;
    for (const PoseObservation& o : observations) {
      if (!o.inlier) continue;
      const Errors e = errors_of(o, T);
      if (!e.front) {
        cost += 100 * kPixelChi2;
        continue;
      }
      cost += robust ? rho(e.pixel_chi2, kPixelChi2) : e.pixel_chi2;
      if (o.depth_inlier) cost += robust ? rho(e.depth_chi2, kDepthChi2) : e.depth_chi2;
    }
    return cost;
  };

  for (PoseObservation& o : observations) {
    o.inlier = o.depth_inlier = true;
    if (start_gate <= 0) continue;
    const Errors e = errors_of(o, T_camera_world);
    o.inlier = e.front && e.pixel_chi2 <= start_gate * kPixelChi2;
    o.depth_inlier = e.front && e.depth_chi2 <= start_gate * kDepthChi2;
  }
  int inliers = static_cast<int>(observations.size());
  for (int round = 0; round < 4; ++round) {
    const bool robust = round < 3;
    double lambda = 1e-6;
    double cost = total_cost(T_camera_world, robust);
    for (int iteration = 0; iteration < 10; ++iteration) {
      Matrix6 H = Matrix6::Zero();
      Vector6 g = Vector6::Zero();
      for (const PoseObservation& o : observations) {
        if (!o.inlier) continue;
        const Errors e = errors_of(o, T_camera_world);
        if (!e.front) continue;
        const double x = e.p.x(), y = e.p.y(), z = e.p.z();
        const double iz = 1 / z, iz2 = iz * iz;
        // Rows: d(u), d(v) over (translation, rotation) of a step on the left.
        Eigen::Matrix<double, 2, 6> J;
        J << camera.fx * iz, 0, -camera.fx * x * iz2, -camera.fx * x * y * iz2,
            camera.fx * (1 + x * x * iz2), -camera.fx * y * iz, 0, camera.fy * iz,
            -camera.fy * y * iz2, -camera.fy * (1 + y * y * iz2), camera.fy * x * y * iz2,
            camera.fy * x * iz;
        const double w =
            (robust ? weight(e.pixel_chi2, kPixelChi2) : 1) / (o.sigma_px * o.sigma_px);
        H.noalias() += w * J.transpose() * J;
        g.noalias() += w * J.transpose() * e.pixel;
        if (o.inverse_depth > 0 && o.depth_inlier) {
          Vector6 d;
          d << 0, 0, -iz2, -y * iz2, x * iz2, 0;
          const double wd = (robust ? weight(e.depth_chi2, kDepthChi2) : 1) /
                            noise.sensor.inverse_depth_variance(o.inverse_depth);
          H.noalias() += wd * d * d.transpose();
          g.noalias() += wd * e.depth * d;
        }
      }
      bool better = false;
      double gain = 0, step = 0;
      for (int trial = 0; trial < 5 && !better; ++trial) {
        Matrix6 damped = H;
        damped.diagonal() += lambda * H.diagonal() + Vector6::Constant(1e-9);
        const Vector6 delta = -damped.ldlt().solve(g);
        if (!delta.allFinite()) return 0;
        const Eigen::Isometry3d T = se3_exp(delta) * T_camera_world;
        const double next = total_cost(T, robust);
        better = next <= cost;
        if (better) {
          gain = cost - next, step = delta.norm();
          cost = next, T_camera_world = T, lambda = std::max(1e-9, lambda * 0.1);
        } else {
          lambda = std::max(1e-4, lambda * 10);
        }
      }
      if (!better || gain < 1e-4 * cost || step < 1e-7) break;
    }
    inliers = 0;
    for (PoseObservation& o : observations) {
      const Errors e = errors_of(o, T_camera_world);
      o.inlier = e.front && e.pixel_chi2 <= kPixelChi2;
      o.depth_inlier = e.front && e.depth_chi2 <= kDepthChi2;
      // A point whose depth is far off is another point, however well its pixel fits.
      if (e.front && e.depth_chi2 > 9 * kDepthChi2) o.inlier = false;
      inliers += o.inlier;
    }
    if (inliers < 6) break;
  }
  // Many products of rotations: keep the matrix orthonormal.
  T_camera_world.linear() =
      Eigen::Quaterniond(T_camera_world.linear()).normalized().toRotationMatrix();
  return inliers;
}

}  // namespace stillpoint::rgbd_slam
