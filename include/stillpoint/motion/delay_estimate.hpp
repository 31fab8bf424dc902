// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>

namespace stillpoint {

/// How long after its stamp a depth image was taken, as seen from the color images.
struct DepthDelay {
  /// The mean, seconds, and its standard error. Negative: before its stamp.
  double mean_s = 0, error_s = std::numeric_limits<double>::infinity();
  /// Standard deviation from image to image, seconds.
  double spread_s = 0;

  /// Whether the frames have told it: the camera must have rotated, now faster and now slower.
  bool known() const { return error_s < std::max(0.003, 0.2 * std::abs(mean_s)); }
};

/// Estimates the delay between color and depth from frames in which the camera rotates.
///
/// A depth image that was taken d seconds after its stamp lies a rotation of omega d beside the
/// pose that the ego-motion has for the stamp. From one frame to the next that offset changes by
/// (omega_now - omega_before) d for the mean of d, and by omega times its scatter. So the mean is
/// the slope of the changes over those of the angular velocity, and the scatter is what remains
/// along the axis of rotation beyond what remains across it, which is noise. What the ego-motion
/// drifts cancels out. Older frames count less and less, half after 2.3 s in which frames tell
/// something. O(1) per frame.
class DelayEstimate {
 public:
  /// Adds a frame: the camera's angular velocity in it and in the frame before, rad/s, and the
  /// rotation from its predicted to its registered pose, radians, all in the frame's own axes. The
  /// prediction began at the registered pose of the frame before, and took delay().mean_s into
  /// account if that was known.
  void add(const Eigen::Vector3d& now_rad_s, const Eigen::Vector3d& before_rad_s,
           const Eigen::Vector3d& offset_rad) {
    const double squared = now_rad_s.squaredNorm() + before_rad_s.squaredNorm();
    if (!(squared > kLeastRadS * kLeastRadS)) return;
    const Eigen::Vector3d change = now_rad_s - before_rad_s;
    const Eigen::Vector3d offset = offset_rad + (delay_.known() ? delay_.mean_s : 0) * change;
    const double along = offset_rad.dot(now_rad_s.normalized());
    // What is off by so much was not registered well.
    if (along * along > squared * kMostS * kMostS) return;
    const double across2 = offset_rad.squaredNorm() - along * along;
    const double weight = 1 / (kNoiseRad * kNoiseRad + squared * kUsualSpreadS * kUsualSpreadS);
    for (double* sum : {&frames_, &change2_, &product_, &offset2_, &scatter_, &squares_})
      *sum *= kKept;
    frames_ += 1;
    change2_ += weight * change.squaredNorm();
    product_ += weight * change.dot(offset);
    offset2_ += weight * offset.squaredNorm();
    scatter_ += weight * weight * squared * (along * along - 0.5 * across2);
    squares_ += weight * weight * squared * squared;
    update();
  }

  const DepthDelay& delay() const { return delay_; }

 private:
  static constexpr double kNoiseRad = 0.002;      // of a registered rotation
  static constexpr double kUsualSpreadS = 0.006;  // frames of fast rotation count less
  static constexpr double kLeastRadS = 0.1;       // slower, only noise is left
  static constexpr double kMostS = 0.1;
  static constexpr double kKept = 0.99;  // of older frames, with each that is added
  static constexpr double kFewestFrames = 20;

  void update() {
    if (frames_ < kFewestFrames || !(change2_ > 0)) return;
    delay_.mean_s = std::clamp(product_ / change2_, -kMostS, kMostS);
    const double left = std::max(0.0, offset2_ - delay_.mean_s * product_);
    delay_.error_s = std::sqrt(left / (3 * frames_ - 1) / change2_);
    delay_.spread_s = std::sqrt(std::max(0.0, scatter_ / squares_));
  }

  // Weighted sums over the frames.
  double frames_ = 0, change2_ = 0, product_ = 0, offset2_ = 0, scatter_ = 0, squares_ = 0;
  DepthDelay delay_;
};

}  // namespace stillpoint
