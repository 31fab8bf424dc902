// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <opencv2/core.hpp>
#include <string>
#include <type_traits>
#include <vector>

#include "stillpoint/core/error.hpp"
#include "stillpoint/core/keypoint.hpp"
#include "stillpoint/core/mask.hpp"
#include "stillpoint/core/selection.hpp"

namespace stillpoint {

/// A part of the mask, and how far it has moved in the image since the frame before, pixels.
struct MaskMotion {
  cv::Rect area;
  cv::Point2f shift_px;
};

/// Takes out of a selection the points that will be in the mask in the next frame, if points and
/// mask go on as they moved since the last one: a tracker (KLT) would drag them along there, before
/// they are in the mask. `before[i]` is where the point now[i] was in the last frame; NaN: it is
/// new. At least `min_kept` points stay. Returns how many were taken out. Throws Error unless
/// there is one point before for each now. O(points x parts).
template <class Keypoints, class Before>
int drop_entering(const Keypoints& now, const Before& before, const DynamicMask& mask,
                  const std::vector<MaskMotion>& parts, int min_kept, Selection& selection) {
  using Now = KeypointTraits<std::decay_t<decltype(now[0])>>;
  using Was = KeypointTraits<std::decay_t<decltype(before[0])>>;
  detail::check(before.size() == now.size(), [&] {
    return "select_tracked: before: expected one point for each of now, " +
           std::to_string(now.size()) + ", found " + std::to_string(before.size());
  });
  const auto enters = [&](std::size_t i) {
    const cv::Point2f next(2 * Now::x(now[i]) - Was::x(before[i]),
                           2 * Now::y(now[i]) - Was::y(before[i]));
    for (const MaskMotion& part : parts) {
      const cv::Point2f q = next - part.shift_px;  // the mask's next place, as it lies now
      if (q.x >= static_cast<float>(part.area.x) && q.y >= static_cast<float>(part.area.y) &&
          q.x < static_cast<float>(part.area.br().x) &&
          q.y < static_cast<float>(part.area.br().y) && mask.dynamic_at(q.x, q.y))
        return true;
    }
    return false;  // also for NaN
  };
  int left = static_cast<int>(selection.kept.size()), dropped = 0;
  std::size_t n = 0;
  for (const int i : selection.kept) {
    const std::size_t k = static_cast<std::size_t>(i);
    if (selection.reason[k] == KeypointReason::kStatic && left > min_kept && enters(k)) {
      selection.reason[k] = KeypointReason::kEntering;
      --left, ++dropped;
    } else {
      selection.kept[n++] = i;
    }
  }
  selection.kept.resize(n);
  return dropped;
}

}  // namespace stillpoint
