// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <memory>
#include <opencv2/core.hpp>
#include <stillpoint/backends/ros2/messages.hpp>
#include <string>
#include <vector>

/// An image as a message; each row is followed by `padding` bytes.
inline stillpoint::ros2::ImageMessage image_message(const cv::Mat& image,
                                                    const std::string& encoding, std::int64_t stamp,
                                                    int padding = 0, bool big_endian = false) {
  const std::size_t row = static_cast<std::size_t>(image.cols) * image.elemSize();
  const std::size_t step = row + static_cast<std::size_t>(padding);
  auto bytes = std::make_shared<std::vector<std::uint8_t>>(
      step * static_cast<std::size_t>(image.rows), std::uint8_t{0xee});
  for (int y = 0; y < image.rows; ++y) {
    std::uint8_t* to = bytes->data() + static_cast<std::size_t>(y) * step;
    std::memcpy(to, image.ptr(y), row);
    if (big_endian)
      for (std::size_t i = 0; i < row; i += image.elemSize1())
        std::reverse(to + i, to + i + image.elemSize1());
  }
  stillpoint::ros2::ImageMessage m;
  m.stamp = stamp;
  m.frame_id = "camera";
  m.encoding = encoding;
  m.width = static_cast<std::uint32_t>(image.cols);
  m.height = static_cast<std::uint32_t>(image.rows);
  m.step = static_cast<std::uint32_t>(step);
  m.big_endian = big_endian;
  m.data = bytes->data();
  m.bytes = bytes->size();
  m.owner = bytes;
  return m;
}

inline stillpoint::ros2::SegmentationMessage label_message(const cv::Mat& labels,
                                                           const std::string& encoding,
                                                           std::int64_t stamp) {
  stillpoint::ros2::SegmentationMessage m;
  m.stamp = stamp;
  m.has_labels = true;
  m.labels = image_message(labels, encoding, stamp);
  return m;
}

inline bool same(const cv::Mat& a, const cv::Mat& b) {
  if (a.size() != b.size() || a.type() != b.type()) return false;
  for (int y = 0; y < a.rows; ++y)
    if (std::memcmp(a.ptr(y), b.ptr(y), static_cast<std::size_t>(a.cols) * a.elemSize()) != 0)
      return false;
  return true;
}
