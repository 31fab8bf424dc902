// SPDX-License-Identifier: BSD-2-Clause
#pragma once

namespace stillpoint {

/// Settings of ProbabilisticKeypointFilter (paper section 3.3).
struct KeypointFilterSettings {
  /// D: neighbors lie within this distance.
  float radius_px = 20;
  /// c1 and c2 of the weight `c1 exp(-c2 r)`, r in pixels.
  float weight = 1;
  float decay_per_px = 0.05f;
  /// Theta: a keypoint with a larger probability is removed; equality counts as static.
  float threshold = 0.2f;
  /// Floor of kept keypoints: below it the least dynamic ones are kept too (kKeypointFloor). 0:
  /// none.
  int min_kept = 50;

  /// The paper gives none of the four numbers; what is literal is that there is no floor.
  static KeypointFilterSettings paper() {
    KeypointFilterSettings settings;
    settings.min_kept = 0;
    return settings;
  }
};

}  // namespace stillpoint
