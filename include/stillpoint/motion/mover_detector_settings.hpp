// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <string>

#include "stillpoint/core/error.hpp"

namespace stillpoint {

/// Settings of MoverDetector.
struct MoverDetectorSettings {
  /// Least number of cells, and least area, that must have moved. 50 cells are enough however
  /// close, and so however small.
  int min_moved_cells = 6;
  double min_moved_area_m2 = 0.02;
  /// Least share of moved cells in the region grown from them, among those that an earlier frame
  /// has looked at.
  double min_moved_share = 0.2;
  /// How far the region grows from them over connected depth.
  double growth_m = 0.35;
  /// Greatest share of the region's border at which its surface goes on into what is not part of
  /// it: a mover ends in steps of depth, a piece of a wall does not.
  double max_open_share = 0.6;

  /// Throws Error if a setting makes no sense.
  void check() const {
    const auto fail = [](const char* name, const char* expected, double found) {
      throw Error(std::string("MoverDetectorSettings.") + name + ": expected " + expected +
                  ", found " + std::to_string(found));
    };
    if (min_moved_cells < 1) fail("min_moved_cells", "at least 1", min_moved_cells);
    if (!(min_moved_area_m2 >= 0)) fail("min_moved_area_m2", "at least 0", min_moved_area_m2);
    if (!(min_moved_share >= 0 && min_moved_share <= 1))
      fail("min_moved_share", "0 to 1", min_moved_share);
    if (!(growth_m >= 0)) fail("growth_m", "at least 0", growth_m);
    if (!(max_open_share >= 0 && max_open_share <= 1))
      fail("max_open_share", "0 to 1", max_open_share);
  }
};

}  // namespace stillpoint
