// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "stillpoint/core/bit_mask.hpp"
#include "stillpoint/core/cell_labels.hpp"
#include "stillpoint/core/config.hpp"
#include "stillpoint/core/depth_view.hpp"
#include "stillpoint/core/instance.hpp"
#include "stillpoint/core/scratch.hpp"
#include "stillpoint/depth/depth_mask_fuser_settings.hpp"
#include "stillpoint/depth/dilate.hpp"
#include "stillpoint/depth/floor_plane.hpp"
#include "stillpoint/depth/object_depth_range.hpp"
#include "stillpoint/depth/stratified_samples.hpp"

namespace stillpoint {

/// An object's region on cells with one depth sample each: those on its mask in its depth range are
/// the core, and the core grows over connected depth, but not into the floor, nor into what is
/// known to be static.
class RegionCells {
 public:
  /// Grows the region of an instance whose mask's samples and range `ranges` has just found.
  /// `known_static`, if given, is asked where it grows. O(cells of the box and of what it grows
  /// over).
  void grow(const DepthView& depth, const StratifiedSamples& samples, const InversePlane& floor,
            const ObjectDepthRange& ranges, const DepthRange& range, const Instance& instance,
            const DepthMaskFuserSettings& settings, const CellLabels* known_static) {
    const int cell = settings.cell_px;
    const cv::Rect& box = instance.box;
    const bool bare = instance.mask.empty();
    const float cells_per_m = depth.focal_px() / range.middle_m / static_cast<float>(cell);
    const int reach = std::max(1, static_cast<int>(settings.growth_m * cells_per_m + 0.5f));
    const int slack =
        instance.predicted ? static_cast<int>(kPredictedSlackM * cells_per_m + 0.5f) : 0;
    cells_ = samples.cells_of(grow_rect(box, bare ? cell : (reach + 1) * cell, depth.size()));
    stride_ = static_cast<std::size_t>(cells_.width) + 2;
    const std::size_t n = stride_ * (static_cast<std::size_t>(cells_.height) + 2);
    if (z_.size() < n) z_.resize(n);
    // A rim of kOutside around the cells spares asking for their borders.
    detail::refill(state_, n, kOutside);
    for (int y = 0; y < cells_.height; ++y)
      std::fill_n(state_.begin() + static_cast<std::ptrdiff_t>(index(0, y)), cells_.width,
                  kUnknown);
    used_ = samples.cells_of(box) - cells_.tl();
    seed_core(depth, samples, floor, ranges, range);
    if (!bare) keep_parts(depth, samples, floor, ranges.samples_on_mask(), slack);
    queue_border();
    spread(depth, samples, floor, range, settings.range_m, reach, known_static);
    // One cell more: pixels of the region lie in the cells around it, too.
    used_ = cv::Rect(used_.x - 1, used_.y - 1, used_.width + 2, used_.height + 2) &
            cv::Rect(0, 0, cells_.width, cells_.height);
    row_ = -2;
  }

  /// The cells around the object's box and region, in the picture's cells.
  cv::Rect used() const { return used_ + cells_.tl(); }

  /// A row of used(), as bits (cell x is bit x % 64 of word x / 64): the cells all of whose
  /// neighbors are in the region too, all of whose pixels are the object's; and the other cells in
  /// the region or beside it, whose pixels are told apart by range().
  struct Row {
    std::vector<std::uint64_t> inner, rim;
  };

  /// The row of cells; ask for rows in order. O(cells).
  const Row& row(int row) {
    const int y = used_.y + row;
    if (row_ != row - 1) {
      for (auto* words : {&part_.inner, &part_.rim})
        words->resize(detail::words_for(static_cast<std::size_t>(used_.width)));
      load_row(y - 1), load_row(y);
    }
    load_row(y + 1);
    row_ = row;
    const std::size_t n = static_cast<std::size_t>(used_.width) + 2;
    merge_rows(low_rows_[0].data(), low_rows_[1].data(), low_rows_[2].data(), high_rows_[0].data(),
               high_rows_[1].data(), high_rows_[2].data(), n, low_.data(), high_.data());
    for (std::size_t k = 0; k < part_.rim.size(); ++k) {
      // Bit 0 of the loaded rows is the cell left of the first.
      const auto any = [&](std::size_t i) { return bits_[0][i] | bits_[1][i] | bits_[2][i]; };
      const auto all = [&](std::size_t i) { return bits_[0][i] & bits_[1][i] & bits_[2][i]; };
      const std::uint64_t any_0 = any(k), any_1 = any(k + 1), all_0 = all(k), all_1 = all(k + 1);
      const std::uint64_t in = all_0 & (all_0 >> 1 | all_1 << 63) & (all_0 >> 2 | all_1 << 62);
      part_.inner[k] = in;
      part_.rim[k] = (any_0 | any_0 >> 1 | any_1 << 63 | any_0 >> 2 | any_1 << 62) & ~in;
    }
    // What is marked beyond the last cell stands for none.
    if (const std::size_t rest = (n - 2) % 64; rest != 0)
      part_.rim.back() &= ~(~std::uint64_t{0} << rest);
    return part_;
  }

  /// The depths, in units, of the pixels of a cell in the rim of the row last asked for: what the
  /// samples of the cell and of its eight neighbors in the region took, with some slack.
  struct Range {
    std::uint16_t lo, span;
  };
  Range range(const DepthView& depth, int x) const {
    const std::size_t i = static_cast<std::size_t>(x);
    const float high = std::max({high_[i], high_[i + 1], high_[i + 2]});
    const float low = std::min({low_[i], low_[i + 1], low_[i + 2]});
    const float slack = 0.03f + 0.01f * low;
    const int from = std::max(1, depth.first_units(low - slack));
    const int to = std::max(from, depth.last_units(high + slack));
    return {static_cast<std::uint16_t>(from), static_cast<std::uint16_t>(to - from)};
  }

 private:
  static constexpr std::uint8_t kUnknown = 0, kOutside = 1, kOpen = 2, kRegion = 3, kPart = 4;
  static constexpr int kNext[4][2] = {{-1, 0}, {1, 0}, {0, -1}, {0, 1}};
  static constexpr float kNone = 1e9f;
  static constexpr float kPredictedSlackM = 0.06f;  // how far off a predicted mask may be
  struct Visit {
    int x, y, distance;
  };

  std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y + 1) * stride_ + static_cast<std::size_t>(x + 1);
  }

  void seed_core(const DepthView& depth, const StratifiedSamples& samples,
                 const InversePlane& floor, const ObjectDepthRange& ranges,
                 const DepthRange& range) {
    const float slack = 0.05f, lo = range.lo_m - slack, hi = range.hi_m + slack;
    const std::uint16_t* sample = ranges.samples_on_mask();
    for (int y = used_.y; y < used_.y + used_.height; ++y, sample += used_.width) {
      const std::size_t i = index(used_.x, y);
      seed_row(sample, static_cast<std::size_t>(used_.width), depth.metres_per_unit_value(), lo, hi,
               z_.data() + i, state_.data() + i);
      if (!floor.found || !row_may_be_floor(depth, samples, floor, y, hi)) continue;
      for (int x = 0; x < used_.width; ++x) {
        const std::size_t j = i + static_cast<std::size_t>(x);
        if (state_[j] != kRegion) continue;
        if (is_floor(depth, floor, place(samples, depth, used_.x + x, y), z_[j]))
          state_[j] = kOutside;
      }
    }
  }

  static void seed_row(const std::uint16_t* STILLPOINT_RESTRICT sample, std::size_t n,
                       float metres_per_unit, float lo, float hi, float* STILLPOINT_RESTRICT z,
                       std::uint8_t* STILLPOINT_RESTRICT state) {
    for (std::size_t x = 0; x < n; ++x) {
      z[x] = static_cast<float>(sample[x]) * metres_per_unit;
      const bool in_range = (sample[x] != 0) & (z[x] >= lo) & (z[x] <= hi);
      state[x] = in_range ? kRegion : kUnknown;
    }
  }

  cv::Point place(const StratifiedSamples& samples, const DepthView& depth, int x, int y) const {
    return samples.place(x + cells_.x, y + cells_.y, depth.size());
  }

  // False if no sample of the row, up to `hi` away, can be floor: the plane's inverse depth is
  // largest at one end of the row, and the ends are looked at generously.
  bool row_may_be_floor(const DepthView& depth, const StratifiedSamples& samples,
                        const InversePlane& floor, int y, float hi) const {
    const int cell = samples.cell_px();
    float most = 0;
    for (const int u : {0, 1})
      for (const int v : {0, 1}) {
        const int x = (cells_.x + used_.x) * cell + u * (used_.width + 1) * cell;
        most = std::max(most, inverse_of(depth, floor, {x, (cells_.y + y + v) * cell}));
      }
    return (hi + 0.02f) * most > 0.98f;
  }

  static float inverse_of(const DepthView& depth, const InversePlane& floor, const cv::Point& p) {
    const Eigen::Vector2f ray = depth.ray(p);
    return floor.a * ray.x() + floor.b * ray.y() + floor.c;
  }

  // Within 1.5 % and 2 cm of the floor, or beyond it.
  static bool is_floor(const DepthView& depth, const InversePlane& floor, const cv::Point& p,
                       float z) {
    return floor.found && (z + 0.02f) * inverse_of(depth, floor, p) > 0.985f;
  }

  // Growth begins at the core's border; the inner cells have no neighbor to offer.
  void queue_border() {
    queue_.clear();
    for (int y = used_.y; y < used_.y + used_.height; ++y) {
      const std::size_t i = index(used_.x, y);
      const std::uint8_t* s = state_.data() + i;
      border_.resize(std::max(border_.size(), static_cast<std::size_t>(used_.width)));
      mark_border(s, s - stride_, s + stride_, static_cast<std::size_t>(used_.width),
                  border_.data());
      visit_marked([&](int x) { queue_.push_back({used_.x + x, y, 0}); });
    }
  }

  // Calls `visit(x)` for the cells of a row of used_ that border_ marks.
  template <class Visitor>
  void visit_marked(Visitor&& visit) {
    const std::size_t n = static_cast<std::size_t>(used_.width);
    detail::refill(bits_[0], detail::words_for(n), std::uint64_t{0});
    detail::or_bytes(border_.data(), n, 0, bits_[0].data());
    for (std::size_t k = 0; k < bits_[0].size(); ++k)
      detail::for_each_bit(bits_[0][k], [&](int i) { visit(64 * static_cast<int>(k) + i); });
  }

  // Parts of the mask at other depths are the object's, too (an arm stretched out, a second person
  // in one mask), if they end where the mask ends, at most `slack` cells further: in a step to
  // something farther. What goes on beyond the mask is background that a careless mask took in.
  void keep_parts(const DepthView& depth, const StratifiedSamples& samples,
                  const InversePlane& floor, const std::uint16_t* sample, int slack) {
    std::size_t on_mask = 0, core = 0;
    const std::size_t width = static_cast<std::size_t>(used_.width);
    for (int y = 0; y < used_.height; ++y)
      count_row(sample + static_cast<std::size_t>(y) * width,
                state_.data() + index(used_.x, used_.y + y), width, on_mask, core);
    const std::size_t least = std::max<std::size_t>(6, on_mask / 25);
    if (on_mask < core + least) return;
    queue_.clear();
    if (border_.size() < width) border_.resize(width);
    for (int y = used_.y; y < used_.y + used_.height; ++y) {
      mark_unknown(sample + static_cast<std::size_t>(y - used_.y) * width,
                   state_.data() + index(used_.x, y), width, border_.data());
      visit_marked([&](int in_row) {
        const int x = used_.x + in_row;
        if (state_[index(x, y)] != kUnknown) return;  // in a part found since
        const std::size_t begin = queue_.size();
        if (collect_part(depth, samples, floor, sample, x, y, slack) < least) return;
        for (std::size_t k = begin; k < queue_.size(); ++k)
          if (queue_[k].distance == 0) state_[index(queue_[k].x, queue_[k].y)] = kRegion;
      });
    }
    for (const Visit& v : queue_)
      if (state_[index(v.x, v.y)] == kPart) state_[index(v.x, v.y)] = kUnknown;
  }

  static void mark_unknown(const std::uint16_t* STILLPOINT_RESTRICT sample,
                           const std::uint8_t* STILLPOINT_RESTRICT state, std::size_t n,
                           std::uint8_t* STILLPOINT_RESTRICT marked) {
    for (std::size_t x = 0; x < n; ++x) marked[x] = (sample[x] != 0) & (state[x] == kUnknown);
  }

  static void count_row(const std::uint16_t* STILLPOINT_RESTRICT sample,
                        const std::uint8_t* STILLPOINT_RESTRICT state, std::size_t n,
                        std::size_t& on_mask, std::size_t& core) {
    unsigned measured = 0, region = 0;
    for (std::size_t x = 0; x < n; ++x) measured += sample[x] != 0, region += state[x] == kRegion;
    on_mask += measured, core += region;
  }

  bool sample_at(const std::uint16_t* sample, int x, int y) const {
    return used_.contains({x, y}) &&
           sample[static_cast<std::size_t>((y - used_.y) * used_.width + x - used_.x)] != 0;
  }

  // Adds the cells of the mask that hang together with a cell to the queue, and those up to `slack`
  // cells beyond it. Returns how many are on the mask; 0 if their border is not one of steps.
  std::size_t collect_part(const DepthView& depth, const StratifiedSamples& samples,
                           const InversePlane& floor, const std::uint16_t* sample, int x0, int y0,
                           int slack) {
    int steps = 0, goes_on = 0;
    std::size_t on_mask = 0;
    std::size_t k = queue_.size();
    state_[index(x0, y0)] = kPart;
    queue_.push_back({x0, y0, 0});
    for (; k < queue_.size(); ++k) {
      const Visit visit = queue_[k];
      on_mask += visit.distance == 0;
      const float z = z_[index(visit.x, visit.y)], step = std::max(0.03f, 0.02f * z);
      if (is_floor(depth, floor, place(samples, depth, visit.x, visit.y), z)) ++goes_on;
      for (const auto& next : kNext) {
        const int x = visit.x + next[0], y = visit.y + next[1];
        if (!cv::Rect(0, 0, cells_.width, cells_.height).contains({x, y})) continue;
        const std::size_t j = index(x, y);
        if (sample_at(sample, x, y)) {
          if (state_[j] != kUnknown || std::abs(z_[j] - z) > step) continue;
          state_[j] = kPart;
          queue_.push_back({x, y, 0});
          continue;
        }
        if (state_[j] == kPart) continue;
        const cv::Point p = place(samples, depth, x, y);
        const float beyond = depth.to_m(depth.row(p.y)[p.x]);
        if (beyond > z + step) {
          steps += 2;
        } else if (beyond == 0) {  // cameras measure nothing beside a step, and on much else
          ++steps;
        } else if (beyond > z - step) {  // what is nearer hides where the part ends
          if (visit.distance == slack) {
            goes_on += 2;
            continue;
          }
          state_[j] = kPart;
          z_[j] = beyond;
          queue_.push_back({x, y, visit.distance + 1});
        }
      }
    }
    return steps > goes_on ? on_mask : 0;
  }

  static void mark_border(const std::uint8_t* s, const std::uint8_t* above,
                          const std::uint8_t* below, std::size_t n,
                          std::uint8_t* STILLPOINT_RESTRICT border) {
    const std::uint8_t *left = s - 1, *right = s + 1;
    for (std::size_t x = 0; x < n; ++x)
      border[x] = (s[x] == kRegion) & ((left[x] == kUnknown) | (right[x] == kUnknown) |
                                       (above[x] == kUnknown) | (below[x] == kUnknown));
  }

  // Breadth first over cells whose depth goes on without a step.
  void spread(const DepthView& depth, const StratifiedSamples& samples, const InversePlane& floor,
              const DepthRange& range, float range_m, int reach, const CellLabels* known_static) {
    const float lo = range.lo_m - range_m, hi = range.hi_m + range_m;
    int x0 = used_.x, y0 = used_.y, x1 = used_.x + used_.width, y1 = used_.y + used_.height;
    for (std::size_t k = 0; k < queue_.size(); ++k) {
      const Visit visit = queue_[k];
      if (visit.distance >= reach) continue;
      const std::size_t i = index(visit.x, visit.y);
      const float z = z_[i], step = std::max(0.03f, 0.02f * z);
      const std::size_t beside[4] = {i - 1, i + 1, i - stride_, i + stride_};
      for (int n = 0; n < 4; ++n) {
        const std::size_t j = beside[n];
        if (state_[j] == kRegion || state_[j] == kOutside) continue;
        const int x = visit.x + kNext[n][0], y = visit.y + kNext[n][1];
        if (state_[j] == kUnknown) {
          const cv::Point p = place(samples, depth, x, y);
          z_[j] = depth.to_m(depth.row(p.y)[p.x]);
          const bool in_range = z_[j] > 0 && z_[j] >= lo && z_[j] <= hi;
          state_[j] = in_range && !is_floor(depth, floor, p, z_[j]) &&
                              !(known_static && known_static->known_static(p))
                          ? kOpen
                          : kOutside;
        }
        if (state_[j] != kOpen || std::abs(z_[j] - z) > step) continue;
        state_[j] = kRegion;
        queue_.push_back({x, y, visit.distance + 1});
        x0 = std::min(x0, x), y0 = std::min(y0, y);
        x1 = std::max(x1, x + 1), y1 = std::max(y1, y + 1);
      }
    }
    used_ = cv::Rect(x0, y0, x1 - x0, y1 - y0);
  }

  // Takes in the next row of cells: depths of the region, kNone and 0 elsewhere. Row y may lie one
  // beyond the cells.
  void load_row(int y) {
    std::swap(low_rows_[0], low_rows_[1]), std::swap(low_rows_[1], low_rows_[2]);
    std::swap(high_rows_[0], high_rows_[1]), std::swap(high_rows_[1], high_rows_[2]);
    std::swap(bits_[0], bits_[1]), std::swap(bits_[1], bits_[2]);
    const std::size_t n = static_cast<std::size_t>(used_.width) + 2, i = index(used_.x - 1, y);
    for (auto* v : {&low_rows_[2], &high_rows_[2], &low_, &high_})
      if (v->size() < n) v->resize(n);
    if (border_.size() < n) border_.resize(n);
    split_row(z_.data() + i, state_.data() + i, n, low_rows_[2].data(), high_rows_[2].data());
    mark_region(state_.data() + i, n, border_.data());
    // A word more, for the words are read shifted.
    detail::refill(bits_[2], detail::words_for(n) + 1, std::uint64_t{0});
    detail::or_bytes(border_.data(), n, 0, bits_[2].data());
  }

  static void mark_region(const std::uint8_t* STILLPOINT_RESTRICT state, std::size_t n,
                          std::uint8_t* STILLPOINT_RESTRICT marked) {
    for (std::size_t x = 0; x < n; ++x) marked[x] = state[x] == kRegion ? 255 : 0;
  }

  static void split_row(const float* STILLPOINT_RESTRICT z,
                        const std::uint8_t* STILLPOINT_RESTRICT state, std::size_t n,
                        float* STILLPOINT_RESTRICT low, float* STILLPOINT_RESTRICT high) {
    for (std::size_t x = 0; x < n; ++x) {  // hard to foresee: no branch
      const float in = static_cast<float>(state[x] == kRegion);
      high[x] = z[x] * in;
      low[x] = high[x] + kNone * (1 - in);
    }
  }

  static void merge_rows(const float* STILLPOINT_RESTRICT a, const float* STILLPOINT_RESTRICT b,
                         const float* STILLPOINT_RESTRICT c, const float* STILLPOINT_RESTRICT d,
                         const float* STILLPOINT_RESTRICT e, const float* STILLPOINT_RESTRICT f,
                         std::size_t n, float* STILLPOINT_RESTRICT low,
                         float* STILLPOINT_RESTRICT high) {
    for (std::size_t x = 0; x < n; ++x) {
      const float ab = a[x] < b[x] ? a[x] : b[x], de = d[x] > e[x] ? d[x] : e[x];
      low[x] = ab < c[x] ? ab : c[x];
      high[x] = de > f[x] ? de : f[x];
    }
  }

  cv::Rect cells_;  // the cells that may be looked at
  cv::Rect used_;   // those that are in use, relative to cells_
  std::size_t stride_ = 0;
  std::vector<float> z_;
  std::vector<std::uint8_t> state_, border_;
  std::vector<Visit> queue_;
  std::array<std::vector<float>, 3> low_rows_, high_rows_;
  std::vector<float> low_, high_;
  std::array<std::vector<std::uint64_t>, 3> bits_;
  Row part_;
  int row_ = -2;
};

}  // namespace stillpoint
