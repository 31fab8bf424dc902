// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

namespace stillpoint {

/// Settings in pixels hold for an image this wide; others see as much of the scene with more or
/// fewer pixels.
inline constexpr double kSettingsWidthPx = 640;

/// How many pixels of an image of this size are one of the settings'.
inline double pixel_scale(const cv::Size& size) { return size.width / kSettingsWidthPx; }

/// A setting in whole pixels for an image of this size; at least 1 unless it is 0.
inline int scaled_px(int setting_px, const cv::Size& size) {
  if (setting_px <= 0) return 0;
  return std::max(1, static_cast<int>(std::lround(setting_px * pixel_scale(size))));
}

/// `r` grown by `margin_px` on each side, clipped to the image.
inline cv::Rect grow_rect(const cv::Rect& r, int margin_px, const cv::Size& size) {
  const cv::Point margin(margin_px, margin_px);
  return cv::Rect(r.tl() - margin, r.br() + margin) & cv::Rect(cv::Point(), size);
}

}  // namespace stillpoint
