// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <string>

#include "stillpoint/core/error.hpp"

namespace stillpoint {

/// How many keypoints a host must extract so that enough static ones are left after the filter.
///
/// Judged by the worst frame of the last second: a SLAM system starves in single frames. Two people
/// who fill 60 % of the image leave 400 of 1000 keypoints; the answer is then 2500. O(1) per
/// frame, no allocation.
class FeatureBudget {
 public:
  /// As many frames have a second for add() without a timestamp.
  static constexpr std::size_t kFrames = 30;

  /// Tells what the filter left of the frame taken at `timestamp` (seconds). A frame without
  /// keypoints says nothing; one that comes late counts as now; time that goes back by more than a
  /// second starts anew. Throws Error for a timestamp that is not finite.
  void add(int extracted, int kept, double timestamp) {
    detail::check(std::isfinite(timestamp), [&] {
      return "FeatureBudget::add: timestamp: expected seconds, found " + std::to_string(timestamp);
    });
    if (extracted <= 0) return;
    const double share = static_cast<double>(std::max(kept, 0)) / extracted;
    if (count_ > 0 && timestamp < last_s_ - kWindowS) count_ = 0;
    last_s_ = count_ > 0 ? std::max(timestamp, last_s_) : timestamp;
    // Frames of a camera faster than kSlots Hz share a slot.
    if (count_ > 0 && last_s_ - newest().since_s < kWindowS / kSlots) {
      newest().least_share = std::min(newest().least_share, share);
      return;
    }
    next_ = (next_ + 1) % kSlots;
    count_ = std::min(count_ + 1, kSlots);
    newest() = {last_s_, share};
  }

  /// The same for hosts without timestamps: frames of a camera at kFrames Hz.
  void add(int extracted, int kept) {
    add(extracted, kept, last_s_ + kWindowS / static_cast<double>(kFrames));
  }

  /// Keypoints to extract for `wanted` static ones, between `wanted` and `most`; `wanted` as long
  /// as no frame was seen. Throws Error unless 0 < wanted <= most.
  int features_for(int wanted, int most) const {
    detail::check(wanted > 0 && wanted <= most, [&] {
      return "FeatureBudget: expected 0 < wanted <= most, found wanted " + std::to_string(wanted) +
             ", most " + std::to_string(most);
    });
    double least = 1;
    for (std::size_t i = 0; i < count_; ++i) {
      const Slot& slot = slots_[(next_ + kSlots - i) % kSlots];
      // A little less than the window, so that 30 Hz gives 30 frames whatever the rounding.
      if (last_s_ - slot.since_s > kWindowS - 0.01) break;
      least = std::min(least, slot.least_share);
    }
    if (least * most <= wanted) return most;
    return std::min(most, static_cast<int>(std::ceil(wanted / least)));
  }

 private:
  static constexpr double kWindowS = 1;
  static constexpr std::size_t kSlots = 64;

  // One frame, or those of 1/64 s.
  struct Slot {
    double since_s = 0, least_share = 1;
  };

  Slot& newest() { return slots_[next_]; }

  std::array<Slot, kSlots> slots_{};
  std::size_t next_ = 0, count_ = 0;
  double last_s_ = 0;
};

}  // namespace stillpoint
