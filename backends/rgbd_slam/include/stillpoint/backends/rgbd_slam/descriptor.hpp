// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <opencv2/core.hpp>
#include <opencv2/core/hal/hal.hpp>
#include <string>
#include <vector>

#include "stillpoint/core/error.hpp"

namespace stillpoint::rgbd_slam {

/// A 256-bit binary descriptor (ORB, BRIEF, BRISK cut to 32 bytes, ...).
using Descriptor = std::array<std::uint8_t, 32>;

/// Number of differing bits, 0 to 256.
inline int hamming_distance(const Descriptor& a, const Descriptor& b) {
  return cv::hal::normHamming(a.data(), b.data(), static_cast<int>(a.size()));
}

/// The descriptors as rows of a matrix that shares their memory, for reading.
inline cv::Mat descriptor_rows(const std::vector<Descriptor>& descriptors) {
  return cv::Mat(static_cast<int>(descriptors.size()), 32, CV_8UC1,
                 const_cast<std::uint8_t*>(descriptors.front().data()));
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

}  // namespace stillpoint::rgbd_slam
