// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "stillpoint/core/cell_labels.hpp"
#include "stillpoint/core/image_scale.hpp"
#include "stillpoint/depth/depth_samples.hpp"
#include "stillpoint/depth/floor_plane.hpp"
#include "stillpoint/depth/object_depth_range.hpp"

namespace stillpoint {

/// The region of an object on the cells of the image: where it begins, which parts of its mask
/// belong to it, and how far it grows, breadth first over depth that goes on without a step.
class ObjectRegion {
 public:
  /// The cells within `margin_px` of the box may be looked at; the region are those on the mask, as
  /// in `states`, with a sample in the range, unless they are floor. Refers to all that is given.
  /// O(cells).
  void begin(const DepthSamples& samples, const InversePlane& floor, const cv::Rect& box,
             int margin_px, const DepthRange& range, CellStates& states) {
    samples_ = &samples, floor_ = &floor, states_ = &states;
    limits_ = samples.cells_of(grow_rect(box, margin_px, samples.depth().size()));
    used_ = samples.cells_of(box);
    const float slack = 0.05f, lo = range.lo_m - slack, hi = range.hi_m + slack;
    for_each_used([&](const cv::Point& cell, std::uint8_t& state) {
      if (state == kOnMask && z(cell) >= lo && z(cell) <= hi)
        state = is_floor(cell) ? kOutside : kRegion;
    });
  }

  /// Adds the parts of the mask at other depths that are the object's, too: an arm stretched out, a
  /// second person in one mask. Such a part ends where the mask ends, in a step to something
  /// farther; it may go on `slack` cells beyond the mask. What goes on farther is background that
  /// a careless mask took in. O(cells of the box).
  void keep_parts(int slack) {
    const int least = std::max(6, cv::countNonZero((*states_)(used_)) / 25);
    visits_.clear();
    for_each_used([&](const cv::Point& cell, const std::uint8_t& state) {
      if (state != kOnMask) return;
      const std::size_t begin = visits_.size();
      if (collect_part(cell, slack) < least) return;
      for (std::size_t k = begin; k < visits_.size(); ++k)
        if (visits_[k].distance == 0) (*states_)(visits_[k].cell) = kRegion;
    });
    for (const Visit& v : visits_)
      if ((*states_)(v.cell) == kOutside) (*states_)(v.cell) = kOffMask;
  }

  /// Grows the region by at most `reach` cells, over depths up to `range_m` beyond the range, but
  /// not into the floor, nor into what `labels` knows to be static; with `alone_only`, what never
  /// stood alone does not stop it. O(cells of the region).
  void grow(const DepthRange& range, float range_m, int reach, const CellLabels& labels,
            bool alone_only) {
    const float lo = range.lo_m - range_m, hi = range.hi_m + range_m;
    const auto may_grow_into = [&](const cv::Point& cell) {
      if (!(z(cell) > 0 && z(cell) >= lo && z(cell) <= hi) || is_floor(cell)) return false;
      const cv::Point p = samples_->place(cell);
      return !(alone_only ? labels.stood_alone(p) : labels.known_static(p));
    };
    visits_.clear();
    for_each_used([&](const cv::Point& cell, const std::uint8_t& state) {
      if (state == kRegion && !is_amid_region(cell)) visits_.push_back({cell, 0});
    });
    for (std::size_t k = 0; k < visits_.size(); ++k) {
      const Visit from = visits_[k];
      if (from.distance >= reach) continue;
      for_each_beside(from.cell, [&](const cv::Point& cell, const std::uint8_t& state) {
        if (state == kOutside || state == kRegion) return;
        if (std::abs(z(cell) - z(from.cell)) > step(from.cell) || !may_grow_into(cell)) return;
        take(cell, kRegion, from.distance + 1);
        used_ |= cv::Rect(cell, cv::Size(1, 1));
      });
    }
    const cv::Point one(1, 1);
    used_ = cv::Rect(used_.tl() - one, used_.br() + one) & limits_;
  }

  const DepthSamples& samples() const { return *samples_; }
  const CellStates& states() const { return *states_; }
  /// The cells of the box and the region and, after grow(), a cell around it.
  const cv::Rect& used() const { return used_; }

 private:
  struct Visit {
    cv::Point cell;
    int distance;  // how many cells from the mask
  };

  // Depth of a cell's sample, and how far depth goes on from it without a step, metres.
  float z(const cv::Point& cell) const { return samples_->z(cell); }
  float step(const cv::Point& cell) const { return std::max(0.03f, 0.02f * z(cell)); }
  // Whether the sample lies within 1.5 % and 2 cm of the floor, or beyond it.
  bool is_floor(const cv::Point& cell) const {
    if (!floor_->found) return false;
    const Eigen::Vector2f ray = samples_->depth().ray(samples_->place(cell));
    return (z(cell) + 0.02f) * floor_->inverse_depth(ray.x(), ray.y()) > 0.985f;
  }

  // Whether all four cells beside are the region's, too: it does not grow from here.
  bool is_amid_region(const cv::Point& cell) const {
    if (cell.y == limits_.y || cell.y + 1 == limits_.br().y) return false;
    if (cell.x == limits_.x || cell.x + 1 == limits_.br().x) return false;
    const std::uint8_t* here = (*states_)[cell.y] + cell.x;
    return here[-1] == kRegion && here[1] == kRegion && (*states_)[cell.y - 1][cell.x] == kRegion &&
           (*states_)[cell.y + 1][cell.x] == kRegion;
  }

  // Calls `visit(cell, state)`.
  template <class Visit>
  void for_each_used(Visit&& visit) {
    for (cv::Point cell = used_.tl(); cell.y < used_.br().y; ++cell.y) {
      std::uint8_t* states = (*states_)[cell.y];
      for (cell.x = used_.x; cell.x < used_.br().x; ++cell.x) visit(cell, states[cell.x]);
    }
  }
  template <class Visit>
  void for_each_beside(const cv::Point& center, Visit&& visit) {
    for (const cv::Point& offset : {cv::Point(-1, 0), {1, 0}, {0, -1}, {0, 1}}) {
      const cv::Point cell = center + offset;
      if (limits_.contains(cell)) visit(cell, (*states_)(cell));
    }
  }

  void take(const cv::Point& cell, CellState state, int distance) {
    (*states_)(cell) = state;
    visits_.push_back({cell, distance});
  }

  // Adds the cells of the mask that are connected with `first` to the visits, and those up to
  // `slack` cells beyond it. Returns how many are on the mask; 0 if the part goes on beyond it.
  int collect_part(const cv::Point& first, int slack) {
    int ends = 0, goes_on = 0, on_mask = 0;
    std::size_t k = visits_.size();
    take(first, kOutside, 0);
    for (; k < visits_.size(); ++k) {
      const Visit from = visits_[k];
      on_mask += from.distance == 0;
      goes_on += is_floor(from.cell);
      const float here = z(from.cell), step_m = step(from.cell);
      for_each_beside(from.cell, [&](const cv::Point& cell, const std::uint8_t& state) {
        const float beside = z(cell);
        if (state == kOnMask) {
          if (std::abs(beside - here) <= step_m) take(cell, kOutside, 0);
        } else if (state == kOffMask) {
          if (beside == 0) {
            ++ends;  // cameras measure nothing beside a step, and on much else
          } else if (beside > here + step_m) {
            ends += 2;
          } else if (beside > here - step_m) {  // what is nearer hides where the part ends
            if (from.distance == slack)
              goes_on += 2;
            else
              take(cell, kOutside, from.distance + 1);
          }
        }
      });
    }
    return ends > goes_on ? on_mask : 0;
  }

  const DepthSamples* samples_ = nullptr;
  const InversePlane* floor_ = nullptr;
  CellStates* states_ = nullptr;
  cv::Rect limits_, used_;  // what may be looked at; see used()
  std::vector<Visit> visits_;
};

}  // namespace stillpoint
