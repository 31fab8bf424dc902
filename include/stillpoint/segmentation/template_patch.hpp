// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <opencv2/core.hpp>

#include "stillpoint/core/instance.hpp"

namespace stillpoint {

/// Samples of an object's image, to look for it near a place in the next frame (the local
/// template matching of paper section 3.1).
class TemplatePatch {
 public:
  /// Samples at most 24 x 24 pixels, spread evenly over the instance's box, those on its mask.
  /// O(1).
  void sample(const cv::Mat& gray, const Instance& instance) {
    count_ = 0;
    const int step_x = std::max(1, (instance.box.width + kSide - 1) / kSide);
    const int step_y = std::max(1, (instance.box.height + kSide - 1) / kSide);
    step_ = std::max(1, std::min(step_x, step_y) / 2);
    for (int y = step_y / 2; y < instance.box.height; y += step_y)
      for (int x = step_x / 2; x < instance.box.width; x += step_x) {
        if (!instance.mask.empty() && !instance.mask.ptr<uchar>(y)[x]) continue;
        points_[count_++] = {static_cast<short>(x), static_cast<short>(y),
                             value(gray, instance.box.x + x, instance.box.y + y)};
      }
  }

  /// Best zero-mean normalised correlation with the patch's upper-left corner within
  /// `radius_px` of `corner`, which is set to the best place; -1 if too little of it is in the
  /// image or it has no texture. O(radius^2 x samples).
  double locate(const cv::Mat& gray, int radius_px, cv::Point& corner) const {
    double best = -1;
    const cv::Point start = corner;
    const int step = std::max(1, std::min(step_, std::max(1, radius_px / 4)));
    for (int pass = step; pass >= 1; pass = pass > 1 ? pass / 2 : 0) {
      const int reach = pass == step ? radius_px : pass;
      const cv::Point center = pass == step ? start : corner;
      for (int dy = -(reach / pass) * pass; dy <= reach; dy += pass)
        for (int dx = -(reach / pass) * pass; dx <= reach; dx += pass) {
          const cv::Point at(center.x + dx, center.y + dy);
          const double score = correlate(gray, at);
          // Of equal scores the place nearest to the prediction wins.
          const bool nearer = distance2(at, start) < distance2(corner, start);
          if (score > best + 1e-9 || (score > -1 && score > best - 1e-9 && nearer))
            best = score, corner = at;
        }
    }
    return best;
  }

  void clear() { count_ = 0; }
  bool empty() const { return count_ == 0; }

 private:
  static constexpr int kSide = 24;
  struct Sample {
    short x, y;
    std::uint8_t value;
  };

  static std::uint8_t value(const cv::Mat& gray, int x, int y) { return gray.ptr<uchar>(y)[x]; }

  static int distance2(const cv::Point& a, const cv::Point& b) {
    return (a.x - b.x) * (a.x - b.x) + (a.y - b.y) * (a.y - b.y);
  }

  double correlate(const cv::Mat& gray, const cv::Point& corner) const {
    std::int64_t n = 0, sa = 0, sb = 0, saa = 0, sbb = 0, sab = 0;
    for (std::size_t i = 0; i < count_; ++i) {
      const int x = corner.x + points_[i].x, y = corner.y + points_[i].y;
      if (x < 0 || y < 0 || x >= gray.cols || y >= gray.rows) continue;
      const std::int64_t a = points_[i].value, b = value(gray, x, y);
      ++n, sa += a, sb += b, saa += a * a, sbb += b * b, sab += a * b;
    }
    if (n < 16 || static_cast<std::size_t>(n) * 3 < count_) return -1;
    const double va = static_cast<double>(n * saa - sa * sa);
    const double vb = static_cast<double>(n * sbb - sb * sb);
    if (va <= 0 || vb <= 0) return -1;
    return static_cast<double>(n * sab - sa * sb) / std::sqrt(va * vb);
  }

  std::array<Sample, std::size_t{kSide} * kSide> points_{};
  std::size_t count_ = 0;
  int step_ = 1;
};

}  // namespace stillpoint
