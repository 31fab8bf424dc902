// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cmath>
#include <string>

#include "stillpoint/core/error.hpp"

namespace stillpoint {

/// Settings of ObjectTracker.
struct ObjectTrackerSettings {
  /// How long an object that is not in the mask (behind a pillar, out of the image) keeps its id,
  /// seconds.
  double max_lost_s = 2;
  /// Standard deviation of an object's velocity when it is first seen, m/s per axis.
  double velocity_m_s = 1;
  /// By how much its velocity changes in a second, m/s per axis (one standard deviation).
  double acceleration_m_s2 = 1.5;
  /// How far the centroid of what is visible wanders on the object from frame to frame (limbs, the
  /// rim of the mask), metres per axis.
  double centroid_m = 0.03;

  /// Throws Error if a setting makes no sense.
  void check() const {
    const auto at_least_0 = [](const char* name, double found) {
      if (!(found >= 0 && std::isfinite(found)))
        throw Error(std::string("ObjectTrackerSettings.") + name + ": expected at least 0, found " +
                    std::to_string(found));
    };
    at_least_0("max_lost_s", max_lost_s);
    at_least_0("velocity_m_s", velocity_m_s);
    at_least_0("acceleration_m_s2", acceleration_m_s2);
    at_least_0("centroid_m", centroid_m);
  }
};

}  // namespace stillpoint
