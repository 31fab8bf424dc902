// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cmath>
#include <cstddef>
#include <opencv2/core.hpp>
#include <string>

#include "stillpoint/backends/rgbd_slam/features.hpp"
#include "stillpoint/core/error.hpp"
#include "stillpoint/core/frame.hpp"
#include "stillpoint/core/selection.hpp"

namespace stillpoint::rgbd_slam {

/// What a tracker's callers can get wrong: one number that is not finite would spoil the map for
/// good, so it is refused before anything changes. Each throws Error; `who` is named in it.

/// What a FeatureExtractor of the caller's found.
inline void check_features(const std::string& who, const Features& features, int levels) {
  stillpoint::detail::check(features.keypoints.size() == features.descriptors.size(), [&] {
    return who + ": expected one descriptor for each of the extractor's " +
           std::to_string(features.keypoints.size()) + " keypoints, found " +
           std::to_string(features.descriptors.size());
  });
  for (std::size_t i = 0; i < features.keypoints.size(); ++i) {
    const cv::KeyPoint& k = features.keypoints[i];
    stillpoint::detail::check(
        std::isfinite(k.pt.x) && std::isfinite(k.pt.y) && k.octave >= 0 && k.octave < levels, [&] {
          return who + ": expected keypoints at finite pixels on levels 0 to " +
                 std::to_string(levels - 1) + " from the extractor, found number " +
                 std::to_string(i) + " at (" + std::to_string(k.pt.x) + ", " +
                 std::to_string(k.pt.y) + ") on level " + std::to_string(k.octave);
        });
  }
}

/// The arguments of Tracker::track(), after extract() of an image of `size`.
inline void check_track(const std::string& who, const RgbdFrame& frame, const cv::Size& size,
                        const Selection& selection, const Features& features) {
  check_frame(frame);
  const std::size_t n = features.keypoints.size();
  stillpoint::detail::check(selection.size() == n, [&] {
    return who + "::track: expected a selection of the " + std::to_string(n) +
           " keypoints of the last extract(), found " + std::to_string(selection.size());
  });
  for (const int k : selection.kept)
    stillpoint::detail::check(k >= 0 && static_cast<std::size_t>(k) < n, [&] {
      return who + "::track: selection.kept: expected indices of the " + std::to_string(n) +
             " keypoints, found " + std::to_string(k);
    });
  stillpoint::detail::check(frame.color.size() == size, [&] {
    return who + "::track: frame.color: expected the frame of the last extract(), " +
           std::to_string(size.width) + "x" + std::to_string(size.height) + ", found " +
           stillpoint::detail::size_text(frame.color);
  });
}

}  // namespace stillpoint::rgbd_slam
