// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

namespace stillpoint {

/// How long it takes to read out a depth image, as seen from other depth images.
struct DepthReadout {
  /// From the first to the last row, seconds, and its standard error. Negative: from below.
  double mean_s = 0, error_s = std::numeric_limits<double>::infinity();

  /// Whether the frames have told it: the camera must have rotated.
  bool known() const { return error_s < std::max(0.002, 0.2 * std::abs(mean_s)); }
};

/// Estimates the time of the read-out from frames in which the camera rotates: their rows lie
/// beside each other, by more the longer it takes.
///
/// DepthRegistration measures by how much the time that it assumes is wrong. It finds too little,
/// as errors that are large have no say, but none where the time is right: the mean of what was
/// assumed and found comes nearer with each frame, and ends at the true value. Older frames count
/// less and less, half after 23 in which the camera rotates. O(1) per frame.
class ReadoutEstimate {
 public:
  /// Adds a frame: the time that was assumed and found together, seconds, and how much it is worth,
  /// one over its variance.
  void add(double readout_s, double information) {
    if (!(information > 1 / (kMostErrorS * kMostErrorS)) || !(std::abs(readout_s) < kMostS)) return;
    for (double* sum : {&frames_, &weights_, &sum_, &squares_}) *sum *= kKept;
    frames_ += 1;
    weights_ += information;
    sum_ += information * readout_s;
    squares_ += information * readout_s * readout_s;
    if (frames_ < kFewestFrames) return;
    readout_.mean_s = sum_ / weights_;
    const double scatter = squares_ / weights_ - readout_.mean_s * readout_.mean_s;
    readout_.error_s = std::sqrt(std::max(0.0, scatter) / (frames_ - 1));
  }

  const DepthReadout& readout() const { return readout_; }

 private:
  static constexpr double kMostS = 0.1;
  static constexpr double kMostErrorS = 0.03;  // of a frame that tells something
  static constexpr double kKept = 0.97;        // of older frames, with each that is added
  static constexpr double kFewestFrames = 10;

  // Weighted sums over the frames.
  double frames_ = 0, weights_ = 0, sum_ = 0, squares_ = 0;
  DepthReadout readout_;
};

}  // namespace stillpoint
