// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "stillpoint/core/error.hpp"
#include "stillpoint/core/frame.hpp"
#include "stillpoint/core/keypoint.hpp"
#include "stillpoint/core/mask.hpp"
#include "stillpoint/core/selection.hpp"
#include "stillpoint/evaluation/binary_counts.hpp"

namespace stillpoint {

/// How well keypoints were told apart: positive = dynamic.
///
/// `counts.precision()`: share of the removed ones that lie on people; `counts.recall()`: share of
/// those on people that were removed. Add up frames with `+=`.
struct KeypointMetrics {
  BinaryCounts counts;

  KeypointMetrics& operator+=(const KeypointMetrics& o) {
    counts += o.counts;
    return *this;
  }
  std::uint64_t kept() const { return counts.false_negative + counts.true_negative; }
  std::uint64_t removed() const { return counts.true_positive + counts.false_positive; }
  /// Of the kept keypoints, those on people; NaN if none was kept.
  double share_of_kept_on_people() const {
    return BinaryCounts::ratio(counts.false_negative, kept());
  }
  /// Of the static keypoints, those that were kept; NaN if there was none.
  double share_of_static_kept() const {
    return BinaryCounts::ratio(counts.true_negative, counts.true_negative + counts.false_positive);
  }
};

/// Compares a selection with the true mask (CV_8UC1, non-zero = dynamic, not dilated). Keypoints
/// outside the image count for nothing. Throws Error if keypoints and selection differ in number,
/// or for a mask of another type. O(keypoints).
template <class Keypoint>
KeypointMetrics compare_keypoints(const std::vector<Keypoint>& keypoints,
                                  const Selection& selection, const cv::Mat& truth) {
  detail::check(keypoints.size() == selection.reason.size(), [&] {
    return "compare_keypoints: expected a selection of " + std::to_string(keypoints.size()) +
           " keypoints, found one of " + std::to_string(selection.reason.size());
  });
  detail::check(truth.type() == CV_8UC1 && !truth.empty(), [&] {
    return "compare_keypoints: truth: expected CV_8UC1, found " + detail::type_text(truth) + " " +
           detail::size_text(truth);
  });
  const DynamicMask mask{truth, 0, 0};
  KeypointMetrics metrics;
  for (std::size_t i = 0; i < keypoints.size(); ++i) {
    if (selection.reason[i] == KeypointReason::kOutsidePicture) continue;
    const bool dynamic = mask.dynamic_at(KeypointTraits<Keypoint>::x(keypoints[i]),
                                         KeypointTraits<Keypoint>::y(keypoints[i]));
    if (selection.is_kept(i))
      ++(dynamic ? metrics.counts.false_negative : metrics.counts.true_negative);
    else
      ++(dynamic ? metrics.counts.true_positive : metrics.counts.false_positive);
  }
  return metrics;
}

}  // namespace stillpoint
