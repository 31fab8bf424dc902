// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "stillpoint/core/config.hpp"

namespace stillpoint::detail {

/// How good a corner each pixel is: the lesser eigenvalue of the slopes' structure tensor over 3 x
/// 3 pixels (Shi and Tomasi, 1994). The values of cv::cornerMinEigenVal() in less than half the
/// time.
class CornerScore {
 public:
  /// Of a CV_8UC1 image to a CV_32FC1 one; 0 at the rim, a pixel wide. O(pixels).
  void find(const cv::Mat& image, cv::Mat& score) {
    cv::Sobel(image, gx_, CV_16S, 1, 0);
    cv::Sobel(image, gy_, CV_16S, 0, 1);
    score.create(image.size(), CV_32F);
    score.setTo(0);
    spread_.create(image.size());
    spread_.setTo(0);
    const std::size_t n = static_cast<std::size_t>(image.cols);
    for (std::vector<float>* v : {&xx_, &xy_, &yy_}) v->resize(n);
    for (int y = 1; y + 1 < image.rows; ++y) {
      add_rows(y, n, xx_.data(), xy_.data(), yy_.data());
      halves(xx_.data(), xy_.data(), yy_.data(), n, score.ptr<float>(y), spread_[y]);
    }
    cv::sqrt(spread_, spread_);
    cv::subtract(score, spread_, score);
  }

 private:
  // Of one row and those beside it: the sums of each column's products.
  void add_rows(int y, std::size_t n, float* STILLPOINT_RESTRICT xx, float* STILLPOINT_RESTRICT xy,
                float* STILLPOINT_RESTRICT yy) const {
    for (std::size_t x = 0; x < n; ++x) xx[x] = xy[x] = yy[x] = 0;
    for (int row = y - 1; row <= y + 1; ++row) {
      const std::int16_t *gx = gx_[row], *gy = gy_[row];
      for (std::size_t x = 0; x < n; ++x) {
        const float u = kScale * static_cast<float>(gx[x]), v = kScale * static_cast<float>(gy[x]);
        xx[x] += u * u, xy[x] += u * v, yy[x] += v * v;
      }
    }
  }

  // The mean of the two eigenvalues, and the square of how far they lie from it.
  static void halves(const float* xx, const float* xy, const float* yy, std::size_t n,
                     float* STILLPOINT_RESTRICT mean, float* STILLPOINT_RESTRICT spread) {
    for (std::size_t x = 1; x + 1 < n; ++x) {
      const float a = 0.5f * (xx[x - 1] + xx[x] + xx[x + 1]);
      const float b = xy[x - 1] + xy[x] + xy[x + 1];
      const float c = 0.5f * (yy[x - 1] + yy[x] + yy[x + 1]);
      mean[x] = a + c, spread[x] = (a - c) * (a - c) + b * b;
    }
  }

  // Of a slope: Sobel's has four times that of neighbors, 3 x 3 are added up, and white is 1.
  static constexpr float kScale = 1.0f / (4 * 3 * 255);

  cv::Mat_<std::int16_t> gx_, gy_;
  cv::Mat_<float> spread_;
  std::vector<float> xx_, xy_, yy_;  // of the columns of three rows
};

}  // namespace stillpoint::detail
