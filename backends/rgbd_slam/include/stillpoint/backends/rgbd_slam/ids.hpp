// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>

namespace stillpoint::rgbd_slam {

/// The number of a keyframe, or of a point: two types, which cannot be mixed up. Counts from 0 in
/// the order of making; without a value: none.
template <class Of>
class Id {
 public:
  Id() = default;
  explicit Id(std::size_t index) : value_(static_cast<int>(index)) {}

  explicit operator bool() const { return value_ >= 0; }
  std::size_t index() const { return static_cast<std::size_t>(value_); }

  friend bool operator==(Id a, Id b) { return a.value_ == b.value_; }
  friend bool operator!=(Id a, Id b) { return a.value_ != b.value_; }
  friend bool operator<(Id a, Id b) { return a.value_ < b.value_; }

 private:
  int value_ = -1;
};

using KeyframeId = Id<struct Keyframe>;
using PointId = Id<struct MapPoint>;

}  // namespace stillpoint::rgbd_slam
