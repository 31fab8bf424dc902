// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "stillpoint/core/error.hpp"

namespace stillpoint::rgbd_slam {

/// A 256-bit binary descriptor (ORB, BRIEF, BRISK cut to 32 bytes, ...).
using Descriptor = std::array<std::uint64_t, 4>;

/// Number of differing bits, 0 to 256. Plain arithmetic: needs no processor flag.
inline int hamming_distance(const Descriptor& a, const Descriptor& b) {
  // Bit counts of the four words are added in bytes (at most 32 each) before the one multiplication
  // that sums them.
  std::uint64_t sum = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    std::uint64_t x = a[i] ^ b[i];
    x = x - ((x >> 1) & 0x5555555555555555ull);
    x = (x & 0x3333333333333333ull) + ((x >> 2) & 0x3333333333333333ull);
    sum += (x + (x >> 4)) & 0x0f0f0f0f0f0f0f0full;
  }
  sum = (sum & 0x00ff00ff00ff00ffull) + ((sum >> 8) & 0x00ff00ff00ff00ffull);
  return static_cast<int>((sum * 0x0001000100010001ull) >> 48);
}

/// Reads one descriptor per row of an N x 32 CV_8UC1 matrix. Throws Error for another shape.
inline std::vector<Descriptor> descriptors_from_rows(const cv::Mat& rows) {
  std::vector<Descriptor> descriptors(static_cast<std::size_t>(rows.rows));
  if (rows.rows == 0) return descriptors;
  detail::check(rows.type() == CV_8UC1 && rows.cols == 32, [&] {
    return "descriptors_from_rows: expected N x 32 of CV_8UC1, found " + std::to_string(rows.rows) +
           " x " + std::to_string(rows.cols) + " of type " + std::to_string(rows.type());
  });
  for (int i = 0; i < rows.rows; ++i)
    std::memcpy(descriptors[static_cast<std::size_t>(i)].data(), rows.ptr(i), 32);
  return descriptors;
}

/// Index of the descriptor with the least median distance to the others: the most typical one.
/// O(n^2); 0 for an empty list.
inline std::size_t most_typical_descriptor(const std::vector<Descriptor>& descriptors) {
  std::size_t best = 0;
  int best_median = 257;
  std::vector<int> distances(descriptors.size());
  for (std::size_t i = 0; i < descriptors.size(); ++i) {
    for (std::size_t k = 0; k < descriptors.size(); ++k)
      distances[k] = hamming_distance(descriptors[i], descriptors[k]);
    const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
    std::nth_element(distances.begin(), middle, distances.end());
    if (*middle < best_median) best_median = *middle, best = i;
  }
  return best;
}

}  // namespace stillpoint::rgbd_slam
