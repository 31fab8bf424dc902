// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <optional>
#include <vector>

#include "stillpoint/core/random.hpp"
#include "stillpoint/tracking/tracker.hpp"

namespace stillpoint::cli {

/// A tracker that is given all but about a hundredth of the kept keypoints, drawn at random.
///
/// Where a track goes wrong is a matter of chance, too: runs that differ by so little show how much
/// of an error is luck, whatever the masks are.
class ThinnedTracker final : public Tracker {
 public:
  /// `tracker` must outlive this.
  ThinnedTracker(Tracker& tracker, std::uint64_t seed) : tracker_(tracker), random_(seed) {}

  const std::vector<cv::KeyPoint>& extract(const RgbdFrame& frame,
                                           const DynamicMask& mask) override {
    return tracker_.extract(frame, mask);
  }

  std::optional<Eigen::Isometry3d> track(const RgbdFrame& frame, const DynamicMask& mask,
                                         const Selection& selection) override {
    thinned_ = selection;
    thinned_.kept.clear();
    for (const int i : selection.kept)
      if (random_.below(kOneIn) != 0) thinned_.kept.push_back(i);
    return tracker_.track(frame, mask, thinned_);
  }

  std::optional<Eigen::Isometry3d> predicted_motion() const override {
    return tracker_.predicted_motion();
  }
  Trajectory trajectory() const override { return tracker_.trajectory(); }
  void finish() override { tracker_.finish(); }

 private:
  static constexpr std::size_t kOneIn = 100;

  Tracker& tracker_;
  RandomGenerator random_;
  Selection thinned_;
};

}  // namespace stillpoint::cli
