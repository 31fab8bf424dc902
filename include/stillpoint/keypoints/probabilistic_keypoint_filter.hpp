// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "stillpoint/core/error.hpp"
#include "stillpoint/core/frame.hpp"
#include "stillpoint/core/image_scale.hpp"
#include "stillpoint/core/keypoint.hpp"
#include "stillpoint/core/mask.hpp"
#include "stillpoint/core/scratch.hpp"
#include "stillpoint/core/selection.hpp"
#include "stillpoint/core/status.hpp"
#include "stillpoint/keypoints/grid_neighbor_search.hpp"
#include "stillpoint/keypoints/keypoint_filter_settings.hpp"

namespace stillpoint {

/// Removes keypoints that are probably dynamic (paper section 3.3).
///
/// Pre-define: P = 1 in the mask, else 0. Compute: for each keypoint outside the mask the mean over
/// all other keypoints within D of `c1 exp(-c2 r) P`, clamped to [0, 1]; 0 without neighbors.
/// Delete: P > theta. All sums are formed in whole numbers, so the result depends neither on the
/// order of visiting nor on the neighbor search.
///
/// Cost: O(n) and one radius query per static keypoint that has a dynamic one near. No allocation
/// once the largest number of keypoints was seen. Not thread-safe; one object per camera.
template <class NeighborSearch = GridNeighborSearch>
class ProbabilisticKeypointFilter {
 public:
  using Settings = KeypointFilterSettings;

  explicit ProbabilisticKeypointFilter(const Settings& settings = {}) : settings_(settings) {
    const auto positive = [](float value, const char* name) {
      detail::check(std::isfinite(value) && value >= 0, [&] {
        return std::string("KeypointFilterSettings.") + name +
               ": expected a number of at least 0, found " + std::to_string(value);
      });
    };
    positive(settings.radius_px, "radius_px");
    positive(settings.weight, "weight");
    positive(settings.decay_per_px, "decay_per_px");
    positive(settings.threshold, "threshold");
    detail::check(settings.min_kept >= 0, [&] {
      return "KeypointFilterSettings.min_kept: expected at least 0, found " +
             std::to_string(settings.min_kept);
    });
    // Weights by squared distance, in steps fine enough for a pixel's fraction near 0.
    const double r2_max = static_cast<double>(settings.radius_px) * settings.radius_px;
    const int steps = static_cast<int>(std::clamp(2 * r2_max, kFewestSteps, kMostSteps));
    table_scale_ = r2_max > 0 ? static_cast<float>((steps - 1) / r2_max) : 0;
    table_.resize(static_cast<std::size_t>(steps) + 1);  // one more for the rounding
    for (int i = 0; i <= steps; ++i) {
      const double r = r2_max > 0 ? std::sqrt(i * r2_max / (steps - 1)) : 0;
      table_[static_cast<std::size_t>(i)] = static_cast<std::int64_t>(
          std::llround(kOne * settings.weight * std::exp(-settings.decay_per_px * r)));
    }
  }

  const Settings& settings() const { return settings_; }

  /// Judges each keypoint; `keypoints` is an array (size(), operator[]) of any type that
  /// KeypointTraits can read, in raw pixels of the image that the mask belongs to. An empty
  /// `mask.image` means that nothing is dynamic. `compute_probability` false: the mask alone
  /// decides (the paper's ablation). The reference stays valid until the next call.
  template <class Keypoints>
  const Selection& filter(const Keypoints& keypoints, const DynamicMask& mask,
                          bool compute_probability = true) {
    detail::check(mask.image.empty() || mask.image.type() == CV_8UC1, [&] {
      return "filter: mask.image: expected CV_8UC1, 255 = dynamic, found " +
             detail::type_text(mask.image);
    });
    predefine(keypoints, mask);
    if (compute_probability && !dynamic_points_.empty()) compute();
    remove();
    return selection_;
  }

  /// Bits of the last filter(): kNoKeypoints, kKeypointFloor.
  std::uint32_t status() const { return status_; }

 private:
  static constexpr double kFewestSteps = 4096, kMostSteps = 1 << 20;
  static constexpr float kNearSteps = 3;
  static constexpr double kOne = 1 << 24;

  template <class Keypoints>
  void predefine(const Keypoints& keypoints, const DynamicMask& mask) {
    using Keypoint = std::decay_t<decltype(keypoints[0])>;
    using Traits = KeypointTraits<Keypoint>;
    const std::size_t n = keypoints.size();
    selection_.probability.resize(n), selection_.reason.resize(n);
    points_.resize(n), index_.resize(n), dynamic_.resize(n), dynamic_points_.resize(n);
    std::size_t inside = 0, found = 0;
    min_x_ = min_y_ = 1e9f, max_x_ = max_y_ = -1e9f;
    const bool has_mask = !mask.image.empty();
    // Distances are measured in the settings' pixels.
    const float to_settings =
        has_mask ? static_cast<float>(1 / pixel_scale(mask.image.size())) : 1.0f;
    const float right = has_mask ? static_cast<float>(mask.image.cols) - 0.5f : 1e9f;
    const float bottom = has_mask ? static_cast<float>(mask.image.rows) - 0.5f : 1e9f;
    for (std::size_t i = 0; i < n; ++i) {
      const float x = Traits::x(keypoints[i]), y = Traits::y(keypoints[i]);
      if (!(x >= -0.5f && y >= -0.5f && x < right && y < bottom)) {  // false for NaN, too
        selection_.probability[i] = 1;
        selection_.reason[i] = KeypointReason::kOutsidePicture;
        continue;
      }
      const bool dynamic = has_mask && mask.pixel_at(x, y) != 0;
      points_[inside] = {x * to_settings, y * to_settings};
      // Which ones are in the mask is hard to foresee: no branch.
      dynamic_points_[found] = points_[inside];
      index_[inside] = static_cast<int>(i);
      dynamic_[inside++] = dynamic;
      found += dynamic;
      selection_.probability[i] = dynamic;
      selection_.reason[i] = dynamic ? KeypointReason::kInMask : KeypointReason::kStatic;
    }
    for (std::size_t i = 0; i < found; ++i) {
      const cv::Point2f& p = dynamic_points_[i];
      min_x_ = std::min(min_x_, p.x), max_x_ = std::max(max_x_, p.x);
      min_y_ = std::min(min_y_, p.y), max_y_ = std::max(max_y_, p.y);
    }
    points_.resize(inside), index_.resize(inside), dynamic_.resize(inside);
    dynamic_points_.resize(found);
  }

  void compute() {
    mark_near_cells();
    all_.build(points_, settings_.radius_px);
    dynamic_search_.build(dynamic_points_, settings_.radius_px);
    asked_.resize(points_.size());
    find_cells(points_);
    std::size_t asked = 0;
    for (std::size_t i = 0; i < points_.size(); ++i) {
      asked_[asked] = i;
      asked += near_[static_cast<std::size_t>(cell_of_[i])] & (dynamic_[i] ^ 1u);
    }
    for (std::size_t k = 0; k < asked; ++k) {
      const std::size_t i = asked_[k];
      const cv::Point2f p = points_[i];
      std::int64_t sum = 0;
      dynamic_search_.for_each_neighbor(p, [&](int near) {
        const cv::Point2f& q = dynamic_points_[static_cast<std::size_t>(near)];
        const float dx = p.x - q.x, dy = p.y - q.y;
        sum += table_[static_cast<std::size_t>((dx * dx + dy * dy) * table_scale_ + 0.5f)];
      });
      if (sum == 0) continue;
      const int neighbors = all_.count_neighbors(p) - 1;  // without the keypoint itself
      const float probability = static_cast<float>(
          std::min(1.0, static_cast<double>(sum) / (static_cast<double>(neighbors) * kOne)));
      const std::size_t original = static_cast<std::size_t>(index_[i]);
      selection_.probability[original] = probability;
      if (probability > settings_.threshold)
        selection_.reason[original] = KeypointReason::kProbable;
    }
  }

  // A coarse image of where dynamic keypoints are spares most static ones their query.
  void mark_near_cells() {
    const float radius = settings_.radius_px;
    const float cell =
        std::max({radius / kNearSteps, 4.0f, std::max(max_x_ - min_x_, max_y_ - min_y_) / 512});
    per_cell_ = 1 / cell;
    const int steps = static_cast<int>(radius * per_cell_) + 1;
    // One cell more on each side, which no point is near: it stands for all beyond.
    left_ = min_x_ - (static_cast<float>(steps) + 1.5f) * cell;
    top_ = min_y_ - (static_cast<float>(steps) + 1.5f) * cell;
    columns_ = static_cast<int>((max_x_ - left_) * per_cell_) + steps + 2;
    rows_ = static_cast<int>((max_y_ - top_) * per_cell_) + steps + 2;
    const std::size_t stride = static_cast<std::size_t>(columns_);
    const std::size_t reach = static_cast<std::size_t>(steps), window = 2 * reach + 1;
    detail::refill(near_, stride * static_cast<std::size_t>(rows_), std::uint8_t{0});
    find_cells(dynamic_points_);
    for (const int c : cell_of_) {
      std::uint8_t* row = near_.data() + static_cast<std::size_t>(c) - reach * (stride + 1);
      for (std::size_t k = 0; k < window; ++k, row += stride) std::fill_n(row, window, 1);
    }
  }

  void find_cells(const std::vector<cv::Point2f>& points) {
    cell_of_.resize(points.size());
    detail::find_cells(points.data(), points.size(), {left_, top_}, per_cell_, {columns_, rows_},
                       cell_of_.data());
  }

  void remove() {
    status_ = selection_.size() == 0 ? kNoKeypoints : kOk;
    const std::size_t floor = static_cast<std::size_t>(settings_.min_kept);
    selection_.kept.resize(selection_.size());
    std::size_t kept = 0;
    for (std::size_t i = 0; i < selection_.size(); ++i) {
      selection_.kept[kept] = static_cast<int>(i);
      kept += selection_.reason[i] == KeypointReason::kStatic;
    }
    selection_.kept.resize(kept);
    if (selection_.kept.size() >= floor || selection_.kept.size() == index_.size()) return;

    status_ |= kKeypointFloor;
    removed_.clear();
    for (int i : index_)
      if (!selection_.is_kept(static_cast<std::size_t>(i))) removed_.push_back(i);
    const std::size_t wanted = std::min(removed_.size(), floor - selection_.kept.size());
    const auto less_dynamic = [this](int a, int b) {
      const float pa = selection_.probability[static_cast<std::size_t>(a)];
      const float pb = selection_.probability[static_cast<std::size_t>(b)];
      return pa != pb ? pa < pb : a < b;
    };
    std::partial_sort(removed_.begin(), removed_.begin() + static_cast<std::ptrdiff_t>(wanted),
                      removed_.end(), less_dynamic);
    for (std::size_t k = 0; k < wanted; ++k) {
      selection_.reason[static_cast<std::size_t>(removed_[k])] = KeypointReason::kFloor;
      selection_.kept.push_back(removed_[k]);
    }
    std::sort(selection_.kept.begin(), selection_.kept.end());
  }

  Settings settings_;
  NeighborSearch all_, dynamic_search_;
  std::vector<std::int64_t> table_;
  float table_scale_ = 0;

  Selection selection_;
  std::uint32_t status_ = kOk;
  std::vector<cv::Point2f> points_;  // inside the image only
  std::vector<cv::Point2f> dynamic_points_;
  std::vector<int> index_;  // points_ -> the host's index
  std::vector<std::uint8_t> dynamic_;
  std::vector<int> cell_of_;        // in the coarse image
  std::vector<std::size_t> asked_;  // of points_: static, with dynamic ones near
  float min_x_ = 0, min_y_ = 0, max_x_ = 0, max_y_ = 0;  // of the dynamic ones

  float per_cell_ = 1, left_ = 0, top_ = 0;
  int columns_ = 0, rows_ = 0;
  std::vector<std::uint8_t> near_;
  std::vector<int> removed_;
};

}  // namespace stillpoint
