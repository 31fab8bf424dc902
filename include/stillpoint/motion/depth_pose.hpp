// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>

#include "stillpoint/core/rigid_motion.hpp"
#include "stillpoint/motion/delay_estimate.hpp"
#include "stillpoint/motion/depth_cells.hpp"
#include "stillpoint/motion/depth_registration.hpp"
#include "stillpoint/motion/depth_shot.hpp"
#include "stillpoint/motion/ego_motion.hpp"
#include "stillpoint/motion/free_space_map.hpp"
#include "stillpoint/motion/readout_estimate.hpp"
#include "stillpoint/sensor/sensor_model.hpp"

namespace stillpoint {

/// Where the depth camera is in the map of free space: predicted by the ego-motion, and registered
/// by the depth itself (DepthRegistration), which knows nothing of stamps. How the two differ while
/// the camera rotates tells how long after its stamp the depth is taken (DelayEstimate), and how
/// its rows lie beside each other how long they are read out (ReadoutEstimate). Both are taken into
/// account from then on.
///
/// Depth does not tell the displacement along a wall, so a large mover before a wall drags the
/// registered pose along, a little in each frame. The ego-motion, which sees the wall's texture,
/// holds it: where not all cells fit, predictions follow the registered poses within 0.2 s instead
/// of beginning at the last one.
class DepthPose {
 public:
  explicit DepthPose(const SensorModel& sensor = {}) : sensor_(sensor), registration_(sensor) {}

  /// The map is empty: poses begin anew, with the identity.
  void reset() {
    shot_ = DepthShot();
    predicted_ = Eigen::Isometry3d::Identity();
    registered_ = false;
  }

  /// Finds the pose of the cells of a frame whose depth was taken at `depth_s`. `moving`: one byte
  /// per cell, not 0 = moves by itself, and does not tell where the camera is; may be empty.
  /// O(cells).
  void locate(double depth_s, const DepthCells& cells, const std::vector<std::uint8_t>& moving,
              const EgoMotion& ego, const FreeSpaceMap& map) {
    const Eigen::Vector3d rotation_rad_s = ego.angular_velocity();
    const double rad_s = rotation_rad_s.norm();
    taken_s_ = depth_s + (delay().known() ? delay().mean_s : 0);
    const Eigen::Isometry3d ego_now = ego.pose_at(taken_s_);
    const DepthShot last = shot_;
    shot_.timestamp = depth_s;
    shot_.rad_s = rotation_rad_s.cast<float>();
    shot_.readout_s = readout().known() ? static_cast<float>(readout().mean_s) : 0;
    if (!map.empty()) {
      const Eigen::Isometry3d step = ego_at_depth_.inverse() * ego_now;
      const Eigen::Isometry3d from_last = last.T_map_depth * step;
      const bool compare = registered_;
      shot_.T_map_depth = predicted_ = followed(depth_s - last.timestamp) * step;
      const auto found =
          registration_.align(shot_, cells, moving, map, kRotationSigma + kRotationSigmaS * rad_s,
                              kTranslationSigmaM + kTranslationSigmaMS * rad_s);
      registered_ = found && found->fit > kLeastFit;
      if (registered_) {
        shot_.T_map_depth = found->T_map_depth;
        fit_ = found->fit;
        if (fit_ > kNothingMoves)
          readout_.add(shot_.readout_s + found->readout_off_s, found->readout_information);
      }
      // Large movers err alike in many frames.
      if (compare && registered_ && fit_ > kNothingMoves)
        delay_.add(rotation_rad_s, step.linear().transpose() * last_rad_s_,
                   detail::rotation_vector((from_last.inverse() * shot_.T_map_depth).linear()));
    }
    last_rad_s_ = rotation_rad_s;
    ego_at_depth_ = ego_now;
    const double spread_s = delay().known() ? delay().spread_s : sensor_.delay_s;
    const double timing_s = std::hypot(spread_s, sensor_.readout_s / std::sqrt(12.0));
    shot_.lateral_cells = cells_per_second(cells, rotation_rad_s) *
                          static_cast<float>(timing_s * (registered_ ? kLeftOfTiming : 1));
  }

  /// To be called after `ego` was given the host's pose of the last frame. Whether the pose is
  /// another one now.
  bool correct(const EgoMotion& ego) {
    const Eigen::Isometry3d ego_now = ego.pose_at(taken_s_);
    predicted_ = predicted_ * ego_at_depth_.inverse() * ego_now;
    ego_at_depth_ = ego_now;
    if (registered_) return false;
    shot_.T_map_depth = predicted_;
    return true;
  }

  /// Of the last frame.
  const DepthShot& shot() const { return shot_; }
  /// Share of its comparable cells whose depth agrees; empty: the pose is the predicted one.
  std::optional<double> fit() const { return registered_ ? std::optional(fit_) : std::nullopt; }
  /// How long after its stamp the depth is taken, as far as the frames since the start tell.
  const DepthDelay& delay() const { return delay_.delay(); }
  /// How long it takes to read it out, as far as the frames since the start tell.
  const DepthReadout& readout() const { return readout_.readout(); }

 private:
  // A frame fits the map if so many of its comparable cells do; people may hide half of it.
  static constexpr double kLeastFit = 0.4;
  // Standard deviations of a predicted pose: a part that is always there, and one that grows with
  // the camera's rotation, rad and m for 1 rad/s (timing, blur).
  static constexpr double kRotationSigma = 0.02, kRotationSigmaS = 0.02;
  static constexpr double kTranslationSigmaM = 0.01, kTranslationSigmaMS = 0.01;
  // What of the timing's error is left after registration: rows are read out one by one.
  static constexpr double kLeftOfTiming = 0.5;
  // How soon predictions follow registered poses, but where so many cells fit that nothing large
  // can drag these along.
  static constexpr double kFollowS = 0.2, kNothingMoves = 0.96;

  // Where the last frame was, for the prediction of one that comes `step_s` later.
  Eigen::Isometry3d followed(double step_s) const {
    if (!registered_) return predicted_;
    const double share = fit_ > kNothingMoves ? 1 : 1 - std::exp(-std::max(0.0, step_s) / kFollowS);
    const Eigen::Isometry3d off = predicted_.inverse() * shot_.T_map_depth;
    Eigen::Isometry3d towards = Eigen::Isometry3d::Identity();
    towards.linear() = detail::rotation_matrix(share * detail::rotation_vector(off.linear()));
    towards.translation() = share * off.translation();
    Eigen::Isometry3d followed = predicted_ * towards;
    detail::normalize_rotation(followed);
    return followed;
  }

  // How fast the image moves at most when the camera rotates.
  static Eigen::Vector2f cells_per_second(const DepthCells& cells,
                                          const Eigen::Vector3d& rotation_rad_s) {
    const Eigen::Vector3f w = rotation_rad_s.cast<float>();
    Eigen::Vector2f most = Eigen::Vector2f::Zero();
    for (const int y : {0, cells.height / 2, cells.height - 1})
      for (const int x : {0, cells.width / 2, cells.width - 1}) {
        const std::size_t i = cells.index(x, y);
        const Eigen::Vector3f ray(cells.ray_x[i], cells.ray_y[i], 1), d = w.cross(ray);
        const Eigen::Vector2f moved(cells.fx * (d.x() - ray.x() * d.z()),
                                    cells.fy * (d.y() - ray.y() * d.z()));
        most = most.cwiseMax(moved.cwiseAbs());
      }
    return most;
  }

  SensorModel sensor_;
  DepthRegistration registration_;
  DepthShot shot_;
  Eigen::Isometry3d predicted_ = Eigen::Isometry3d::Identity();
  Eigen::Isometry3d ego_at_depth_ = Eigen::Isometry3d::Identity();
  double taken_s_ = 0;  // its stamp with the delay
  bool registered_ = false;
  double fit_ = 0;  // where it is registered
  DelayEstimate delay_;
  ReadoutEstimate readout_;
  Eigen::Vector3d last_rad_s_ = Eigen::Vector3d::Zero();  // how the camera rotated
};

}  // namespace stillpoint
