// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>

#include "stillpoint/core/depth_view.hpp"
#include "stillpoint/depth/dilate.hpp"
#include "stillpoint/depth/floor_plane.hpp"
#include "stillpoint/depth/object_depth_range.hpp"
#include "stillpoint/depth/stratified_samples.hpp"

namespace stillpoint {

/// What a cell of the image is to the object that is looked at.
enum class CellState : std::uint8_t {
  kUnknown,  ///< not yet looked at
  kOutside,  ///< not the object's: out of its depth range, floor, or known to be static
  kOpen,     ///< may become the object's
  kRegion,   ///< the object's
  kPart      ///< of a part of the mask that is being judged
};

/// The cells of the image around one object, with one depth sample each. Addressed by column and
/// row in the grid of the whole image; only those in `limits` are valid. Refers to the frame's
/// depth and samples.
class RegionCells {
 public:
  /// All cells within `margin_px` of the box are unknown; on the mask, those with a sample in the
  /// range are the region, unless they are floor. O(cells).
  void begin(const DepthView& depth, const StratifiedSamples& samples, const InversePlane& floor,
             const cv::Rect& box, int margin_px, const cv::Mat_<std::uint16_t>& samples_on_mask,
             const DepthRange& range) {
    depth_ = &depth, samples_ = &samples, floor_ = floor;
    // With a frame of one cell, which is outside, borders need no questions.
    const cv::Size grid = samples.grid_size(depth.size()) + cv::Size(2, 2);
    state_.create(grid);
    z_.create(grid);
    limits = samples.cells_of(grow_rect(box, margin_px, depth.size()));
    used = samples.cells_of(box);
    state_(limits + cv::Size(2, 2)).setTo(static_cast<int>(CellState::kOutside));
    state_(limits + cv::Point(1, 1)).setTo(static_cast<int>(CellState::kUnknown));
    const float slack = 0.05f, lo = range.lo_m - slack, hi = range.hi_m + slack;
    for (int y = used.y; y < used.y + used.height; ++y) {
      const bool maybe_floor = row_may_be_floor(y, hi);
      for (int x = used.x; x < used.x + used.width; ++x) {
        const cv::Point cell(x, y);
        z(cell) = depth.to_m(samples_on_mask(cell));
        if (samples_on_mask(cell) == 0 || z(cell) < lo || z(cell) > hi) continue;
        set_state(cell, maybe_floor && is_floor(cell) ? CellState::kOutside : CellState::kRegion);
      }
    }
  }

  /// kOutside beside the limits, too.
  CellState state(const cv::Point& cell) const {
    return static_cast<CellState>(state_(cell.y + 1, cell.x + 1));
  }
  void set_state(const cv::Point& cell, CellState to) {
    state_(cell.y + 1, cell.x + 1) = static_cast<std::uint8_t>(to);
  }
  /// Depth of a cell's sample, metres; 0 = no measurement. Valid where it was set.
  float& z(const cv::Point& cell) { return z_(cell.y + 1, cell.x + 1); }
  float z(const cv::Point& cell) const { return z_(cell.y + 1, cell.x + 1); }
  /// The depth that the camera measured there, metres.
  float measured_z(const cv::Point& cell) const {
    const cv::Point p = place(cell);
    return depth_->to_m(depth_->row(p.y)[p.x]);
  }
  /// The pixel of a cell's sample.
  cv::Point place(const cv::Point& cell) const {
    return samples_->place(cell.x, cell.y, depth_->size());
  }
  /// Whether its sample lies within 1.5 % and 2 cm of the floor, or beyond it.
  bool is_floor(const cv::Point& cell) const {
    return floor_.found && (z(cell) + 0.02f) * inverse_floor(place(cell)) > 0.985f;
  }
  /// How far depth goes on from a cell without a step, metres.
  float step(const cv::Point& cell) const { return std::max(0.03f, 0.02f * z(cell)); }

  /// Calls `visit(cell)` for the cells beside this one.
  template <class Visit>
  void for_each_beside(const cv::Point& cell, Visit&& visit) const {
    for (const cv::Point& offset : {cv::Point(-1, 0), {1, 0}, {0, -1}, {0, 1}})
      visit(cell + offset);
  }

  /// From the first cell of a row of the image on; one more is valid at either end.
  const CellState* state_row(int y) const {
    return reinterpret_cast<const CellState*>(state_[y + 1]) + 1;
  }
  const float* z_row(int y) const { return z_[y + 1] + 1; }

  const DepthView& depth() const { return *depth_; }
  /// The cells that may be looked at, and those of the object's box and region.
  cv::Rect limits, used;

 private:
  // The floor's inverse depth at a pixel, 1/m.
  float inverse_floor(const cv::Point& p) const {
    const Eigen::Vector2f ray = depth_->ray(p);
    return floor_.a * ray.x() + floor_.b * ray.y() + floor_.c;
  }
  // False if no sample of a row of the cells used, up to `hi` away, can be floor: it is nearest at
  // one end of the row.
  bool row_may_be_floor(int y, float hi) const {
    if (!floor_.found) return false;
    const int cell = samples_->cell_px(), left = used.x * cell, right = left + used.width * cell;
    float most = 0;
    for (const int v : {y * cell, (y + 1) * cell})
      most = std::max({most, inverse_floor({left, v}), inverse_floor({right, v})});
    return (hi + 0.02f) * most > 0.98f;
  }

  const DepthView* depth_ = nullptr;
  const StratifiedSamples* samples_ = nullptr;
  InversePlane floor_;
  cv::Mat_<std::uint8_t> state_;
  cv::Mat_<float> z_;
};

}  // namespace stillpoint
