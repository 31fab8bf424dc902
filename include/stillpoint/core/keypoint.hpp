// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <opencv2/core.hpp>
#include <type_traits>
#include <utility>

namespace stillpoint {

namespace detail {

/// Whether a type has members x and y that are numbers.
template <class Keypoint, class = void>
struct HasXy : std::false_type {};
template <class Keypoint>
struct HasXy<Keypoint, std::void_t<decltype(static_cast<float>(std::declval<const Keypoint&>().x)),
                                   decltype(static_cast<float>(std::declval<const Keypoint&>().y))>>
    : std::true_type {};

}  // namespace detail

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
  static constexpr bool kHasXy = detail::HasXy<Keypoint>::value;
  static_assert(
      kHasXy,
      "Stillpoint cannot read this keypoint: it expects members x and y, in pixels. For a "
      "keypoint of your own specialize stillpoint::KeypointTraits with x(k) and y(k); "
      "docs/conventions.md shows it.");

  // Nothing more is said of a keypoint that has none.
  static float x(const Keypoint& k) {
    if constexpr (kHasXy) return static_cast<float>(k.x);
    return 0;
  }
  static float y(const Keypoint& k) {
    if constexpr (kHasXy) return static_cast<float>(k.y);
    return 0;
  }
};

template <>
struct KeypointTraits<cv::KeyPoint> {
  static float x(const cv::KeyPoint& k) { return k.pt.x; }
  static float y(const cv::KeyPoint& k) { return k.pt.y; }
};

}  // namespace stillpoint
