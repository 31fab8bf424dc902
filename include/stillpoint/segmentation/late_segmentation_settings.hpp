// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <string>

#include "stillpoint/core/error.hpp"

namespace stillpoint {

/// What becomes of a segmentation that comes late: of frame t - k while the camera is at frame t.
struct LateSegmentationSettings {
  /// Predict its masks forward to frame t; else they are used where they were.
  bool predict = true;
  /// An older one is dropped, as if it had not come, and one of more than 128 frames ago.
  double max_age_s = 1.5;
  /// A mask whose newest segmentation is older than this is widened...
  double widen_after_s = 0.5;
  /// ...by so many pixels per second beyond it, at most by 20.
  double widen_px_per_s = 40;

  /// Throws Error if a setting makes no sense.
  void check() const {
    const auto at_least_0 = [](const char* name, double value) {
      if (!(value >= 0))
        throw Error(std::string("LateSegmentationSettings.") + name +
                    ": expected at least 0, found " + std::to_string(value));
    };
    at_least_0("max_age_s", max_age_s);
    at_least_0("widen_after_s", widen_after_s);
    at_least_0("widen_px_per_s", widen_px_per_s);
  }
  /// Pixels to add to the dilation of a mask of that age. None beyond the greatest age: such a mask
  /// has nothing of a segmentation.
  int widening_px(double age_s) const {
    return age_s > widen_after_s && age_s <= max_age_s
               ? static_cast<int>(std::min(20.0, widen_px_per_s * (age_s - widen_after_s)))
               : 0;
  }
};

}  // namespace stillpoint
