// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <opencv2/core.hpp>

namespace stillpoint {

/// Which pixels of a frame belong to something that moves.
///
/// Polarity: 255 = dynamic, 0 = static. Hosts that want the inverse (stella_vslam: non-zero = keep)
/// take `static_image()`.
struct DynamicMask {
  /// H x W, CV_8UC1, 255 = dynamic. Never empty once a frame was processed.
  cv::Mat image;
  /// Timestamp of the frame that the mask is *for*, seconds.
  double timestamp = 0;
  /// How much older the newest segmentation in it is, seconds; 0 when this frame was segmented,
  /// infinity when none was ever seen.
  double age_s = 0;

  /// H x W, CV_8UC1, 255 = static. Allocates.
  cv::Mat static_image() const { return image == 0; }
  /// True where the pixel nearest to (x, y) is dynamic; false outside the image and for NaN.
  bool dynamic_at(float x, float y) const {
    if (!(x >= -0.5f && y >= -0.5f && x < static_cast<float>(image.cols) - 0.5f &&
          y < static_cast<float>(image.rows) - 0.5f))
      return false;
    return pixel_at(x, y) != 0;
  }
  /// The pixel nearest to a place inside the image.
  uchar pixel_at(float x, float y) const {
    const int u = static_cast<int>(x + 0.5f), v = static_cast<int>(y + 0.5f);
    return image.ptr<uchar>(
        std::min(v, image.rows - 1))[std::min(u, image.cols - 1)];  // rounded up
  }
  /// Share of dynamic pixels, 0 to 1. O(pixels).
  double coverage() const {
    return image.empty() ? 0 : cv::countNonZero(image) / static_cast<double>(image.total());
  }
};

}  // namespace stillpoint
