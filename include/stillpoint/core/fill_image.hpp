// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <opencv2/core.hpp>

namespace stillpoint {
namespace detail {

/// Sets `part` of an image of one channel of T. For small parts, of which a frame has hundreds:
/// cv::Mat::setTo() takes 2 us before its first pixel, and cv::Mat::operator() 0.05 us.
template <typename T>
void fill_part(cv::Mat& image, const cv::Rect& part, T value) {
  for (int y = part.y; y < part.y + part.height; ++y)
    std::fill_n(image.ptr<T>(y) + part.x, part.width, value);
}

/// Sets all of it.
template <typename T>
void fill_image(cv::Mat& image, T value) {
  fill_part(image, {0, 0, image.cols, image.rows}, value);
}

}  // namespace detail
}  // namespace stillpoint
