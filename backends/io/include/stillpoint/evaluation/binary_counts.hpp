// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <limits>

namespace stillpoint {

/// Outcomes of a yes/no decision against the truth. A ratio without anything to divide by is NaN.
struct BinaryCounts {
  std::uint64_t true_positive = 0, false_positive = 0, false_negative = 0, true_negative = 0;

  BinaryCounts& operator+=(const BinaryCounts& o) {
    true_positive += o.true_positive, false_positive += o.false_positive;
    false_negative += o.false_negative, true_negative += o.true_negative;
    return *this;
  }
  std::uint64_t total() const {
    return true_positive + false_positive + false_negative + true_negative;
  }
  /// Share of what was found that is right.
  double precision() const { return ratio(true_positive, true_positive + false_positive); }
  /// Share of what is there that was found.
  double recall() const { return ratio(true_positive, true_positive + false_negative); }
  /// Intersection over union.
  double iou() const {
    return ratio(true_positive, true_positive + false_positive + false_negative);
  }
  /// Harmonic mean of precision and recall.
  double f1() const {
    return ratio(2 * true_positive, 2 * true_positive + false_positive + false_negative);
  }

  static double ratio(std::uint64_t part, std::uint64_t whole) {
    return whole ? static_cast<double>(part) / static_cast<double>(whole)
                 : std::numeric_limits<double>::quiet_NaN();
  }
};

/// Mean of the values that are not NaN; NaN if there is none.
class MeanOfNumbers {
 public:
  void add(double value) {
    if (value != value) return;
    sum_ += value;
    ++count_;
  }
  double value() const { return sum_ / static_cast<double>(count_); }
  std::uint64_t count() const { return count_; }

 private:
  double sum_ = 0;
  std::uint64_t count_ = 0;
};

}  // namespace stillpoint
