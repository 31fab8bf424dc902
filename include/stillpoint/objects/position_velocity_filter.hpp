// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/LU>

namespace stillpoint {

/// Kalman filter of a point that moves at a constant velocity but for white noise in its
/// acceleration (Bar-Shalom, Li, Kirubarajan, Estimation with Applications to Tracking and
/// Navigation, 2001, section 6.2). Metres, seconds. O(1), no allocation.
class PositionVelocityFilter {
 public:
  using Vector6 = Eigen::Matrix<double, 6, 1, Eigen::DontAlign>;
  using Matrix6 = Eigen::Matrix<double, 6, 6, Eigen::DontAlign>;

  /// Starts at a measured position, with a velocity of 0 give or take `velocity_sigma`.
  void start(const Eigen::Vector3d& position, const Eigen::Matrix3d& covariance,
             double velocity_sigma) {
    x_.setZero();
    x_.head<3>() = position;
    P_.setZero();
    P_.topLeftCorner<3, 3>() = covariance;
    P_.bottomRightCorner<3, 3>() = velocity_sigma * velocity_sigma * Eigen::Matrix3d::Identity();
  }

  /// Goes on by `seconds` >= 0; in a second the velocity changes by `acceleration` m/s (one
  /// standard deviation of each axis).
  void predict(double seconds, double acceleration) {
    Eigen::Matrix<double, 6, 6> F = Eigen::Matrix<double, 6, 6>::Identity();
    F.topRightCorner<3, 3>() = seconds * Eigen::Matrix3d::Identity();
    const Eigen::Matrix<double, 6, 6> P = F * P_ * F.transpose();
    x_ = (F * x_).eval();
    const double q = acceleration * acceleration * seconds;
    const Eigen::Matrix3d one = Eigen::Matrix3d::Identity();
    P_ = P;
    P_.topLeftCorner<3, 3>() += q * seconds * seconds / 3 * one;
    P_.topRightCorner<3, 3>() += q * seconds / 2 * one;
    P_.bottomLeftCorner<3, 3>() += q * seconds / 2 * one;
    P_.bottomRightCorner<3, 3>() += q * one;
  }

  /// Takes a measured position with its covariance.
  void correct(const Eigen::Vector3d& position, const Eigen::Matrix3d& covariance) {
    const Eigen::Matrix<double, 6, 6> P = P_;
    const Eigen::Matrix3d S = P.topLeftCorner<3, 3>() + covariance;
    const Eigen::Matrix<double, 6, 3> K = P.leftCols<3>() * S.inverse();
    x_ += K * (position - x_.head<3>());
    // Joseph's form: stays symmetric and positive whatever the rounding.
    Eigen::Matrix<double, 6, 6> rest = Eigen::Matrix<double, 6, 6>::Identity();
    rest.leftCols<3>() -= K;
    P_ = rest * P * rest.transpose() + K * covariance * K.transpose();
  }

  /// Squared Mahalanobis distance of a measured position from the predicted one.
  double distance2(const Eigen::Vector3d& position, const Eigen::Matrix3d& covariance) const {
    const Eigen::Matrix3d S = P_.topLeftCorner<3, 3>() + covariance;
    const Eigen::Vector3d off = position - x_.head<3>();
    return off.dot(S.inverse() * off);
  }

  Eigen::Vector3d position() const { return x_.head<3>(); }
  Eigen::Vector3d velocity() const { return x_.tail<3>(); }
  /// Of (position, velocity).
  const Matrix6& covariance() const { return P_; }

 private:
  Vector6 x_ = Vector6::Zero();
  Matrix6 P_ = Matrix6::Identity();
};

}  // namespace stillpoint
