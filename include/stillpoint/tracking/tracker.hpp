// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "stillpoint/core/frame.hpp"
#include "stillpoint/core/mask.hpp"
#include "stillpoint/core/selection.hpp"
#include "stillpoint/core/trajectory.hpp"

namespace stillpoint {

/// The seam to a SLAM or odometry system. One frame goes through in two calls, so that the mask is
/// there before the feature budget is spent and the probability filter runs on what was extracted:
///
///     const DynamicMask& mask = front_end.compute_mask(frame, tracker.predicted_motion());
///     const auto& keypoints = tracker.extract(frame, mask);
///     std::optional<Eigen::Isometry3d> T_world_camera =
///         tracker.track(frame, mask, front_end.select(keypoints));
///
/// Called from one thread.
class Tracker {
 public:
  virtual ~Tracker() = default;

  /// Extracts keypoints (raw pixels) outside the dynamic mask; the reference stays valid until the
  /// next call. `mask.image` may be empty: nothing is dynamic.
  virtual const std::vector<cv::KeyPoint>& extract(const RgbdFrame& frame,
                                                   const DynamicMask& mask) = 0;

  /// Tracks the frame on the selected keypoints of the last extract(). No value: lost.
  virtual std::optional<Eigen::Isometry3d> track(const RgbdFrame& frame, const DynamicMask& mask,
                                                 const Selection& selection) = 0;

  /// T_next_last: the camera's predicted motion from the last tracked frame to the next one (maps
  /// points of the last camera into the next). No value: unknown.
  virtual std::optional<Eigen::Isometry3d> predicted_motion() const { return std::nullopt; }

  /// Poses of all tracked frames as they are known now (a SLAM system corrects old ones), by time,
  /// each time once.
  virtual Trajectory trajectory() const = 0;

  /// Ends background work; trajectory() is final afterwards.
  virtual void finish() {}
};

}  // namespace stillpoint
