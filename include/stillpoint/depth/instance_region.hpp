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

  // Rows are worked on in parts of kRowPart pixels, the last one overlapping the one before.
  enum class Part : std::uint8_t { kOutside, kMixed, kInside };

  std::size_t part_count() const {
    const std::size_t w = static_cast<std::size_t>(area_.width);
    return w <= detail::kRowPart ? 1 : (w + detail::kRowPart - 1) / detail::kRowPart;
  }
  std::size_t part_begin(std::size_t part) const {
    const std::size_t w = static_cast<std::size_t>(area_.width);
    return w <= detail::kRowPart ? 0 : std::min(part * detail::kRowPart, w - detail::kRowPart);
  }

  // Each cell's pixels in the range of depths around it; what has no depth stays as the segmenter
  // said, and what the camera did not measure right beside the object is its, too: at outlines it
  // measures nothing.
  void write_pixels(const DepthView& depth, const Instance& instance, cv::Mat& out) {
    const int cell = settings_.cell_px;
    const cv::Rect used = cells_.used();
    const std::size_t cells = static_cast<std::size_t>(used.width);
    const std::size_t columns = cells * static_cast<std::size_t>(cell), parts = part_count();
    for (auto* v : {&cell_lo_, &cell_span_})
      if (v->size() < cells) v->resize(cells);
    for (auto* v : {&lo_, &span_})
      if (v->size() < columns) v->resize(columns);
    detail::refill(mask_row_, static_cast<std::size_t>(area_.width), uchar{0});
    kinds_.resize(parts);
    detail::refill(unmeasured_, parts * static_cast<std::size_t>(area_.height), std::uint8_t{0});
    for (int cy = 0; cy < used.height; ++cy) {
      const cv::Range range = cells_.set_ranges(depth, cy, cell_lo_.data(), cell_span_.data());
      for (int cx = 0; cx < used.width; ++cx) {
        fill_cell(cell_lo_[static_cast<std::size_t>(cx)], lo_.data() + cx * cell);
        fill_cell(cell_span_[static_cast<std::size_t>(cx)], span_.data() + cx * cell);
      }
      set_kinds(range);
      const int y_end = std::min((cy + 1) * cell, area_.height);
      for (int y = cy * cell; y < y_end; ++y) write_row(depth, instance, y, out.ptr<uchar>(y));
    }
    claim_unmeasured_rim(depth, out);
  }

  // Of the parts of a row of cells, of which those in `range` have a range of depths.
  void set_kinds(const cv::Range& range) {
    const std::size_t cell = static_cast<std::size_t>(settings_.cell_px);
    for (std::size_t k = 0; k < kinds_.size(); ++k) {
      const std::size_t begin = part_begin(k);
      const std::size_t end =
          std::min(begin + detail::kRowPart, static_cast<std::size_t>(area_.width));
      const int first = static_cast<int>(begin / cell), last = static_cast<int>((end - 1) / cell);
      kinds_[k] = Part::kMixed;
      if (last < range.start || first >= range.end) {
        kinds_[k] = Part::kOutside;
      } else {
        std::uint16_t least = RegionCells::kInner;
        for (int cx = first; cx <= last; ++cx)
          least = std::min(least, cell_span_[static_cast<std::size_t>(cx)]);
        if (least == RegionCells::kInner) kinds_[k] = Part::kInside;
      }
    }
  }

  void fill_cell(std::uint16_t value, std::uint16_t* to) const {
    const std::uint64_t four = value * 0x0001000100010001ull;
    int i = 0;
    for (; i + 4 <= settings_.cell_px; i += 4) std::memcpy(to + i, &four, sizeof four);
    for (; i < settings_.cell_px; ++i) to[i] = value;
  }

  void write_row(const DepthView& depth, const Instance& instance, int y, uchar* to) {
    const std::uint16_t* z = depth.row(area_.y + y) + area_.x;
    const int in_box = area_.y + y - instance.box.y;
    const std::size_t left = static_cast<std::size_t>(instance.box.x - area_.x);
    const std::size_t width = static_cast<std::size_t>(instance.box.width);
    if (!instance.mask.empty() && in_box >= 0 && in_box < instance.box.height)
      std::memcpy(mask_row_.data() + left, instance.mask.ptr<uchar>(in_box), width);
    else
      std::memset(mask_row_.data() + left, 0, width);
    std::uint8_t* unmeasured = unmeasured_.data() + static_cast<std::size_t>(y) * kinds_.size();
    for (std::size_t k = 0; k < kinds_.size(); ++k) {
      const std::size_t at = part_begin(k);
      const std::size_t n = std::min(detail::kRowPart, static_cast<std::size_t>(area_.width) - at);
      if (kinds_[k] == Part::kInside)
        std::memset(to + at, 255, n);
      else if (n == detail::kRowPart)
        unmeasured[k] = write_part(z + at, lo_.data() + at, span_.data() + at,
                                   mask_row_.data() + at, detail::kRowPart, to + at);
      else
        unmeasured[k] = write_part(z + at, lo_.data() + at, span_.data() + at,
                                   mask_row_.data() + at, n, to + at);
    }
  }

  // Not 0 if there are pixels without depth.
  static std::uint8_t write_part(const std::uint16_t* STILLPOINT_RESTRICT z,
                                 const std::uint16_t* STILLPOINT_RESTRICT lo,
                                 const std::uint16_t* STILLPOINT_RESTRICT span,
                                 const uchar* STILLPOINT_RESTRICT mask, std::size_t n,
                                 uchar* STILLPOINT_RESTRICT to) {
    uchar any = 0;
    for (std::size_t x = 0; x < n; ++x) {
      const std::uint16_t offset = static_cast<std::uint16_t>(z[x] - lo[x]);
      const uchar in_range = offset <= span[x] ? 255 : 0, unmeasured = z[x] == 0 ? 255 : 0;
      to[x] = static_cast<uchar>(in_range | (unmeasured & mask[x]));
      any = static_cast<uchar>(any | unmeasured);
    }
    return any;
  }

  void claim_unmeasured_rim(const DepthView& depth, cv::Mat& out) {
    // Rows as they were, with a pixel more on both sides: the rim does not grow on itself.
    const std::size_t w = static_cast<std::size_t>(out.cols), parts = kinds_.size();
    for (auto& row : rim_rows_) detail::refill(row, w + 2, uchar{0});
    std::memcpy(rim_rows_[1].data() + 1, out.ptr<uchar>(0), w);
    for (int y = 0; y < out.rows; ++y) {
      if (y + 1 < out.rows)
        std::memcpy(rim_rows_[2].data() + 1, out.ptr<uchar>(y + 1), w);
      else
        std::memset(rim_rows_[2].data(), 0, w + 2);
      const std::uint16_t* z = depth.row(area_.y + y) + area_.x;
      uchar* to = out.ptr<uchar>(y);
      const std::uint8_t* unmeasured = unmeasured_.data() + static_cast<std::size_t>(y) * parts;
      for (std::size_t k = 0; k < parts; ++k) {
        if (!unmeasured[k]) continue;
        const std::size_t at = part_begin(k), n = std::min(detail::kRowPart, w - at);
        claim_part(z + at, rim_rows_[0].data() + at, rim_rows_[1].data() + at,
                   rim_rows_[2].data() + at, n, to + at);
      }
      std::swap(rim_rows_[0], rim_rows_[1]);
      std::swap(rim_rows_[1], rim_rows_[2]);
    }
  }

  // Row a is above, b the pixels' own, c below; each begins a pixel before z.
  static void claim_part(const std::uint16_t* STILLPOINT_RESTRICT z,
                         const uchar* STILLPOINT_RESTRICT a, const uchar* STILLPOINT_RESTRICT b,
                         const uchar* STILLPOINT_RESTRICT c, std::size_t n,
                         uchar* STILLPOINT_RESTRICT to) {
    uchar column[detail::kRowPart + 2];
    for (std::size_t x = 0; x < n + 2; ++x) column[x] = static_cast<uchar>(a[x] | b[x] | c[x]);
    for (std::size_t x = 0; x < n; ++x) {
      const uchar unmeasured = z[x] == 0 ? 255 : 0;
      to[x] =
          static_cast<uchar>(to[x] | (unmeasured & (column[x] | column[x + 1] | column[x + 2])));
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
  std::vector<uchar> mask_row_;
  std::vector<Part> kinds_;               // of the row of cells being written
  std::vector<std::uint8_t> unmeasured_;  // per row and part
  std::array<std::vector<uchar>, 3> rim_rows_;
};

}  // namespace stillpoint
