// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <opencv2/core.hpp>
#include <type_traits>
#include <utility>

namespace stillpoint {

namespace detail {

// Hosts' compilers may know no more than C++11.
template <class...>
struct VoidOf {
  using type = void;
};

/// Whether a type has members x and y that are numbers.
template <class Keypoint, class = void>
struct HasXy : std::false_type {};
template <class Keypoint>
struct HasXy<Keypoint,
             typename VoidOf<decltype(static_cast<float>(std::declval<const Keypoint&>().x)),
                             decltype(static_cast<float>(std::declval<const Keypoint&>().y))>::type>
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
  using Readable = detail::HasXy<Keypoint>;
  static_assert(
      Readable::value,
      "Stillpoint cannot read this keypoint: it expects members x and y, in pixels. For a "
      "keypoint of your own specialize stillpoint::KeypointTraits with x(k) and y(k); "
      "docs/conventions.md shows it.");

  static float x(const Keypoint& k) { return x_of(k, Readable()); }
  static float y(const Keypoint& k) { return y_of(k, Readable()); }

 private:
  template <class K>
  static float x_of(const K& k, std::true_type) {
    return static_cast<float>(k.x);
  }
  template <class K>
  static float y_of(const K& k, std::true_type) {
    return static_cast<float>(k.y);
  }
  // Nothing more is said of a keypoint that has none.
  template <class K>
  static float x_of(const K&, std::false_type) {
    return 0;
  }
  template <class K>
  static float y_of(const K&, std::false_type) {
    return 0;
  }
};

template <>
struct KeypointTraits<cv::KeyPoint> {
  static float x(const cv::KeyPoint& k) { return k.pt.x; }
  static float y(const cv::KeyPoint& k) { return k.pt.y; }
};

}  // namespace stillpoint
