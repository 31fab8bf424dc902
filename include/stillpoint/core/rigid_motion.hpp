// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace stillpoint::detail {

// Plain types on purpose: an expression of Eigen that is a new type to each caller costs every
// program that includes it seconds.

/// The rotation vector of a rotation: its axis times its angle, radians.
inline Eigen::Vector3d rotation_vector(const Eigen::Matrix3d& R) {
  const Eigen::AngleAxisd rotated(R);
  return rotated.angle() * rotated.axis();
}

/// The angle of a rotation, radians, 0 to pi.
inline double rotation_angle(const Eigen::Matrix3d& R) { return Eigen::AngleAxisd(R).angle(); }

/// The rotation of a rotation vector.
inline Eigen::Matrix3d rotation_matrix(const Eigen::Vector3d& vector) {
  const double angle = vector.norm();
  if (!(angle > 1e-12)) return Eigen::Matrix3d::Identity();
  return Eigen::AngleAxisd(angle, vector / angle).toRotationMatrix();
}

/// Whether all numbers are finite, and the linear part is a rotation.
inline bool is_rigid(const Eigen::Isometry3d& T) {
  constexpr double kOff = 1e-3;  // how far a rotation matrix may be off one
  const Eigen::Matrix3d R = T.linear();
  return T.matrix().allFinite() && R.determinant() > 0 &&
         (R * R.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() < kOff;
}

/// The motion of a step of six unknowns: translation, then rotation vector.
inline Eigen::Isometry3d motion_of_step(const Eigen::Matrix<double, 6, 1>& step) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = rotation_matrix(step.tail<3>());
  T.translation() = step.head<3>();
  return T;
}

/// Makes the linear part a rotation again, which products of many rotations are not quite.
inline void normalize_rotation(Eigen::Isometry3d& T) {
  const Eigen::Matrix3d R = T.linear();
  T.linear() = Eigen::Quaterniond(R).normalized().toRotationMatrix();
}

}  // namespace stillpoint::detail
