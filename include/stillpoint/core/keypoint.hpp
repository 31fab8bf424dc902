// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <opencv2/core.hpp>
#include <type_traits>
#include <utility>

namespace stillpoint {

/// How the library reads a host's keypoint: pixel coordinates x (right) and y (down).
///
/// Works for anything with members `x` and `y`, and for cv::KeyPoint. Specialise it for another
/// type in three lines:
///
///     template <> struct stillpoint::KeypointTraits<MyKeypoint> {
///       static float x(const MyKeypoint& k) { return k.column; }
///       static float y(const MyKeypoint& k) { return k.row; }
///     };
template <class Keypoint>
struct KeypointTraits {
  static float x(const Keypoint& k) { return static_cast<float>(k.x); }
  static float y(const Keypoint& k) { return static_cast<float>(k.y); }
};

template <>
struct KeypointTraits<cv::KeyPoint> {
  static float x(const cv::KeyPoint& k) { return k.pt.x; }
  static float y(const cv::KeyPoint& k) { return k.pt.y; }
};

}  // namespace stillpoint
