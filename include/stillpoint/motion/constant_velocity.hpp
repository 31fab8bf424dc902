// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <optional>

#include "stillpoint/core/rigid_motion.hpp"

namespace stillpoint {

/// Predicts a camera's motion from a host's last two poses, for hosts that give their poses but
/// keep their own prediction to themselves. O(1), not thread-safe.
class ConstantVelocity {
 public:
  /// Poses further apart, or further back, than this say nothing of the present velocity.
  static constexpr double kMaxGap_s = 0.25;

  /// Tells the pose that the host tracked for the frame of this timestamp (seconds).
  void add(double timestamp_s, const Eigen::Isometry3d& T_world_camera) {
    const double step_s = timestamp_s - last_s_;
    moving_ = known_ && step_s > 0 && step_s < kMaxGap_s;
    if (moving_) {
      const Eigen::Isometry3d T_new_last = T_world_camera.inverse() * T_world_last_;
      rotation_per_s_ = detail::rotation_vector(T_new_last.linear()) / step_s;
      speed_per_s_ = T_new_last.translation() / step_s;
    }
    T_world_last_ = T_world_camera;
    last_s_ = timestamp_s;
    known_ = true;
  }

  /// Forgets all poses: the host is lost, or has started anew.
  void reset() { known_ = moving_ = false; }

  /// Motion between two frames, the second of which is new: maps points of the camera at `from_s`
  /// into the one at `to_s`. No value without two fresh poses.
  std::optional<Eigen::Isometry3d> predict(double from_s, double to_s) const {
    const double step_s = to_s - from_s;
    if (!moving_ || !(step_s > 0 && step_s < kMaxGap_s) || !(std::abs(to_s - last_s_) < kMaxGap_s))
      return std::nullopt;
    Eigen::Isometry3d T_to_from = Eigen::Isometry3d::Identity();
    T_to_from.linear() = detail::rotation_matrix(rotation_per_s_ * step_s);
    T_to_from.translation() = speed_per_s_ * step_s;
    return T_to_from;
  }

 private:
  Eigen::Isometry3d T_world_last_ = Eigen::Isometry3d::Identity();
  Eigen::Vector3d rotation_per_s_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d speed_per_s_ = Eigen::Vector3d::Zero();
  double last_s_ = 0;
  bool known_ = false, moving_ = false;
};

}  // namespace stillpoint
