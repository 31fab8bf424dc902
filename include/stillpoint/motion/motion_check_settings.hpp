// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <string>

#include "stillpoint/core/error.hpp"
#include "stillpoint/motion/mover_detector_settings.hpp"

namespace stillpoint {

/// Settings of MotionCheck.
struct MotionCheckSettings {
  /// Side of a cell, an even number. 0: about 1/80 of the image's width.
  int block_px = 0;
  MoverDetectorSettings movers;

  /// Throws Error if a setting makes no sense.
  void check() const {
    movers.check();
    if (block_px < 0 || block_px > 64 || block_px % 2)
      throw Error("MotionCheckSettings.block_px: expected an even number, 0 to 64, found " +
                  std::to_string(block_px));
  }
};

}  // namespace stillpoint
