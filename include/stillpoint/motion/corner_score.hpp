// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "stillpoint/core/config.hpp"

namespace stillpoint::detail {

/// How good a corner each pixel is: the lesser eigenvalue of the slopes' structure tensor over 3 x
/// 3 pixels (Shi and Tomasi, 1994). The values of cv::cornerMinEigenVal() in a seventh of the time.
class CornerScore {
 public:
  /// Of a CV_8UC1 image to a CV_32FC1 one; 0 at the rim, two pixels wide. O(pixels).
  void find(const cv::Mat& image, cv::Mat& score) {
    score.create(image.size(), CV_32F);
    score.setTo(0);
    spread_.create(image.size());
    spread_.setTo(0);
    const std::size_t n = static_cast<std::size_t>(image.cols);
    for (auto* v : {&gx_, &gy_}) v->assign(n, 0);
    for (Products& row : rows_) row.resize(n);
    sums_.resize(n);
    for (int y = 1; y + 1 < image.rows; ++y) {
      slopes(image.ptr(y - 1), image.ptr(y), image.ptr(y + 1), n, gx_.data(), gy_.data());
      Products& row = rows_[static_cast<std::size_t>(y % 3)];
      multiply(gx_.data(), gy_.data(), n, row.xx.data(), row.xy.data(), row.yy.data());
      if (y < 3) continue;
      add(rows_[0].xx.data(), rows_[1].xx.data(), rows_[2].xx.data(), n, sums_.xx.data());
      add(rows_[0].xy.data(), rows_[1].xy.data(), rows_[2].xy.data(), n, sums_.xy.data());
      add(rows_[0].yy.data(), rows_[1].yy.data(), rows_[2].yy.data(), n, sums_.yy.data());
      halves(sums_.xx.data(), sums_.xy.data(), sums_.yy.data(), n, score.ptr<float>(y - 1),
             spread_[y - 1]);
    }
    cv::sqrt(spread_, spread_);
    cv::subtract(score, spread_, score);
  }

 private:
  // Of a row of pixels: the products of their slopes in x and y.
  struct Products {
    std::vector<float> xx, xy, yy;
    void resize(std::size_t n) {
      for (auto* v : {&xx, &xy, &yy}) v->assign(n, 0);
    }
  };

  // Sobel's, of a row and those beside it.
  STILLPOINT_ROW_LOOP static void slopes(const uchar* above, const uchar* here, const uchar* below,
                                         std::size_t n, std::int16_t* STILLPOINT_RESTRICT gx,
                                         std::int16_t* STILLPOINT_RESTRICT gy) {
    for (std::size_t x = 1; x + 1 < n; ++x) {
      const std::size_t l = x - 1, r = x + 1;
      gx[x] = static_cast<std::int16_t>((above[r] + 2 * here[r] + below[r]) -
                                        (above[l] + 2 * here[l] + below[l]));
      gy[x] = static_cast<std::int16_t>((below[l] + 2 * below[x] + below[r]) -
                                        (above[l] + 2 * above[x] + above[r]));
    }
  }

  STILLPOINT_ROW_LOOP static void multiply(const std::int16_t* gx, const std::int16_t* gy,
                                           std::size_t n, float* STILLPOINT_RESTRICT xx,
                                           float* STILLPOINT_RESTRICT xy,
                                           float* STILLPOINT_RESTRICT yy) {
    for (std::size_t x = 0; x < n; ++x) {
      const float u = kScale * static_cast<float>(gx[x]), v = kScale * static_cast<float>(gy[x]);
      xx[x] = u * u, xy[x] = u * v, yy[x] = v * v;
    }
  }

  STILLPOINT_ROW_LOOP static void add(const float* a, const float* b, const float* c, std::size_t n,
                                      float* STILLPOINT_RESTRICT sum) {
    for (std::size_t x = 0; x < n; ++x) sum[x] = a[x] + b[x] + c[x];
  }

  // The mean of the two eigenvalues, and the square of how far they lie from it; of sums of three
  // rows.
  STILLPOINT_ROW_LOOP static void halves(const float* xx, const float* xy, const float* yy,
                                         std::size_t n, float* STILLPOINT_RESTRICT mean,
                                         float* STILLPOINT_RESTRICT spread) {
    for (std::size_t x = 2; x + 2 < n; ++x) {
      const float a = 0.5f * (xx[x - 1] + xx[x] + xx[x + 1]);
      const float b = xy[x - 1] + xy[x] + xy[x + 1];
      const float c = 0.5f * (yy[x - 1] + yy[x] + yy[x + 1]);
      mean[x] = a + c, spread[x] = (a - c) * (a - c) + b * b;
    }
  }

  // Of a slope: Sobel's has four times that of neighbors, 3 x 3 are added up, and white is 1.
  static constexpr float kScale = 1.0f / (4 * 3 * 255);

  std::vector<std::int16_t> gx_, gy_;  // of a row
  std::array<Products, 3> rows_;
  Products sums_;  // of the three rows
  cv::Mat_<float> spread_;
};

}  // namespace stillpoint::detail
