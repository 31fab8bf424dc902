// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "stillpoint/core/blur.hpp"
#include "stillpoint/core/frame_context.hpp"
#include "stillpoint/core/image_scale.hpp"
#include "stillpoint/core/rigid_motion.hpp"
#include "stillpoint/segmentation/remembered_object.hpp"
#include "stillpoint/segmentation/segmentation_age.hpp"
#include "stillpoint/segmentation/segmentation_compensator_settings.hpp"

namespace stillpoint {

/// How long a missing object is carried along: in seconds, and in results of the segmenter that
/// miss it.
class MemoryLimits {
 public:
  explicit MemoryLimits(const SegmentationCompensatorSettings& settings) : settings_(settings) {}

  /// How long an object without a class that this frame shows is carried along if it was seen once
  /// only. The motion check errs where the camera rotates, and what it finds once there may be
  /// nothing. `last_s`: time of the frame before.
  double unnamed_once_s(const FrameContext& context, double last_s) const {
    const double most = settings_.max_prediction_s;
    if (!context.T_current_last) return most;
    const double dt = context.frame.timestamp - last_s;
    const double rad_s = detail::rotation_angle(context.T_current_last->linear()) / dt;
    const double least = std::max(kLeastS, kLeastFrames * dt);
    return std::max(std::min(most, least), most / (1 + rad_s / kSteadyCameraRad_s));
  }

  /// Takes note of whether the frame shows the object. Who walks straight away from the camera, or
  /// towards it, counts as seen for a while: the motion check, which compares places, may not find
  /// him. A mask that slides along a wall changes its depth, too.
  static void note_sight(double now_s, bool seen, RememberedObject& object) {
    if (seen) {
      object.seen_for_s += std::min(now_s - object.seen_s, kGapS);
      ++object.times_seen;
      object.shown_s = now_s;
    } else if (now_s - object.shown_s > kWalkS ||
               !(std::abs(object.depth_motion_m()) > kSurelyMovedM)) {
      return;
    }
    object.seen_s = now_s;
    object.forget_depth_motion();
  }

  /// Whether an object has gone unseen for too long.
  bool too_old(double now_s, const SegmentationAge& age, const RememberedObject& object) const {
    double known_s = object.seen_s;
    // A late segmenter gives few results: one that misses the object must not end it. Of what has
    // no name it says nothing.
    if (age.late() && !object.class_name.empty()) known_s = std::max(known_s, age.arrived_s());
    return now_s - known_s > unseen_s(object);
  }

  /// Counts a result that misses an object, wholly or (`seen`) partly; false if that was one too
  /// many. A segmenter says nothing of what it has no name for: such misses do not count.
  bool count_miss(bool seen, const Blur& blur, const cv::Size& size,
                  RememberedObject& object) const {
    if (object.class_name.empty()) return true;
    // In a sharp image, who is missed is more likely gone than in a blurred one.
    const bool sharp =
        !seen && settings_.sharp_px > 0 && blur.is_sharp(settings_.sharp_px * pixel_scale(size));
    object.mended += sharp ? 2 : 1;
    return object.mended <= misses(object, seen);
  }

 private:
  static constexpr float kSurelyMovedM = 0.15f;
  static constexpr double kWalkS = 2;
  static constexpr double kGapS = 0.1;  // between two frames that count as seen in a row
  static constexpr double kTrustPerSecond = 3;
  // A blink of the motion check.
  static constexpr double kLeastS = 0.1, kLeastFrames = 2.5;
  static constexpr double kSteadyCameraRad_s = 0.09;  // 5 degrees per second: held still by hand

  // An object without a class is trusted longer the longer it was seen.
  double unseen_s(const RememberedObject& object) const {
    const double most = settings_.max_prediction_s;
    if (!object.class_name.empty()) return most;
    const double longer = object.once_s + kTrustPerSecond * object.seen_for_s;
    return std::min(longer, std::max(most, settings_.max_unnamed_s));
  }

  // What was seen once or twice only may be a piece of the wall that looked like a person.
  int misses(const RememberedObject& object, bool seen) const {
    if (seen || settings_.trigger == SegmentationCompensatorSettings::Trigger::kGlobal)
      return settings_.max_restored_frames;
    return std::min(settings_.max_restored_frames, 3 * object.times_seen - 1);
  }

  SegmentationCompensatorSettings settings_;
};

}  // namespace stillpoint
