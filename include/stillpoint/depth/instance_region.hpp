// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "stillpoint/core/bit_mask.hpp"
#include "stillpoint/core/cell_labels.hpp"
#include "stillpoint/core/config.hpp"
#include "stillpoint/core/depth_view.hpp"
#include "stillpoint/core/instance.hpp"
#include "stillpoint/core/mask_pool.hpp"
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

  /// Finds the floor among samples outside the instances, the last frame's floor first, which the
  /// camera's motion carries along if it is known. O(samples).
  void begin_frame(const DepthView& depth, const std::vector<Instance>& instances,
                   const std::optional<Eigen::Isometry3d>& T_current_last) {
    if (settings_.method == DepthMaskFuserSettings::Method::kPaper) return;
    if (T_current_last) floor_ = floor_.moved(*T_current_last);
    if (instances.empty()) return;
    floor_samples_.clear();
    const cv::Size size = depth.size();
    const int step = std::max(8, size.width / 28);
    for (int y = step / 2; y < size.height; y += step) {
      const std::uint16_t* row = depth.row(y);
      for (int x = step / 2; x < size.width; x += step) {
        if (row[x] == 0) continue;
        const cv::Point p(x, y);
        bool outside = true;
        for (const Instance& s : instances)
          outside = outside && !(s.box.contains(p) &&
                                 (s.mask.empty() || s.mask.at<uchar>(p - s.box.tl()) != 0));
        if (!outside) continue;
        const Eigen::Vector2f ray = depth.ray(p);
        floor_samples_.push_back({ray.x(), ray.y(), 1 / depth.to_m(row[x])});
      }
    }
    floor_ = find_floor(floor_samples_, floor_, settings_.seed, T_current_last.has_value());
  }

  /// Writes the instance's region: `out.box` may cover more than the instance's box, `out.mask` has
  /// its size and is of `masks`. ORs it into `all`, of the image's size.
  void fuse(const DepthView& depth, const Instance& instance, const CellLabels& labels,
            detail::MaskPool& masks, Instance& out, detail::BitMask& all) {
    out.class_name = instance.class_name;
    out.score = instance.score;
    out.predicted = instance.predicted;
    out.blur = instance.blur;
    const bool paper = settings_.method == DepthMaskFuserSettings::Method::kPaper;
    if (!paper && !instance.mask.empty()) {
      given_.reset(instance.box);
      given_.add(instance.mask, instance.box);
    }
    // What has no name was found by its motion, the better evidence.
    const CellLabels* known_static =
        !labels.empty() && !instance.class_name.empty() ? &labels : nullptr;
    const bool connected =
        !paper && ranges_.find_on_mask(depth, samples_, instance, given_, known_static, range_);
    area_ = instance.box;
    if (connected) {
      cells_.grow(depth, samples_, floor_, ranges_, range_, instance, settings_, known_static);
      const int cell = settings_.cell_px;
      const cv::Rect used = cells_.used();
      area_ = cv::Rect(used.x * cell, used.y * cell, used.width * cell, used.height * cell) &
              cv::Rect(cv::Point(), depth.size());
    }
    out.box = area_;
    out.mask = masks.take(area_.size());
    if (connected) {
      find_pixels(depth, instance);
      claim_unmeasured_rim(depth, out.mask, all);
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
    all.add(out.mask, area_);
  }

 private:
  void add_box_range(const DepthView& depth, cv::Mat& out) {
    const int lo = std::max(1, depth.first_units(range_.lo_m)), hi = depth.last_units(range_.hi_m);
    if (hi < lo) return;
    for (int y = 0; y < area_.height; ++y)
      or_in_range(depth.row(area_.y + y) + area_.x, static_cast<std::size_t>(area_.width),
                  static_cast<std::uint16_t>(lo), static_cast<std::uint16_t>(hi - lo),
                  out.ptr<uchar>(y));
  }

  static void or_in_range(const std::uint16_t* STILLPOINT_RESTRICT z, std::size_t n,
                          std::uint16_t lo, std::uint16_t span, uchar* STILLPOINT_RESTRICT to) {
    for (std::size_t x = 0; x < n; ++x) {
      const std::uint16_t offset = static_cast<std::uint16_t>(z[x] - lo);
      to[x] = static_cast<uchar>(to[x] | (offset <= span ? 255 : 0));
    }
  }

  // Pixels are looked at in parts of a row.
  static constexpr int kPart = 16;

  // Each cell's pixels in the range of depths around it; what has no depth stays as the segmenter
  // said. Most cells are whole in the object or far from it: only the others are looked at pixel
  // by pixel.
  void find_pixels(const DepthView& depth, const Instance& instance) {
    const int cell = settings_.cell_px;
    const cv::Rect used = cells_.used();
    // Parts run over the end of a row.
    const std::size_t columns = static_cast<std::size_t>(used.width * cell + kPart);
    for (auto* v : {&lo_, &span_})
      if (v->size() < columns) v->resize(columns);
    found_.reset(area_);
    for (int cy = 0; cy < used.height; ++cy) {
      const RegionCells::Row& row = cells_.row(cy);
      const int top = area_.y + cy * cell, bottom = std::min(top + cell, area_.y + area_.height);
      detail::for_each_run(row.inner, [&](int begin, int end) {
        const int x = begin * cell, width = std::min(end * cell, area_.width) - x;
        for (int y = top; y < bottom; ++y)
          detail::fill_bits(found_.bit_of(area_.x + x), static_cast<std::size_t>(width),
                            found_.row(y));
      });
      detail::for_each_run(row.rim, [&](int begin, int end) {
        for (int cx = begin; cx < end; ++cx) {
          const RegionCells::Range range = cells_.range(depth, cx);
          fill_cell(range.lo, lo_.data() + (cx - begin) * cell);
          fill_cell(range.span, span_.data() + (cx - begin) * cell);
        }
        const int left = area_.x + begin * cell;
        const int right = std::min(area_.x + end * cell, area_.x + area_.width);
        for (int x = left; x < right; x += kPart)
          take_in_range(depth, {x, top, std::min(kPart, right - x), bottom - top},
                        lo_.data() + (x - left), span_.data() + (x - left));
      });
    }
    if (!instance.mask.empty()) take_unmeasured(depth, instance);
  }

  // Depth from (x, y) on, kPart pixels; 65535 beyond the picture.
  const std::uint16_t* depth_part(const DepthView& depth, int x, int y) {
    const std::uint16_t* row = depth.row(y);
    const int width = depth.size().width;
    if (x + kPart <= width) return row + x;
    depth_part_.fill(65535);
    std::copy(row + x, row + width, depth_part_.begin());
    return depth_part_.data();
  }

  // The pixels in their ranges of depth, at most kPart in a row.
  void take_in_range(const DepthView& depth, const cv::Rect& part, const std::uint16_t* lo,
                     const std::uint16_t* span) {
    const std::uint64_t valid = (std::uint64_t{1} << part.width) - 1;
    for (int y = part.y; y < part.y + part.height; ++y) {
      const std::uint64_t taken = detail::in_range_16(depth_part(depth, part.x, y), lo, span);
      detail::or_bits(taken & valid, found_.bit_of(part.x), found_.row(y));
    }
  }

  // The pixels on the mask that have no depth.
  void take_unmeasured(const DepthView& depth, const Instance& instance) {
    const cv::Rect& box = instance.box;
    const std::size_t first = static_cast<std::size_t>(given_.first_word() - found_.first_word());
    for (int y = box.y; y < box.y + box.height; ++y) {
      const std::uint64_t* mask = given_.row(y);
      std::uint64_t* row = found_.row(y) + first;
      for (std::size_t k = 0; k < given_.words(); ++k)
        row[k] |= unmeasured(depth, first + k, y, mask[k] & ~row[k]);
    }
  }

  // Those of the pixels `asked`, bits of word k of row y, that have no depth.
  std::uint64_t unmeasured(const DepthView& depth, std::size_t k, int y, std::uint64_t asked) {
    std::uint64_t found = 0;
    for (std::uint64_t left = asked; left != 0;) {
      const int at = detail::lowest_bit(left) / kPart * kPart;
      const int x = 64 * (found_.first_word() + static_cast<int>(k)) + at;
      found |= detail::zeros_16(depth_part(depth, x, y)) << at;
      left &= ~(std::uint64_t{0xffff} << at);
    }
    return found & asked;
  }

  // Fills cells from left to right: writes up to three values more, which the next cell overwrites.
  void fill_cell(std::uint16_t value, std::uint16_t* to) const {
    const std::uint64_t four = value * 0x0001000100010001ull;
    for (int i = 0; i < settings_.cell_px; i += 4) std::memcpy(to + i, &four, sizeof four);
  }

  // What the camera did not measure right beside the object is its, too: at outlines it measures
  // nothing. Writes the pixels to `out` and into `all`.
  void claim_unmeasured_rim(const DepthView& depth, cv::Mat& out, detail::BitMask& all) {
    for (auto& row : wide_) detail::refill(row, found_.words(), std::uint64_t{0});
    detail::refill(columns_, found_.words(), std::uint64_t{0});
    detail::fill_bits(found_.bit_of(area_.x), static_cast<std::size_t>(area_.width),
                      columns_.data());
    widen(found_.row(area_.y), wide_[1].data());
    for (int y = area_.y; y < area_.y + area_.height; ++y) {
      // Rows as they were: the rim does not grow on itself.
      if (y + 1 < area_.y + area_.height)
        widen(found_.row(y + 1), wide_[2].data());
      else
        std::fill(wide_[2].begin(), wide_[2].end(), 0);
      std::uint64_t* row = found_.row(y);
      std::uint64_t* to = all.row(y) + static_cast<std::size_t>(found_.first_word());
      for (std::size_t k = 0; k < found_.words(); ++k) {
        const std::uint64_t rim = (wide_[0][k] | wide_[1][k] | wide_[2][k]) & ~row[k] & columns_[k];
        row[k] |= unmeasured(depth, k, y, rim);
        to[k] |= row[k];
      }
      detail::unpack(row, found_.bit_of(area_.x), static_cast<std::size_t>(area_.width),
                     out.ptr<uchar>(y - area_.y));
      std::swap(wide_[0], wide_[1]);
      std::swap(wide_[1], wide_[2]);
    }
  }

  // A row with the pixels beside those that are set.
  void widen(const std::uint64_t* row, std::uint64_t* wide) const {
    for (std::size_t k = 0; k < found_.words(); ++k) {
      wide[k] = row[k] | row[k] << 1 | row[k] >> 1;
      if (k > 0) wide[k] |= row[k - 1] >> 63;
      if (k + 1 < found_.words()) wide[k] |= row[k + 1] << 63;
    }
  }

  DepthMaskFuserSettings settings_;
  StratifiedSamples samples_;
  ObjectDepthRange ranges_;
  RegionCells cells_;
  InversePlane floor_;
  std::vector<InverseSample> floor_samples_;
  DepthRange range_;
  cv::Rect area_;                  // the pixels that are written
  detail::BitMask given_, found_;  // the instance's mask in its box, and the pixels of area_
  std::vector<std::uint16_t> lo_, span_;
  std::array<std::uint16_t, kPart> depth_part_{};
  std::vector<std::uint64_t> columns_;
  std::array<std::vector<std::uint64_t>, 3> wide_;
};

}  // namespace stillpoint
