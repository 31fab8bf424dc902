// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <opencv2/core.hpp>
#include <vector>

#include "stillpoint/core/cell_labels.hpp"
#include "stillpoint/core/fill_image.hpp"
#include "stillpoint/core/instance.hpp"
#include "stillpoint/depth/depth_samples.hpp"

namespace stillpoint {

/// The depths that an object takes, metres: the "human value range" of paper section 3.2.
struct DepthRange {
  float lo_m = 0, hi_m = 0, middle_m = 0;
};

/// Finds an object's depth range from stratified samples.
class ObjectDepthRange {
 public:
  /// The paper's: mean of the samples in the box (those within three standard deviations) +-
  /// `alpha_m`. False if no sample has depth. O(samples in the box).
  bool find_in_box(const DepthSamples& samples, const cv::Rect& box, float alpha_m,
                   DepthRange& range) {
    values_.clear();
    samples.for_each_in(box, [&](const cv::Point& cell, const cv::Point&) {
      if (const float z = samples.z(cell); z > 0) values_.push_back(z);
    });
    if (values_.empty()) return false;
    cv::Scalar mean, deviation;
    cv::meanStdDev(values_, mean, deviation);
    double sum = 0;
    int count = 0;
    for (const float z : values_)
      if (std::abs(z - mean[0]) <= 3 * deviation[0]) sum += z, ++count;
    range.middle_m = static_cast<float>(count > 0 ? sum / count : mean[0]);
    range.lo_m = range.middle_m - alpha_m, range.hi_m = range.middle_m + alpha_m;
    return true;
  }

  /// The default: the samples on the instance's own mask; of their histogram's modes the one where
  /// the object is expected, else the nearest that matters, and what hangs together with it. False
  /// if too few samples have depth. In a bare box what `labels` knows to be static counts only if
  /// hardly anything else is there. `states` become kOnMask where samples on the mask have depth
  /// and, in a bare box, are not known to be static; else kOffMask. O(samples in the box).
  bool find_on_mask(const DepthSamples& samples, const Instance& instance, const CellLabels& labels,
                    CellStates& states, DepthRange& range) {
    if (!fill_histogram(samples, instance, labels, false, states) &&
        !fill_histogram(samples, instance, labels, true, states))
      return false;
    const int peak = main_mode(instance.depth_m);
    const int enough = std::max(1, smooth(peak) / 25);
    int lo = peak, hi = peak;
    const int reach = static_cast<int>(kReachM / kBinM);
    while (lo > 0 && peak - lo < reach && smooth(lo - 1) > enough) --lo;
    while (hi + 1 < kBins && hi - peak < reach && smooth(hi + 1) > enough) ++hi;
    range.lo_m = static_cast<float>(lo) * kBinM;
    // The last bin holds all that is farther, too.
    range.hi_m = hi + 1 == kBins ? std::numeric_limits<float>::infinity()
                                 : static_cast<float>(hi + 1) * kBinM;
    range.middle_m = (static_cast<float>(peak) + 0.5f) * kBinM;
    return true;
  }

 private:
  static constexpr int kBins = 256;
  static constexpr float kBinM = 0.05f;
  static constexpr float kReachM = 0.7f;  // a person's arm

  // False if too few of the samples have depth.
  bool fill_histogram(const DepthSamples& samples, const Instance& instance,
                      const CellLabels& labels, bool count_static, CellStates& states) {
    const cv::Rect& box = instance.box;
    const bool bare = instance.mask.empty();
    const float bins_per_unit = samples.depth().metres_per_unit_value() / kBinM;
    states.create(samples.units().size());
    detail::fill_image(states, std::uint8_t{kOffMask});
    histogram_.fill(0);
    int all = 0, measured = 0;
    samples.for_each_in(box, [&](const cv::Point& cell, const cv::Point& p) {
      if (!bare && instance.mask.at<uchar>(p - box.tl()) == 0) return;
      const std::uint16_t units = samples.units()(cell);
      const bool is_static = bare && units > 0 && labels.known_static(p);
      if (is_static && !count_static) return;
      ++all;
      if (units == 0) return;
      ++measured;
      // In a bare box the person is in the middle columns.
      const bool middle = bare && 8 * std::abs(2 * (p.x - box.x) - box.width) < 3 * box.width;
      const int bin = bin_of(units * bins_per_unit);
      histogram_[slot(bin)] += middle ? 4 : 1;
      if (!is_static) states(cell) = kOnMask;
    });
    return measured >= 6 && measured * 5 >= all;
  }

  // The bin of a depth in bins, 0 or more; the last one has all that is farther.
  static int bin_of(float bins) { return static_cast<int>(std::min(kBins - 1.0f, bins)); }
  // The histogram has an empty bin at either end.
  static std::size_t slot(int bin) { return static_cast<std::size_t>(bin + 1); }
  int count(int bin) const { return histogram_[slot(bin)]; }
  int smooth(int bin) const { return count(bin - 1) + 2 * count(bin) + count(bin + 1); }
  int mass(int from, int to) const {
    return std::accumulate(&histogram_[slot(from)], &histogram_[slot(to)] + 1, 0);
  }
  int highest(int from, int to) const {
    int best = from;
    for (int b = from + 1; b <= to; ++b)
      if (smooth(b) > smooth(best)) best = b;
    return best;
  }

  int main_mode(float expected_m) const {
    if (expected_m > 0) {
      const int at = bin_of(expected_m / kBinM);
      const int reach = static_cast<int>(0.35f / kBinM);
      const int from = std::max(0, at - reach), to = std::min(kBins - 1, at + reach);
      if (mass(from, to) * 8 > mass(0, kBins - 1)) return highest(from, to);
    }
    // A careless mask takes in the wall behind: the nearest mode that matters is the person.
    const int largest = highest(0, kBins - 1);
    for (int b = 1, mode = 0, first = 1; b < largest; ++b) {
      if (smooth(b) > smooth(mode)) mode = b;
      if (4 * smooth(b) >= smooth(mode)) continue;
      // It has ended before the largest.
      if (5 * mass(first, b) > mass(0, kBins - 1) && smooth(mode) > 0) return mode;
      mode = b, first = b + 1;
    }
    return largest;
  }

  std::array<int, kBins + 2> histogram_{};
  std::vector<float> values_;
};

}  // namespace stillpoint
