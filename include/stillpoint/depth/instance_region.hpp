// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <opencv2/core.hpp>
#include <vector>

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

/// Turns one instance and the depth around it into its region of the mask: the work of
/// DepthMaskFuser per instance. First on cells with one depth sample each: those on the mask in the
/// object's depth range are its core, and the core grows over connected depth, but not into the
/// floor. Then on pixels: each cell's pixels in the range of depths around it.
class InstanceRegion {
 public:
  explicit InstanceRegion(const DepthMaskFuserSettings& settings)
      : settings_(settings), samples_(settings.cell_px, settings.seed) {}

  /// Finds the floor among samples outside the instances' boxes, the last frame's floor first.
  /// O(samples).
  void begin_frame(const DepthView& depth, const std::vector<Instance>& instances) {
    if (settings_.method == DepthMaskFuserSettings::Method::kPaper || instances.empty()) return;
    floor_samples_.clear();
    const cv::Size size = depth.size();
    const int step = std::max(8, size.width / 28);
    for (int y = step / 2; y < size.height; y += step) {
      const std::uint16_t* row = depth.row(y);
      for (int x = step / 2; x < size.width; x += step) {
        if (row[x] == 0) continue;
        const cv::Point p(x, y);
        bool outside = true;
        for (const Instance& s : instances) outside = outside && !s.box.contains(p);
        if (outside)
          floor_samples_.push_back({depth.ray_x(static_cast<float>(x)),
                                    depth.ray_y(static_cast<float>(y)), 1 / depth.to_m(row[x])});
      }
    }
    floor_ = find_floor(floor_samples_, floor_, settings_.seed);
  }

  /// Writes the instance's region: `out.box` may cover more than the instance's box, `out.mask` has
  /// its size and lies in `buffer`, which outlives it.
  void fuse(const DepthView& depth, const Instance& instance, std::vector<uchar>& buffer,
            Instance& out) {
    out.class_name = instance.class_name;
    out.score = instance.score;
    const bool paper = settings_.method == DepthMaskFuserSettings::Method::kPaper;
    const bool connected = !paper && ranges_.find_on_mask(depth, samples_, instance, range_);
    area_ = instance.box;
    if (connected) grow(depth, instance);
    out.box = area_;
    buffer.resize(std::max(buffer.size(), static_cast<std::size_t>(area_.area())));
    out.mask = cv::Mat(area_.size(), CV_8UC1, buffer.data());
    if (connected) {
      write_pixels(depth, instance, out.mask);
      claim_unmeasured_rim(depth, out.mask);
      return;
    }
    const bool in_box =
        paper && ranges_.find_in_box(depth, samples_, area_, settings_.range_m, range_);
    // Without depth to judge by, a mask stays as it is, and a bare box is full.
    if (instance.mask.empty())
      out.mask.setTo(in_box ? 0 : 255);
    else
      instance.mask.copyTo(out.mask);
    if (in_box) add_box_range(depth, out.mask);
  }

 private:
  enum State : std::uint8_t { kUnknown, kOutside, kOpen, kRegion };
  struct Visit {
    int x, y, distance;
  };

  void add_box_range(const DepthView& depth, cv::Mat& out) {
    const int lo = std::max(1, depth.first_units(range_.lo_m)), hi = depth.last_units(range_.hi_m);
    for (int y = 0; y < area_.height; ++y) {
      const std::uint16_t* z = depth.row(area_.y + y) + area_.x;
      uchar* to = out.ptr<uchar>(y);
      for (int x = 0; x < area_.width; ++x) to[x] |= z[x] >= lo && z[x] <= hi ? 255 : 0;
    }
  }

  // --- on cells -----------------------------------------------------------------------------

  std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(cells_.width) +
           static_cast<std::size_t>(x);
  }

  void grow(const DepthView& depth, const Instance& instance) {
    const int cell = settings_.cell_px;
    const float px_per_m = depth.focal_px() / range_.middle_m;
    const int reach = std::max(
        1, static_cast<int>(settings_.growth_m * px_per_m / static_cast<float>(cell) + 0.5f));
    const bool bare = instance.mask.empty();
    cells_ =
        samples_.cells_of(grow_rect(instance.box, bare ? cell : (reach + 1) * cell, depth.size()));
    z_.resize(std::max(z_.size(), static_cast<std::size_t>(cells_.area())));
    detail::refill(state_, static_cast<std::size_t>(cells_.area()), kUnknown);
    queue_.clear();
    used_ = samples_.cells_of(instance.box) - cells_.tl();
    seed_core(depth, instance);
    grow_over_connected_depth(depth, reach);
    // Pixels are written where the region is, and where the mask has pixels without depth.
    const cv::Rect around = cv::Rect(used_.x - 1, used_.y - 1, used_.width + 2, used_.height + 2) &
                            cv::Rect(0, 0, cells_.width, cells_.height);
    used_ = around;
    area_ = cv::Rect((cells_.x + used_.x) * cell, (cells_.y + used_.y) * cell, used_.width * cell,
                     used_.height * cell) &
            cv::Rect(cv::Point(), depth.size());
  }

  void seed_core(const DepthView& depth, const Instance& instance) {
    const float slack = 0.05f;
    const cv::Rect& box = instance.box;
    for (int y = used_.y; y < used_.y + used_.height; ++y)
      for (int x = used_.x; x < used_.x + used_.width; ++x) {
        const cv::Point p = samples_.place(x + cells_.x, y + cells_.y, depth.size());
        if (!box.contains(p) ||
            (instance.mask.data && instance.mask.ptr<uchar>(p.y - box.y)[p.x - box.x] == 0))
          continue;
        const std::uint16_t raw = depth.row(p.y)[p.x];
        const float z = depth.to_m(raw);
        if (raw == 0 || z < range_.lo_m - slack || z > range_.hi_m + slack) continue;
        const std::size_t i = index(x, y);
        z_[i] = z;
        state_[i] = is_floor(depth, p, z) ? kOutside : kRegion;
        if (state_[i] == kRegion) queue_.push_back({x, y, 0});
      }
  }

  bool is_floor(const DepthView& depth, const cv::Point& p, float z) const {
    if (!floor_.found) return false;
    const float inverse = floor_.a * depth.ray_x(static_cast<float>(p.x)) +
                          floor_.b * depth.ray_y(static_cast<float>(p.y)) + floor_.c;
    // Within 1.5 % and 2 cm of the floor, or beyond it.
    return (z + 0.02f) * inverse > 0.985f;
  }

  // Breadth first over cells whose depth goes on without a step.
  void grow_over_connected_depth(const DepthView& depth, int reach) {
    const float lo = range_.lo_m - settings_.range_m, hi = range_.hi_m + settings_.range_m;
    int x0 = used_.x, y0 = used_.y, x1 = used_.x + used_.width, y1 = used_.y + used_.height;
    for (std::size_t k = 0; k < queue_.size(); ++k) {
      const Visit visit = queue_[k];
      if (visit.distance >= reach) continue;
      const float z = z_[index(visit.x, visit.y)];
      const float step = std::max(0.03f, 0.02f * z);
      static constexpr int kNext[4][2] = {{-1, 0}, {1, 0}, {0, -1}, {0, 1}};
      for (const auto& next : kNext) {
        const int x = visit.x + next[0], y = visit.y + next[1];
        if (x < 0 || y < 0 || x >= cells_.width || y >= cells_.height) continue;
        const std::size_t j = index(x, y);
        if (state_[j] == kUnknown) {
          const cv::Point p = samples_.place(x + cells_.x, y + cells_.y, depth.size());
          z_[j] = depth.to_m(depth.row(p.y)[p.x]);
          const bool in_range = z_[j] > 0 && z_[j] >= lo && z_[j] <= hi;
          state_[j] = in_range && !is_floor(depth, p, z_[j]) ? kOpen : kOutside;
        }
        if (state_[j] != kOpen) continue;
        if (std::abs(z_[j] - z) > step) continue;
        state_[j] = kRegion;
        queue_.push_back({x, y, visit.distance + 1});
        x0 = std::min(x0, x), y0 = std::min(y0, y), x1 = std::max(x1, x + 1),
        y1 = std::max(y1, y + 1);
      }
    }
    used_ = cv::Rect(x0, y0, x1 - x0, y1 - y0);
  }

  // --- on pixels ----------------------------------------------------------------------------

  void write_pixels(const DepthView& depth, const Instance& instance, cv::Mat& out) {
    const int cell = settings_.cell_px;
    const std::size_t w = static_cast<std::size_t>(used_.width * cell);
    lo_.resize(std::max(lo_.size(), w)), span_.resize(std::max(span_.size(), w));
    column_lo_.resize(std::max(column_lo_.size(), static_cast<std::size_t>(cells_.width)));
    column_hi_.resize(column_lo_.size());
    for (int cy = 0; cy < used_.height; ++cy) {
      const bool any = set_cell_ranges(depth, used_.y + cy);
      const int y_end = std::min((cy + 1) * cell, area_.height);
      for (int y = cy * cell; y < y_end; ++y) write_row(depth, instance, y, any, out.ptr<uchar>(y));
    }
  }

  // The range of depths of each cell's pixels in a row of cells: what the samples of the cell and
  // its eight neighbors in the region took.
  bool set_cell_ranges(const DepthView& depth, int cy) {
    bool any_in_row = false;
    const int y0 = std::max(0, cy - 1), y1 = std::min(cells_.height - 1, cy + 1);
    const int x_first = std::max(0, used_.x - 1);
    const int x_last = std::min(cells_.width - 1, used_.x + used_.width);
    for (int x = x_first; x <= x_last; ++x) {
      float lo = 1e9f, hi = 0;
      for (int y = y0; y <= y1; ++y) {
        const std::size_t j = index(x, y);
        if (state_[j] == kRegion) lo = std::min(lo, z_[j]), hi = std::max(hi, z_[j]);
      }
      column_lo_[static_cast<std::size_t>(x)] = lo, column_hi_[static_cast<std::size_t>(x)] = hi;
    }
    for (int cx = 0; cx < used_.width; ++cx) {
      float lo = 1e9f, hi = 0;
      for (int x = std::max(x_first, used_.x + cx - 1); x <= std::min(x_last, used_.x + cx + 1);
           ++x) {
        lo = std::min(lo, column_lo_[static_cast<std::size_t>(x)]);
        hi = std::max(hi, column_hi_[static_cast<std::size_t>(x)]);
      }
      const bool any = hi > 0;
      any_in_row = any_in_row || any;
      // A cell without any takes a range that no depth has: a fraction of a millimetre.
      std::uint16_t lo_units = 1, span = 0;
      if (any) {
        const float slack = 0.03f + 0.01f * lo;
        const int a = std::max(1, depth.first_units(lo - slack));
        const int b = std::max(a, depth.last_units(hi + slack));
        lo_units = static_cast<std::uint16_t>(a), span = static_cast<std::uint16_t>(b - a);
      }
      const std::size_t cell = static_cast<std::size_t>(settings_.cell_px);
      fill(lo_.data() + static_cast<std::size_t>(cx) * cell, cell, lo_units);
      fill(span_.data() + static_cast<std::size_t>(cx) * cell, cell, span);
    }
    return any_in_row;
  }

  static void fill(std::uint16_t* to, std::size_t n, std::uint16_t value) {
    const std::uint64_t four = value * 0x0001000100010001ull;
    std::size_t i = 0;
    for (; i + 4 <= n; i += 4) std::memcpy(to + i, &four, sizeof four);
    for (; i < n; ++i) to[i] = value;
  }

  void write_row(const DepthView& depth, const Instance& instance, int y, bool any, uchar* to) {
    const std::uint16_t* z = depth.row(area_.y + y) + area_.x;
    const std::size_t w = static_cast<std::size_t>(area_.width);
    if (any)
      select_range(z, lo_.data(), span_.data(), w, to);
    else
      std::memset(to, 0, w);
    // What has no depth stays as the segmenter said.
    const int in_box = area_.y + y - instance.box.y;
    if (instance.mask.empty() || in_box < 0 || in_box >= instance.box.height) return;
    const int at = instance.box.x - area_.x;
    keep_unmeasured(z + at, instance.mask.ptr<uchar>(in_box),
                    static_cast<std::size_t>(instance.box.width), to + at);
  }

  static void select_range(const std::uint16_t* STILLPOINT_RESTRICT z,
                           const std::uint16_t* STILLPOINT_RESTRICT lo,
                           const std::uint16_t* STILLPOINT_RESTRICT span, std::size_t n,
                           uchar* STILLPOINT_RESTRICT to) {
    for (std::size_t x = 0; x < n; ++x) {
      const std::uint16_t offset = static_cast<std::uint16_t>(z[x] - lo[x]);
      to[x] = offset <= span[x] ? 255 : 0;
    }
  }

  static void keep_unmeasured(const std::uint16_t* STILLPOINT_RESTRICT z,
                              const uchar* STILLPOINT_RESTRICT mask, std::size_t n,
                              uchar* STILLPOINT_RESTRICT to) {
    for (std::size_t x = 0; x < n; ++x) {
      const uchar unmeasured = z[x] == 0 ? 255 : 0;
      to[x] = static_cast<uchar>(to[x] | (unmeasured & mask[x]));
    }
  }

  static void widen_row(const uchar* STILLPOINT_RESTRICT in, std::size_t n,
                        uchar* STILLPOINT_RESTRICT to) {
    to[0] = static_cast<uchar>(in[0] | (n > 1 ? in[1] : 0));
    for (std::size_t x = 1; x + 1 < n; ++x)
      to[x] = static_cast<uchar>(in[x - 1] | in[x] | in[x + 1]);
    if (n > 1) to[n - 1] = static_cast<uchar>(in[n - 2] | in[n - 1]);
  }

  static void claim_row(const std::uint16_t* STILLPOINT_RESTRICT z,
                        const uchar* STILLPOINT_RESTRICT a, const uchar* STILLPOINT_RESTRICT b,
                        const uchar* STILLPOINT_RESTRICT c, std::size_t n,
                        uchar* STILLPOINT_RESTRICT to) {
    for (std::size_t x = 0; x < n; ++x) {
      const uchar unmeasured = z[x] == 0 ? 255 : 0;
      to[x] = static_cast<uchar>(to[x] | (unmeasured & (a[x] | b[x] | c[x])));
    }
  }

  // The camera measures nothing right at an object's outline: such a pixel beside the object is
  // its.
  void claim_unmeasured_rim(const DepthView& depth, cv::Mat& out) {
    const std::size_t w = static_cast<std::size_t>(out.cols);
    for (auto& row : rim_rows_) detail::refill(row, w, uchar{0});
    // Rows are widened before they are written: the rim does not grow on itself.
    widen_row(out.ptr<uchar>(0), w, rim_rows_[1].data());
    for (int y = 0; y < out.rows; ++y) {
      if (y + 1 < out.rows)
        widen_row(out.ptr<uchar>(y + 1), w, rim_rows_[2].data());
      else
        std::fill(rim_rows_[2].begin(), rim_rows_[2].end(), uchar{0});
      claim_row(depth.row(area_.y + y) + area_.x, rim_rows_[0].data(), rim_rows_[1].data(),
                rim_rows_[2].data(), w, out.ptr<uchar>(y));
      std::swap(rim_rows_[0], rim_rows_[1]);
      std::swap(rim_rows_[1], rim_rows_[2]);
    }
  }

  DepthMaskFuserSettings settings_;
  StratifiedSamples samples_;
  ObjectDepthRange ranges_;
  InversePlane floor_;
  std::vector<InverseSample> floor_samples_;
  DepthRange range_;
  cv::Rect cells_;  // the cells that may be looked at
  cv::Rect used_;   // those that are in use, relative to cells_
  cv::Rect area_;   // their pixels
  std::vector<float> z_;
  std::vector<State> state_;
  std::vector<Visit> queue_;
  std::vector<float> column_lo_, column_hi_;
  std::vector<std::uint16_t> lo_, span_;
  std::array<std::vector<uchar>, 3> rim_rows_;
};

}  // namespace stillpoint
