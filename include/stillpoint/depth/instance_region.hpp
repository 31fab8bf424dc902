// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "stillpoint/core/cell_labels.hpp"
#include "stillpoint/core/depth_view.hpp"
#include "stillpoint/core/image_scale.hpp"
#include "stillpoint/core/instance.hpp"
#include "stillpoint/core/mask_pool.hpp"
#include "stillpoint/depth/depth_mask_fuser_settings.hpp"
#include "stillpoint/depth/floor_plane.hpp"
#include "stillpoint/depth/object_depth_range.hpp"
#include "stillpoint/depth/region_cells.hpp"
#include "stillpoint/depth/region_growth.hpp"
#include "stillpoint/depth/region_parts.hpp"
#include "stillpoint/depth/region_pixels.hpp"
#include "stillpoint/depth/stratified_samples.hpp"

namespace stillpoint {

/// Turns one instance and the depth around it into its region of the mask: the work of
/// DepthMaskFuser per instance. Which depth range it has (ObjectDepthRange), which other parts of
/// the mask belong to it (RegionParts) and how far it grows (RegionGrowth) is decided on cells with
/// one depth sample each (RegionCells); then what is at its rim on pixels (RegionPixels).
class InstanceRegion {
 public:
  explicit InstanceRegion(const DepthMaskFuserSettings& settings)
      : settings_(settings), samples_(settings.cell_px, settings.seed) {}

  /// Finds the floor among samples outside the instances, the last frame's floor first, which the
  /// camera's motion carries along if it is known. O(samples).
  void begin_frame(const DepthView& depth, const std::vector<Instance>& instances,
                   const std::optional<Eigen::Isometry3d>& T_current_last) {
    const int cell_px =
        std::clamp(scaled_px(settings_.cell_px, depth.size()), settings_.cell_px, kMostCellPx);
    if (cell_px != samples_.cell_px()) samples_ = StratifiedSamples(cell_px, settings_.seed);
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
  /// its size and is of `masks`.
  void fuse(const DepthView& depth, const Instance& instance, const CellLabels& labels,
            detail::MaskPool& masks, Instance& out) {
    out.class_name = instance.class_name;
    out.score = instance.score;
    out.predicted = instance.predicted;
    out.blur = instance.blur;
    if (settings_.method == DepthMaskFuserSettings::Method::kConnected) {
      const CellLabels* known_static = labels.empty() ? nullptr : &labels;
      if (ranges_.find_on_mask(depth, samples_, instance, known_static, range_))
        return write_region(depth, instance, known_static, masks, out);
    }
    out.box = instance.box;
    out.mask = masks.take(out.box.size());
    const bool in_box = settings_.method == DepthMaskFuserSettings::Method::kPaper &&
                        ranges_.find_in_box(depth, samples_, out.box, settings_.range_m, range_);
    // Without depth to judge by, a mask stays as it is, and a bare box is full.
    if (instance.mask.empty())
      out.mask.setTo(in_box ? 0 : 255);
    else
      instance.mask.copyTo(out.mask);
    if (in_box) add_box_range(depth, out);
  }

 private:
  // The paper's: every pixel of the box whose depth is in the range.
  void add_box_range(const DepthView& depth, Instance& out) {
    const int lo = std::max(1, depth.first_units(range_.lo_m)), hi = depth.last_units(range_.hi_m);
    if (hi < lo) return;
    in_range_.create(depth.size());
    cv::Mat in_range = in_range_(out.box);
    cv::inRange(depth.image()(out.box), lo, hi, in_range);
    cv::bitwise_or(out.mask, in_range, out.mask);
  }

  // The default: what is connected in depth with the samples on the mask.
  void write_region(const DepthView& depth, const Instance& instance,
                    const CellLabels* known_static, detail::MaskPool& masks, Instance& out) {
    const int cell = samples_.cell_px();
    const bool bare = instance.mask.empty();
    const float cells_per_m = depth.focal_px() / range_.middle_m / static_cast<float>(cell);
    const int reach = std::max(1, static_cast<int>(settings_.growth_m * cells_per_m + 0.5f));
    cells_.begin(depth, samples_, floor_, instance.box, bare ? cell : (reach + 1) * cell,
                 ranges_.samples_on_mask(), range_);
    if (!bare) {
      const float slack_m = instance.predicted ? kPredictedSlackM : 0;
      parts_.keep(cells_, ranges_.samples_on_mask(),
                  static_cast<int>(slack_m * cells_per_m + 0.5f));
    }
    // What has no name was found by its motion, the better evidence: the part of a person that is
    // held still is taken for static, too.
    const bool alone_only = instance.class_name.empty();
    growth_.grow(cells_, range_, settings_.range_m, reach, known_static, alone_only);
    out.box = cv::Rect(cells_.used.tl() * cell, cells_.used.size() * cell) &
              cv::Rect(cv::Point(), depth.size());
    out.mask = masks.take(out.box.size());
    pixels_.find(cells_, cell, instance, out.box, out.mask);
  }

  static constexpr int kMostCellPx = 255;           // in huge images
  static constexpr float kPredictedSlackM = 0.06f;  // how far off a predicted mask may be

  DepthMaskFuserSettings settings_;
  StratifiedSamples samples_;
  ObjectDepthRange ranges_;
  RegionCells cells_;
  RegionParts parts_;
  RegionGrowth growth_;
  RegionPixels pixels_;
  InversePlane floor_;
  std::vector<InverseSample> floor_samples_;
  DepthRange range_;
  cv::Mat_<uchar> in_range_;
};

}  // namespace stillpoint
