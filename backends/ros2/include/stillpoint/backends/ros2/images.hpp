// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <string>

#include "stillpoint/backends/ros2/messages.hpp"
#include "stillpoint/core/mask_pool.hpp"

// Images of messages as cv::Mat. Each function returns an empty text, or what was expected and what
// was found; `out` is then as it was. The bytes are copied, as a message does not live long enough.

namespace stillpoint::ros2 {

namespace detail {

// Into the same memory, unless somebody keeps a reference to it.
inline void renew(cv::Mat& mat, int rows, int cols, int type) {
  if (stillpoint::detail::MaskPool::held_elsewhere(mat)) mat.release();
  mat.create(rows, cols, type);
}

inline bool host_is_big_endian() {
  const std::uint16_t one = 1;
  std::uint8_t first = 0;
  std::memcpy(&first, &one, 1);
  return first == 0;
}

/// Empty, or why the bytes cannot be an image of `pixel_bytes` bytes per pixel.
inline std::string layout_problem(const ImageMessage& m, std::size_t pixel_bytes) {
  const std::uint32_t most = 1u << 15;
  if (m.width == 0 || m.height == 0 || m.width > most || m.height > most)
    return "expected an image, found " + std::to_string(m.width) + "x" + std::to_string(m.height);
  const std::size_t row = m.width * pixel_bytes;
  if (m.step < row)
    return "expected a step of at least " + std::to_string(row) + " bytes (" +
           std::to_string(m.width) + " pixels of " + m.encoding + "), found " +
           std::to_string(m.step);
  const std::size_t all = static_cast<std::size_t>(m.step) * (m.height - 1) + row;
  if (!m.data || m.bytes < all)
    return "expected at least " + std::to_string(all) + " bytes of data, found " +
           std::to_string(m.data ? m.bytes : 0);
  return "";
}

// Copies row by row: neither the step nor the address need be a multiple of the element's size.
inline void copy_rows(const ImageMessage& m, int type, cv::Mat& out) {
  renew(out, static_cast<int>(m.height), static_cast<int>(m.width), type);
  const std::size_t row = m.width * out.elemSize(), one = out.elemSize1();
  const bool swap = one > 1 && m.big_endian != host_is_big_endian();
  for (int y = 0; y < out.rows; ++y) {
    uchar* to = out.ptr(y);
    std::memcpy(to, m.data + static_cast<std::size_t>(y) * m.step, row);
    if (swap)
      for (uchar* p = to; p < to + row; p += one) std::reverse(p, p + one);
  }
}

struct Coding {
  const char* name;
  int type;
  int conversion;  // to BGR; -1: none
};

template <std::size_t n>
std::string find_coding(const ImageMessage& m, const Coding (&codings)[n], const Coding*& found) {
  std::string names;
  for (const Coding& coding : codings) {
    if (m.encoding == coding.name) {
      found = &coding;
      return layout_problem(m, static_cast<std::size_t>(CV_ELEM_SIZE(coding.type)));
    }
    names += (names.empty() ? "" : ", ") + std::string(coding.name);
  }
  return "expected an encoding among " + names + ", found '" + m.encoding + "'";
}

}  // namespace detail

/// CV_8UC3 (BGR) or CV_8UC1. O(pixels).
inline std::string to_color(const ImageMessage& m, cv::Mat& out) {
  static const detail::Coding codings[] = {{"rgb8", CV_8UC3, cv::COLOR_RGB2BGR},
                                           {"bgr8", CV_8UC3, -1},
                                           {"mono8", CV_8UC1, -1},
                                           {"rgba8", CV_8UC4, cv::COLOR_RGBA2BGR},
                                           {"bgra8", CV_8UC4, cv::COLOR_BGRA2BGR},
                                           {"8UC3", CV_8UC3, -1},
                                           {"8UC1", CV_8UC1, -1}};
  const detail::Coding* coding = nullptr;
  std::string problem = detail::find_coding(m, codings, coding);
  if (!problem.empty()) return problem;
  if (coding->conversion < 0) {
    detail::copy_rows(m, coding->type, out);
  } else {
    // OpenCV only reads the bytes.
    const cv::Mat view(static_cast<int>(m.height), static_cast<int>(m.width), coding->type,
                       const_cast<std::uint8_t*>(m.data), m.step);
    detail::renew(out, view.rows, view.cols, CV_8UC3);
    cv::cvtColor(view, out, coding->conversion);
  }
  return problem;
}

/// CV_16UC1 (units as the driver has them, by REP 118 millimetres) or CV_32FC1 (metres). O(pixels).
inline std::string to_depth(const ImageMessage& m, cv::Mat& out) {
  static const detail::Coding codings[] = {
      {"16UC1", CV_16UC1, -1}, {"32FC1", CV_32FC1, -1}, {"mono16", CV_16UC1, -1}};
  const detail::Coding* coding = nullptr;
  std::string problem = detail::find_coding(m, codings, coding);
  if (problem.empty()) detail::copy_rows(m, coding->type, out);
  return problem;
}

/// CV_8UC1, CV_16UC1 or CV_32SC1: a number per pixel. O(pixels).
inline std::string to_labels(const ImageMessage& m, cv::Mat& out) {
  static const detail::Coding codings[] = {{"mono8", CV_8UC1, -1},
                                           {"8UC1", CV_8UC1, -1},
                                           {"mono16", CV_16UC1, -1},
                                           {"16UC1", CV_16UC1, -1},
                                           {"32SC1", CV_32SC1, -1}};
  const detail::Coding* coding = nullptr;
  std::string problem = detail::find_coding(m, codings, coding);
  if (problem.empty()) detail::copy_rows(m, coding->type, out);
  return problem;
}

}  // namespace stillpoint::ros2
