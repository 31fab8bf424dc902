// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "stillpoint/core/cell_labels.hpp"
#include "stillpoint/core/depth_view.hpp"
#include "stillpoint/core/instance.hpp"
#include "stillpoint/depth/stratified_samples.hpp"

namespace stillpoint {

/// The depths that an object takes, metres: the "human value range" of paper section 3.2.
struct DepthRange {
  float lo_m = 0, hi_m = 0;
  float middle_m = 0;
};

/// Finds an object's depth range from stratified samples.
class ObjectDepthRange {
 public:
  /// The paper's: mean of the samples in the box (those within three standard deviations) +-
  /// `alpha_m`. False if no sample has depth. O(samples in the box).
  bool find_in_box(const DepthView& depth, const StratifiedSamples& samples, const cv::Rect& box,
                   float alpha_m, DepthRange& range) {
    values_.clear();
    const cv::Rect cells = samples.cells_of(box);
    for (int cy = cells.y; cy < cells.y + cells.height; ++cy)
      for (int cx = cells.x; cx < cells.x + cells.width; ++cx) {
        const cv::Point p = samples.place(cx, cy, depth.size());
        if (!box.contains(p)) continue;
        if (const std::uint16_t z = depth.row(p.y)[p.x]) values_.push_back(depth.to_m(z));
      }
    if (values_.empty()) return false;
    double mean = 0, square = 0;
    for (float v : values_) mean += v, square += static_cast<double>(v) * v;
    const double n = static_cast<double>(values_.size());
    mean /= n;
    const double limit = 3 * std::sqrt(std::max(0.0, square / n - mean * mean));
    double sum = 0, count = 0;
    for (float v : values_)
      if (std::abs(v - mean) <= limit) sum += v, ++count;
    if (count > 0) mean = sum / count;
    range.middle_m = static_cast<float>(mean);
    range.lo_m = range.middle_m - alpha_m, range.hi_m = range.middle_m + alpha_m;
    return true;
  }

  /// The default: the samples on the instance's own mask; of their histogram's modes the one where
  /// the object is expected, else the nearest that matters, and what hangs together with it. False
  /// if too few samples have depth. In a bare box what is `known_static` (if given) counts only if
  /// hardly anything else is there. O(samples in the box).
  bool find_on_mask(const DepthView& depth, const StratifiedSamples& samples,
                    const Instance& instance, const CellLabels* known_static, DepthRange& range) {
    if (!fill_histogram(depth, samples, instance, known_static)) return false;
    const int peak = main_mode(instance.depth_m);
    const int enough = std::max(1, smooth(peak) / 25);
    int lo = peak, hi = peak;
    const int reach = static_cast<int>(kReachM / kBinM);
    while (lo > 0 && peak - lo < reach && smooth(lo - 1) > enough) --lo;
    while (hi + 1 < kBins && hi - peak < reach && smooth(hi + 1) > enough) ++hi;
    range.lo_m = static_cast<float>(lo) * kBinM;
    range.hi_m = static_cast<float>(hi + 1) * kBinM;
    range.middle_m = (static_cast<float>(peak) + 0.5f) * kBinM;
    return true;
  }

  /// The samples of the instance of the last find_on_mask(), in units, for each cell of the image;
  /// valid in the cells of its box. 0 where the sample is not on the mask, has no depth or, in a
  /// bare box, is known to be static.
  const cv::Mat_<std::uint16_t>& samples_on_mask() const { return on_mask_; }

 private:
  static constexpr int kBins = 256;
  static constexpr float kBinM = 0.05f;
  static constexpr float kReachM = 0.7f;  // a person's arm

  bool fill_histogram(const DepthView& depth, const StratifiedSamples& samples,
                      const Instance& instance, const CellLabels* known_static) {
    const cv::Rect &box = instance.box, cells = samples.cells_of(box);
    const bool bare = instance.mask.empty();
    const float to_bin = depth.metres_per_unit_value() / kBinM;
    on_mask_.create(samples.grid_size(depth.size()));
    histogram_.fill(0);
    total_ = 0;
    std::array<int, kBins> of_static{};
    int on_mask = 0, measured = 0, measured_static = 0;
    for (int cy = cells.y; cy < cells.y + cells.height; ++cy)
      for (int cx = cells.x; cx < cells.x + cells.width; ++cx) {
        std::uint16_t& sample = on_mask_(cy, cx);
        sample = 0;
        const cv::Point p = samples.place(cx, cy, depth.size());
        if (!box.contains(p) || !(bare || instance.mask.at<uchar>(p - box.tl()))) continue;
        ++on_mask;
        const std::uint16_t units = depth.row(p.y)[p.x];
        if (units == 0) continue;
        const std::size_t bin =
            std::min(kBins - std::size_t{1}, static_cast<std::size_t>(units * to_bin));
        // In a bare box the person is in the middle columns.
        const bool middle = 8 * std::abs(2 * (p.x - box.x) - box.width) < 3 * box.width;
        const int weight = bare && middle ? 4 : 1;
        if (bare && known_static && known_static->known_static(p)) {
          ++measured_static, of_static[bin] += weight;
        } else {
          sample = units;
          ++measured, histogram_[bin] += weight, total_ += weight;
        }
      }
    if (enough_of(measured, on_mask - measured_static)) return true;
    for (std::size_t b = 0; b < histogram_.size(); ++b)
      histogram_[b] += of_static[b], total_ += of_static[b];
    return enough_of(measured + measured_static, on_mask);
  }

  static bool enough_of(int measured, int on_mask) {
    return measured >= 6 && measured * 5 >= on_mask;
  }

  int count(int bin) const {
    return bin < 0 || bin >= kBins ? 0 : histogram_[static_cast<std::size_t>(bin)];
  }
  int smooth(int bin) const { return count(bin - 1) + 2 * count(bin) + count(bin + 1); }

  int highest(int from, int to) const {
    int best = from;
    for (int b = from + 1; b <= to; ++b)
      if (smooth(b) > smooth(best)) best = b;
    return best;
  }

  int main_mode(float expected_m) const {
    if (expected_m > 0) {
      const int at = std::min(kBins - 1, static_cast<int>(expected_m / kBinM));
      const int reach = static_cast<int>(0.35f / kBinM);
      const int from = std::max(0, at - reach), to = std::min(kBins - 1, at + reach);
      int mass = 0;
      for (int b = from; b <= to; ++b) mass += count(b);
      if (mass * 8 > total_) return highest(from, to);
    }
    // A careless mask takes in the wall behind: the nearest mode that matters is the person.
    const int largest = highest(0, kBins - 1);
    for (int b = 1, mode = 0, mass = 0; b < largest; ++b) {
      mass += count(b);
      if (smooth(b) > smooth(mode)) mode = b;
      if (4 * smooth(b) >= smooth(mode)) continue;
      if (5 * mass > total_ && smooth(mode) > 0) return mode;  // it has ended before the largest
      mode = b, mass = 0;
    }
    return largest;
  }

  std::array<int, kBins> histogram_{};
  int total_ = 0;
  std::vector<float> values_;
  cv::Mat_<std::uint16_t> on_mask_;
};

}  // namespace stillpoint
