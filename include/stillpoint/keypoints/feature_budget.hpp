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
/// Judged by the worst of the last kFrames frames: a SLAM system starves in single frames. Two
/// people who fill 60 % of the picture leave 400 of 1000 keypoints; the answer is then 2500. O(1)
/// per frame, no allocation.
class FeatureBudget {
 public:
  /// One second at 30 Hz.
  static constexpr std::size_t kFrames = 30;

  /// Tells what one frame's filter left. A frame without keypoints says nothing.
  void add(int extracted, int kept) {
    if (extracted <= 0) return;
    shares_[next_] = static_cast<double>(std::max(kept, 0)) / extracted;
    next_ = (next_ + 1) % kFrames;
    count_ = std::min(count_ + 1, kFrames);
  }

  /// Keypoints to extract for `wanted` static ones, between `wanted` and `most`; `wanted` as long
  /// as no frame was seen. Throws Error unless 0 < wanted <= most.
  int features_for(int wanted, int most) const {
    detail::check(wanted > 0 && wanted <= most, [&] {
      return "FeatureBudget: expected 0 < wanted <= most, found wanted " + std::to_string(wanted) +
             ", most " + std::to_string(most);
    });
    double least = 1;
    for (std::size_t i = 0; i < count_; ++i) least = std::min(least, shares_[i]);
    if (least * most <= wanted) return most;
    return std::min(most, static_cast<int>(std::ceil(wanted / least)));
  }

 private:
  std::array<double, kFrames> shares_{};
  std::size_t next_ = 0, count_ = 0;
};

}  // namespace stillpoint
