// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <string>

#include "stillpoint/core/error.hpp"

namespace stillpoint {

/// Settings of EgoMotion.
struct EgoMotionSettings {
  /// Measure the motion from frame to frame from the images themselves. False: only what the host
  /// tells is known.
  bool measure = true;
  /// A motion between two frames beyond these is a cut: nothing before it helps any more.
  double max_step_m = 0.5;
  double max_rotation_deg = 30;
  /// The host's motion is not believed where the images' own has so much more support (0 to 1).
  double max_doubt = 0.08;
  /// A host whose step differs by more than this from the motion known has jumped (it closed a
  /// loop, or found itself again); the camera has not.
  double jump_m = 0.1;
  double jump_rad = 0.1;

  /// Throws Error if a setting makes no sense.
  void check() const {
    const auto more_than_0 = [](const char* name, double found) {
      if (!(found > 0))
        throw Error(std::string("EgoMotionSettings.") + name + ": expected more than 0, found " +
                    std::to_string(found));
    };
    more_than_0("max_step_m", max_step_m);
    more_than_0("max_rotation_deg", max_rotation_deg);
    more_than_0("jump_m", jump_m);
    more_than_0("jump_rad", jump_rad);
    if (!(max_doubt >= 0))
      throw Error("EgoMotionSettings.max_doubt: expected at least 0, found " +
                  std::to_string(max_doubt));
  }
};

}  // namespace stillpoint
