// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <vector>

namespace stillpoint {

/// Why a keypoint was kept or removed.
enum class KeypointReason : std::uint8_t {
  kStatic,          ///< kept: probability at most the threshold
  kFloor,           ///< kept although too probable: the tracker needs a minimum of keypoints
  kInMask,          ///< removed: lies in the dynamic mask
  kProbable,        ///< removed: near dynamic keypoints, probability above the threshold
  kOutsidePicture,  ///< removed: NaN coordinates or outside the image
  kEntering         ///< removed: will be in the mask in the next frame (tracked points only)
};

/// What the front end says of each keypoint, by index; keypoints and descriptors stay the host's.
struct Selection {
  /// Probability of being dynamic, 0 to 1, one per keypoint.
  std::vector<float> probability;
  /// One per keypoint.
  std::vector<KeypointReason> reason;
  /// Indices of the kept keypoints, ascending.
  std::vector<int> kept;

  bool is_kept(std::size_t i) const {
    return reason[i] == KeypointReason::kStatic || reason[i] == KeypointReason::kFloor;
  }
  std::size_t size() const { return probability.size(); }
  void clear() { probability.clear(), reason.clear(), kept.clear(); }
};

/// Keeps the selected elements of a host's array, in place (keypoints, descriptors in a vector,
/// ...).
template <class Vector>
void compact(Vector& values, const Selection& selection) {
  std::size_t n = 0;
  for (int i : selection.kept) {
    if (static_cast<std::size_t>(i) != n) values[n] = values[static_cast<std::size_t>(i)];
    ++n;
  }
  values.resize(n);
}

}  // namespace stillpoint
