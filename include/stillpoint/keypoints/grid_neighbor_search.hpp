// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/core.hpp>
#include <vector>

#include "stillpoint/core/scratch.hpp"

namespace stillpoint {

/// True if `b` lies within `radius` of `a` (inclusive): the one definition of "neighbor" that every
/// neighbor search ends with, so that all give the same neighbors.
inline bool within_radius(const cv::Point2f& a, const cv::Point2f& b, float radius) {
  const float dx = a.x - b.x, dy = a.y - b.y;
  return dx * dx + dy * dy <= radius * radius;
}

/// Radius search over keypoints in a uniform grid: the default of ProbabilisticKeypointFilter.
///
/// The concept `NeighborSearch`, which a replacement (FLANN, nanoflann, your own) fulfils:
///   - default-constructible;
///   - `void build(const std::vector<cv::Point2f>& points, float radius)`: takes finite points, in
///     pixels, and the radius of the queries to come; may keep a pointer to `points`, which outlive
///     the queries;
///   - `template <class Visit> void for_each_neighbor(const cv::Point2f& query, Visit&& visit)`:
///     calls `visit(int index)` once for each point with within_radius(query, point, radius), in
///     any order, a point equal to the query included;
///   - `int count_neighbors(const cv::Point2f& query)`: how many that would be.
///
/// build() is O(n), a query O(points in the cells around). No allocation once the largest
/// number of points and the largest picture were seen. Not thread-safe.
class GridNeighborSearch {
 public:
  void build(const std::vector<cv::Point2f>& points, float radius) {
    radius_ = radius;
    const std::size_t n = points.size();
    columns_ = rows_ = 0;
    if (n == 0) return;
    min_ = points[0];
    cv::Point2f max = points[0];
    for (const cv::Point2f& p : points) {
      min_.x = std::min(min_.x, p.x), min_.y = std::min(min_.y, p.y);
      max.x = std::max(max.x, p.x), max.y = std::max(max.y, p.y);
    }
    // A tiny radius in a huge picture must not make more cells than points can fill.
    const float width = max.x - min_.x, height = max.y - min_.y;
    cell_ = std::max({radius, 1.0f, std::max(width, height) / kMaxCellsPerSide});
    per_cell_ = 1 / cell_;
    columns_ = static_cast<int>(width * per_cell_) + 1;
    rows_ = static_cast<int>(height * per_cell_) + 1;
    detail::refill(start_, static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_) + 1,
                   0);
    cell_of_.resize(n);
    for (std::size_t i = 0; i < n; ++i) {
      cell_of_[i] = row(points[i].y) * columns_ + column(points[i].x);
      ++start_[static_cast<std::size_t>(cell_of_[i]) + 1];
    }
    for (std::size_t c = 1; c < start_.size(); ++c) start_[c] += start_[c - 1];
    // Points of a cell, and cells of a row, lie together in memory.
    x_.resize(n + kVector), y_.resize(n + kVector), index_.resize(n);
    next_.resize(start_.size());
    std::copy(start_.begin(), start_.end(), next_.begin());
    for (std::size_t i = 0; i < n; ++i) {
      const std::size_t at =
          static_cast<std::size_t>(next_[static_cast<std::size_t>(cell_of_[i])]++);
      x_[at] = points[i].x, y_[at] = points[i].y, index_[at] = static_cast<int>(i);
    }
  }

  template <class Visit>
  void for_each_neighbor(const cv::Point2f& query, Visit&& visit) const {
    // Which candidates are near is hard to foresee: those that are get collected without a branch.
    constexpr std::size_t kChunk = 64;
    std::array<std::size_t, kChunk> near;
    for_each_run(query, [&](std::size_t begin, std::size_t end) {
      while (begin < end) {
        const std::size_t stop = std::min(end, begin + kChunk);
        std::size_t found = 0;
        for (; begin < stop; ++begin) {
          near[found] = begin;
          found += within_radius(query, {x_[begin], y_[begin]}, radius_);
        }
        for (std::size_t i = 0; i < found; ++i) visit(index_[near[i]]);
      }
    });
  }

  /// How many points for_each_neighbor() would visit; several times faster.
  int count_neighbors(const cv::Point2f& query) const {
    const float limit = radius_ * radius_;
    int count = 0;
    for_each_run(query, [&](std::size_t begin, std::size_t end) {
      // Runs are short: whole vectors, also over their ends.
      for (; begin < end; begin += kVector) {
        const int left = static_cast<int>(end - begin);
        for (int i = 0; i < kVector; ++i) {
          const float dx = query.x - x_[begin + static_cast<std::size_t>(i)],
                      dy = query.y - y_[begin + static_cast<std::size_t>(i)];
          count += (dx * dx + dy * dy <= limit) & (i < left);
        }
      }
    });
    return count;
  }

 private:
  // Calls `visit_run(begin, end)` for the runs of points that may lie within the radius.
  template <class VisitRun>
  void for_each_run(const cv::Point2f& query, VisitRun&& visit_run) const {
    if (columns_ == 0 || !(radius_ >= 0)) return;
    const int x0 = std::max(0, column(query.x - radius_)), y0 = std::max(0, row(query.y - radius_));
    const int x1 = std::min(columns_ - 1, column(query.x + radius_));
    const int y1 = std::min(rows_ - 1, row(query.y + radius_));
    if (x0 > x1) return;
    for (int y = y0; y <= y1; ++y) {
      const std::size_t at = static_cast<std::size_t>(y) * static_cast<std::size_t>(columns_) +
                             static_cast<std::size_t>(x0);
      const std::size_t after = at + static_cast<std::size_t>(x1 - x0) + 1;
      visit_run(static_cast<std::size_t>(start_[at]), static_cast<std::size_t>(start_[after]));
    }
  }

  static constexpr float kMaxCellsPerSide = 512;
  static constexpr int kVector = 4;

  int column(float x) const { return index(x - min_.x); }
  int row(float y) const { return index(y - min_.y); }
  int index(float offset) const {
    // Far queries stay inside the range of int.
    const float cells = offset * per_cell_;
    return cells < 0 ? -1 : cells > 1e6f ? 1000000 : static_cast<int>(cells);
  }

  float radius_ = 0, cell_ = 1, per_cell_ = 1;
  cv::Point2f min_;
  int columns_ = 0, rows_ = 0;
  std::vector<int> start_, next_, cell_of_;
  std::vector<float> x_, y_;
  std::vector<int> index_;
};

}  // namespace stillpoint
