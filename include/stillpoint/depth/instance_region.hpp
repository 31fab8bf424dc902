// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <opencv2/core.hpp>
#include <vector>

#include "stillpoint/core/byte_rows.hpp"
#include "stillpoint/core/config.hpp"
#include "stillpoint/core/depth_view.hpp"
#include "stillpoint/core/instance.hpp"
#include "stillpoint/core/scratch.hpp"
#include "stillpoint/depth/depth_mask_fuser_settings.hpp"
#include "stillpoint/depth/dilate.hpp"
#include "stillpoint/depth/floor_plane.hpp"
#include "stillpoint/depth/object_depth_range.hpp"
#include "stillpoint/depth/region_cells.hpp"
#include "stillpoint/depth/stratified_samples.hpp"

namespace stillpoint {

/// Turns one instance and the depth around it into its region of the mask: the work of
/// DepthMaskFuser per instance. First on cells with one depth sample each (RegionCells), then on
/// pixels: each cell's pixels in the range of depths around it.
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
    if (connected) {
      cells_.grow(depth, samples_, floor_, ranges_, range_, instance.box, instance.mask.empty(),
                  settings_);
      const int cell = settings_.cell_px;
      const cv::Rect used = cells_.used();
      area_ = cv::Rect(used.x * cell, used.y * cell, used.width * cell, used.height * cell) &
              cv::Rect(cv::Point(), depth.size());
    }
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
  void add_box_range(const DepthView& depth, cv::Mat& out) {
    const int lo = std::max(1, depth.first_units(range_.lo_m)), hi = depth.last_units(range_.hi_m);
    for (int y = 0; y < area_.height; ++y) {
      const std::uint16_t* z = depth.row(area_.y + y) + area_.x;
      uchar* to = out.ptr<uchar>(y);
      for (int x = 0; x < area_.width; ++x) to[x] |= z[x] >= lo && z[x] <= hi ? 255 : 0;
    }
  }

  void write_pixels(const DepthView& depth, const Instance& instance, cv::Mat& out) {
    const int cell = settings_.cell_px;
    const cv::Rect used = cells_.used();
    const std::size_t cells = static_cast<std::size_t>(used.width);
    const std::size_t columns = cells * static_cast<std::size_t>(cell);
    for (auto* v : {&cell_lo_, &cell_span_})
      if (v->size() < cells) v->resize(cells);
    for (auto* v : {&lo_, &span_})
      if (v->size() < columns) v->resize(columns);
    for (int cy = 0; cy < used.height; ++cy) {
      const cv::Range range = cells_.set_ranges(depth, cy, cell_lo_.data(), cell_span_.data());
      for (int cx = range.start; cx < range.end; ++cx) {
        fill_cell(cell_lo_[static_cast<std::size_t>(cx)], lo_.data() + cx * cell);
        fill_cell(cell_span_[static_cast<std::size_t>(cx)], span_.data() + cx * cell);
      }
      const cv::Range pixels(std::min(range.start * cell, area_.width),
                             std::min(range.end * cell, area_.width));
      const int y_end = std::min((cy + 1) * cell, area_.height);
      for (int y = cy * cell; y < y_end; ++y)
        write_row(depth, instance, y, pixels, out.ptr<uchar>(y));
    }
  }

  void fill_cell(std::uint16_t value, std::uint16_t* to) const {
    const std::uint64_t four = value * 0x0001000100010001ull;
    int i = 0;
    for (; i + 4 <= settings_.cell_px; i += 4) std::memcpy(to + i, &four, sizeof four);
    for (; i < settings_.cell_px; ++i) to[i] = value;
  }

  // Only the columns `pixels` can hold depths of the region.
  void write_row(const DepthView& depth, const Instance& instance, int y, const cv::Range& pixels,
                 uchar* to) const {
    const std::uint16_t* z = depth.row(area_.y + y) + area_.x;
    std::memset(to, 0, static_cast<std::size_t>(area_.width));
    if (pixels.size() > 0) {
      const std::size_t first = static_cast<std::size_t>(pixels.start);
      detail::in_parts(static_cast<std::size_t>(pixels.size()), [&](std::size_t i, std::size_t n) {
        const std::size_t at = first + i;
        select_range(z + at, lo_.data() + at, span_.data() + at, n, to + at);
      });
    }
    // What has no depth stays as the segmenter said.
    const int in_box = area_.y + y - instance.box.y;
    if (instance.mask.empty() || in_box < 0 || in_box >= instance.box.height) return;
    const std::size_t at = static_cast<std::size_t>(instance.box.x - area_.x);
    const uchar* mask = instance.mask.ptr<uchar>(in_box);
    detail::in_parts(static_cast<std::size_t>(instance.box.width),
                     [&](std::size_t i, std::size_t n) {
                       keep_unmeasured(z + at + i, mask + i, n, to + at + i);
                     });
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
      const std::uint16_t* z = depth.row(area_.y + y) + area_.x;
      uchar* to = out.ptr<uchar>(y);
      detail::in_parts(w, [&](std::size_t i, std::size_t n) {
        claim_part(z + i, rim_rows_[0].data() + i, rim_rows_[1].data() + i, rim_rows_[2].data() + i,
                   n, to + i);
      });
      std::swap(rim_rows_[0], rim_rows_[1]);
      std::swap(rim_rows_[1], rim_rows_[2]);
    }
  }

  static void widen_row(const uchar* in, std::size_t n, uchar* to) {
    to[0] = static_cast<uchar>(in[0] | (n > 1 ? in[1] : 0));
    if (n > 2)
      detail::in_parts(
          n - 2, [=](std::size_t i, std::size_t part) { widen_part(in + i, part, to + i + 1); });
    if (n > 1) to[n - 1] = static_cast<uchar>(in[n - 2] | in[n - 1]);
  }

  static void widen_part(const uchar* STILLPOINT_RESTRICT in, std::size_t n,
                         uchar* STILLPOINT_RESTRICT to) {
    for (std::size_t x = 0; x < n; ++x) to[x] = static_cast<uchar>(in[x] | in[x + 1] | in[x + 2]);
  }

  static void claim_part(const std::uint16_t* STILLPOINT_RESTRICT z,
                         const uchar* STILLPOINT_RESTRICT a, const uchar* STILLPOINT_RESTRICT b,
                         const uchar* STILLPOINT_RESTRICT c, std::size_t n,
                         uchar* STILLPOINT_RESTRICT to) {
    for (std::size_t x = 0; x < n; ++x) {
      const uchar unmeasured = z[x] == 0 ? 255 : 0;
      to[x] = static_cast<uchar>(to[x] | (unmeasured & (a[x] | b[x] | c[x])));
    }
  }

  DepthMaskFuserSettings settings_;
  StratifiedSamples samples_;
  ObjectDepthRange ranges_;
  RegionCells cells_;
  InversePlane floor_;
  std::vector<InverseSample> floor_samples_;
  DepthRange range_;
  cv::Rect area_;  // the pixels that are written
  std::vector<std::uint16_t> cell_lo_, cell_span_, lo_, span_;
  std::array<std::vector<uchar>, 3> rim_rows_;
};

}  // namespace stillpoint
