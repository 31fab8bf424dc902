// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

namespace stillpoint {

/// `r` grown by `margin_px` on each side, clipped to the image.
inline cv::Rect grow_rect(const cv::Rect& r, int margin_px, const cv::Size& size) {
  return cv::Rect(r.x - margin_px, r.y - margin_px, r.width + 2 * margin_px,
                  r.height + 2 * margin_px) &
         cv::Rect(0, 0, size.width, size.height);
}

namespace detail {

/// Dilates a mask (CV_8UC1) by a square of (2 radius_px + 1)^2 into `out`, of the same size. If it
/// is a part of a larger image, nothing beyond it counts. O(pixels x radius).
inline void dilate_square(const cv::Mat& mask, int radius_px, cv::Mat& out) {
  cv::dilate(mask, out, cv::Mat(), {-1, -1}, radius_px, cv::BORDER_CONSTANT | cv::BORDER_ISOLATED);
}

/// Sets `mask` to 255 in the box of an instance: where its own mask is set, or everywhere.
inline void add_to_mask(const cv::Mat& instance_mask, const cv::Rect& box, cv::Mat& mask) {
  if (instance_mask.empty())
    mask(box).setTo(255);
  else
    mask(box).setTo(255, instance_mask);
}

/// Makes `mask` an image of zeros, CV_8UC1.
inline void clear_mask(const cv::Size& size, cv::Mat& mask) {
  mask.create(size, CV_8UC1);
  mask.setTo(0);
}

}  // namespace detail
}  // namespace stillpoint
