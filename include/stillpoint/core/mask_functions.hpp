// SPDX-License-Identifier: BSD-2-Clause
#pragma once

// What other systems take instead of a mask. docs/use_a_mask.md says which takes what, and the trap
// of each. Where nothing is dynamic, all of them change nothing.

#include <algorithm>
#include <cstddef>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <type_traits>
#include <vector>

#include "stillpoint/core/error.hpp"
#include "stillpoint/core/frame.hpp"
#include "stillpoint/core/keypoint.hpp"

namespace stillpoint {

namespace detail {

inline void check_mask(const cv::Mat& mask, const char* function) {
  check(!mask.empty() && mask.type() == CV_8UC1, [&] {
    return std::string(function) + ": mask: expected CV_8UC1, non-zero = dynamic, found " +
           (mask.empty() ? "an empty one" : type_text(mask));
  });
}

}  // namespace detail

/// The mask the other way round, for systems that want non-zero = keep: H x W, CV_8UC1, 255 =
/// static. Throws Error for another type. O(pixels).
inline cv::Mat static_image(const cv::Mat& mask) {
  detail::check_mask(mask, "static_image");
  return mask == 0;
}

/// Where a detector may look for features: H x W, CV_8UC1, 255 = yes, as OpenCV's detectors take
/// it. `margin_px` pixels around what is dynamic are left out, too: a descriptor there would see
/// the person. Throws Error for another type, or a margin not of 0 to 1000. O(pixels).
inline cv::Mat feature_mask(const cv::Mat& mask, int margin_px = 0) {
  detail::check_mask(mask, "feature_mask");
  detail::check(margin_px >= 0 && margin_px <= 1000, [&] {
    return "feature_mask: margin_px: expected 0 to 1000, found " + std::to_string(margin_px);
  });
  if (margin_px == 0) return mask == 0;
  cv::Mat grown;
  const int side = 2 * margin_px + 1;
  // A mask that is a part of an image ends at its own border.
  cv::dilate(mask, grown, cv::getStructuringElement(cv::MORPH_RECT, {side, side}), {-1, -1}, 1,
             cv::BORDER_CONSTANT | cv::BORDER_ISOLATED);
  return grown == 0;
}

/// The depth without what is dynamic: a copy of CV_16UC1 (any unit) or CV_32FC1 (metres) with 0,
/// "no measurement", where `mask` is not 0. All other pixels stay as they are, NaN too; none is
/// filled in. Throws Error for another type or size. O(pixels).
inline cv::Mat masked_depth(const cv::Mat& depth, const cv::Mat& mask) {
  detail::check_mask(mask, "masked_depth");
  detail::check(depth.type() == CV_16UC1 || depth.type() == CV_32FC1, [&] {
    return "masked_depth: depth: expected CV_16UC1 or CV_32FC1 (metres), found " +
           (depth.empty() ? std::string("an empty one") : detail::type_text(depth));
  });
  detail::check(depth.size() == mask.size(), [&] {
    return "masked_depth: depth: expected the mask's size " + detail::size_text(mask) + ", found " +
           detail::size_text(depth);
  });
  cv::Mat out = depth.clone();
  out.setTo(0, mask);
  return out;
}

/// How probably each pixel is dynamic, for systems that weigh instead of cutting (their weight is 1
/// minus this): H x W, CV_32FC1, 0 to 1. 1 in the mask, falling to 0 at `rim_px` pixels from it;
/// give it the mask before dilation (FrontEnd::undilated_mask()), so that the rim takes the
/// dilation's place. Exactly 0 everywhere if nothing is dynamic. Throws Error for another type, or
/// a rim not of 0 to 1000. O(pixels).
inline cv::Mat dynamic_probability(const cv::Mat& mask, float rim_px = 10) {
  detail::check_mask(mask, "dynamic_probability");
  detail::check(rim_px >= 0 && rim_px <= 1000, [&] {
    return "dynamic_probability: rim_px: expected 0 to 1000, found " + std::to_string(rim_px);
  });
  cv::Mat probability = cv::Mat::zeros(mask.size(), CV_32FC1);
  if (cv::countNonZero(mask) == 0) return probability;
  cv::Mat distance;
  cv::distanceTransform(mask == 0, distance, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  const float per_px = 1 / std::max(rim_px, 1e-3f);
  for (int y = 0; y < mask.rows; ++y) {
    const float* d = distance.ptr<float>(y);
    float* p = probability.ptr<float>(y);
    for (int x = 0; x < mask.cols; ++x) p[x] = std::max(0.0f, 1 - d[x] * per_px);
  }
  return probability;
}

/// The same at keypoints of any type that KeypointTraits can read, in pixels: at the nearest pixel;
/// 1 for NaN and outside the image. O(pixels + keypoints).
template <class Keypoints>
std::vector<float> dynamic_probability_at(const Keypoints& keypoints, const cv::Mat& mask,
                                          float rim_px = 10) {
  using Traits = KeypointTraits<std::decay_t<decltype(keypoints[0])>>;
  const cv::Mat image = dynamic_probability(mask, rim_px);
  std::vector<float> out(keypoints.size(), 1.0f);
  for (std::size_t i = 0; i < out.size(); ++i) {
    const float x = Traits::x(keypoints[i]) + 0.5f, y = Traits::y(keypoints[i]) + 0.5f;
    if (x >= 0 && y >= 0 && x < static_cast<float>(image.cols) &&
        y < static_cast<float>(image.rows))
      out[i] = image.at<float>(static_cast<int>(y), static_cast<int>(x));
  }
  return out;
}

}  // namespace stillpoint
