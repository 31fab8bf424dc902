// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <string>

#include "stillpoint/core/error.hpp"

namespace stillpoint {

/// Settings of BlurMeter.
struct BlurMeterSettings {
  /// Exposure time, seconds. 0: the camera's (`exposure_ms` of its file); where it tells none, half
  /// of its frame interval, 0.5 / fps.
  double exposure_s = 0;

  /// Throws Error if a setting makes no sense.
  void check() const {
    if (!(exposure_s >= 0 && exposure_s < 10))
      throw Error("BlurMeterSettings.exposure_s: expected 0 to 10 s, found " +
                  std::to_string(exposure_s));
  }
};

}  // namespace stillpoint
