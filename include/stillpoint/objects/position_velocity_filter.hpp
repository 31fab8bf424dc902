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
  using Matrix6 = Eigen::Matrix<double, 6, 6, Eigen::DontAlign>;

  /// Starts at a measured position, with a velocity of 0 give or take `velocity_sigma`.
  void start(const Eigen::Vector3d& position, const Eigen::Matrix3d& covariance,
             double velocity_sigma) {
    p_ = position, v_ = Eigen::Vector3d::Zero();
    P_pp_ = covariance, P_pv_ = Eigen::Matrix3d::Zero();
    P_vv_ = velocity_sigma * velocity_sigma * Eigen::Matrix3d::Identity();
  }

  /// Goes on by `seconds` >= 0; in a second the velocity changes by `acceleration` m/s (one
  /// standard deviation of each axis).
  void predict(double seconds, double acceleration) {
    p_ += seconds * v_;
    P_pp_ += seconds * (P_pv_ + P_pv_.transpose());
    P_pp_ += seconds * seconds * P_vv_;
    P_pv_ += seconds * P_vv_;
    const double q = acceleration * acceleration * seconds;
    P_pp_.diagonal().array() += q * seconds * seconds / 3;
    P_pv_.diagonal().array() += q * seconds / 2;
    P_vv_.diagonal().array() += q;
  }

  /// Takes a measured position with its covariance.
  void correct(const Eigen::Vector3d& position, const Eigen::Matrix3d& covariance) {
    const Eigen::Matrix3d S = P_pp_ + covariance, S_inverse = S.inverse();
    const Eigen::Matrix3d K_p = P_pp_ * S_inverse, K_v = P_pv_.transpose() * S_inverse;
    const Eigen::Vector3d off = position - p_;
    p_ += K_p * off;
    v_ += K_v * off;
    // Each product is symmetric or a sum of squares whatever the rounding: P_pp in Joseph's form.
    const Eigen::Matrix3d rest = Eigen::Matrix3d::Identity() - K_p;
    P_vv_ -= transformed(S, K_v);
    P_pp_ = transformed(P_pp_, rest) + transformed(covariance, K_p);
    P_pv_ = (rest * P_pv_).eval();
  }

  /// Squared Mahalanobis distance of a measured position from the predicted one.
  double distance2(const Eigen::Vector3d& position, const Eigen::Matrix3d& covariance) const {
    const Eigen::Matrix3d S = P_pp_ + covariance, S_inverse = S.inverse();
    const Eigen::Vector3d off = position - p_, weighted = S_inverse * off;
    return off.dot(weighted);
  }

  const Eigen::Vector3d& position() const { return p_; }
  const Eigen::Vector3d& velocity() const { return v_; }
  /// Of (position, velocity), both rotated by R.
  Matrix6 covariance(const Eigen::Matrix3d& R = Eigen::Matrix3d::Identity()) const {
    const Eigen::Matrix3d P_pv = transformed(P_pv_, R);
    Matrix6 P;
    P.topLeftCorner<3, 3>() = transformed(P_pp_, R);
    P.topRightCorner<3, 3>() = P_pv;
    P.bottomLeftCorner<3, 3>() = P_pv.transpose();
    P.bottomRightCorner<3, 3>() = transformed(P_vv_, R);
    return P;
  }

 private:
  // A P A^T.
  static Eigen::Matrix3d transformed(const Eigen::Matrix3d& P, const Eigen::Matrix3d& A) {
    const Eigen::Matrix3d AP = A * P;
    return AP * A.transpose();
  }

  Eigen::Vector3d p_ = Eigen::Vector3d::Zero(), v_ = Eigen::Vector3d::Zero();
  // Blocks of the covariance of (position, velocity).
  Eigen::Matrix3d P_pp_ = Eigen::Matrix3d::Identity(), P_pv_ = Eigen::Matrix3d::Zero(),
                  P_vv_ = Eigen::Matrix3d::Identity();
};

}  // namespace stillpoint
