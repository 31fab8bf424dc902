// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <opencv2/core.hpp>

namespace stillpoint {

/// A place in the image at a time: Q_i = (x_i, y_i, t_i) of the paper.
struct TimedPoint {
  double x, y, timestamp;
};

/// Predicts where a point will be at `timestamp` by the least-squares line through its `n` last
/// places (paper section 3.1). Times are shifted by the newest one first: the same line, but with
/// timestamps of 1.3e9 s the normal equations as printed lose all digits. One place: no motion;
/// times all equal: their mean. n > 0. O(n).
inline cv::Point2d predict_on_line(const TimedPoint* points, std::size_t n, double timestamp) {
  const double origin = points[n - 1].timestamp;
  double st = 0, stt = 0, sx = 0, sy = 0, sxt = 0, syt = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const double t = points[i].timestamp - origin;
    st += t, stt += t * t;
    sx += points[i].x, sy += points[i].y;
    sxt += points[i].x * t, syt += points[i].y * t;
  }
  const double count = static_cast<double>(n);
  const double det = count * stt - st * st;
  const double kx = det > 1e-12 ? (count * sxt - sx * st) / det : 0;
  const double ky = det > 1e-12 ? (count * syt - sy * st) / det : 0;
  const double t = timestamp - origin;
  return {kx * t + (sx - kx * st) / count, ky * t + (sy - ky * st) / count};
}

}  // namespace stillpoint
