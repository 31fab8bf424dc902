// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>

#include "stillpoint/core/instance.hpp"
#include "stillpoint/core/status.hpp"

namespace stillpoint {

/// How old the newest result of the segmenter is. A result may be an earlier frame's, predicted
/// forward (ForwardPredictor).
class SegmentationAge {
 public:
  /// Takes the segmentation of the next frame. O(1).
  void add(double now_s, const Segmentation& segmentation) {
    available_ = segmentation.available;
    if (available_) {
      result_s_ = result_time(segmentation, now_s);
      arrived_s_ = now_s;
      late_ = result_s_ < now_s;
    }
    age_s_ = now_s - result_s_;
  }

  /// At the last frame, seconds; infinity before the first result.
  double age_s() const { return age_s_; }
  /// Whether the newest result was of an earlier frame than that in which it came.
  bool late() const { return late_; }
  /// The frame in which the newest result came, seconds; minus infinity before the first.
  double arrived_s() const { return arrived_s_; }
  /// Bits of the last frame: kNoSegmentation, kNeverSegmented.
  std::uint32_t status() const {
    return available_           ? kOk
           : std::isinf(age_s_) ? kNoSegmentation | kNeverSegmented
                                : kNoSegmentation;
  }

 private:
  static constexpr double kNever = -std::numeric_limits<double>::infinity();

  bool available_ = false, late_ = false;
  double result_s_ = kNever, arrived_s_ = kNever, age_s_ = -kNever;
};

}  // namespace stillpoint
