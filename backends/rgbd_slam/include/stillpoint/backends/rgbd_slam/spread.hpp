// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <opencv2/core.hpp>
#include <vector>

namespace stillpoint::rgbd_slam {

/// Keeps at most `budget` keypoints, the strongest of even cells, so that they cover the image.
///
/// The side of the cells is searched until about as many cells hold a keypoint as the budget
/// allows; each gives its strongest, and what is left of the budget goes to the strongest of the
/// rest. The kept ones stand in order of rows. Deterministic. O(n log n).
inline void spread(std::vector<cv::KeyPoint>& keypoints, int budget, cv::Size size) {
  if (budget <= 0) {
    keypoints.clear();
    return;
  }
  const auto in_rows = [](const cv::KeyPoint& a, const cv::KeyPoint& b) {
    return a.pt.y != b.pt.y ? a.pt.y < b.pt.y : a.pt.x < b.pt.x;
  };
  const auto count = static_cast<std::size_t>(budget);
  if (keypoints.size() > count) {
    std::sort(keypoints.begin(), keypoints.end(),
              [&](const cv::KeyPoint& a, const cv::KeyPoint& b) {
                return a.response != b.response ? a.response > b.response : in_rows(a, b);
              });
    // With the strongest first, the first one seen in a cell is the cell's.
    std::vector<char> taken, best_first;
    const auto first_of_cells = [&](double side, std::vector<char>& first) {
      const int columns = static_cast<int>(size.width / side) + 1;
      const int rows = static_cast<int>(size.height / side) + 1;
      taken.assign(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows), 0);
      first.assign(keypoints.size(), 0);
      std::size_t cells = 0;
      for (std::size_t i = 0; i < keypoints.size(); ++i) {
        const int c = static_cast<int>(keypoints[i].pt.x / side);
        const int r = static_cast<int>(keypoints[i].pt.y / side);
        char& cell = taken[static_cast<std::size_t>(r * columns + c)];
        if (cell) continue;
        cell = first[i] = 1;
        ++cells;
      }
      return cells;
    };
    double low = 1, high = std::max(size.width, size.height) + 1;
    for (int i = 0; i < 12 && high - low > 0.25; ++i) {
      const double side = (low + high) / 2;
      (first_of_cells(side, best_first) > count ? low : high) = side;
    }
    std::size_t cells = first_of_cells(high, best_first);
    for (std::size_t i = 0; i < keypoints.size() && cells < count; ++i)
      if (!best_first[i]) best_first[i] = 1, ++cells;
    std::size_t n = 0;
    for (std::size_t i = 0; i < keypoints.size(); ++i)
      if (best_first[i]) keypoints[n++] = keypoints[i];
    keypoints.resize(n);
  }
  std::sort(keypoints.begin(), keypoints.end(), in_rows);
}

}  // namespace stillpoint::rgbd_slam
