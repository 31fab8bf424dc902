// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <vector>

namespace stillpoint {

/// True if `b` lies within `radius` of `a` (inclusive): the one definition of "neighbor" that every
/// neighbor search ends with, so that all give the same neighbors. Exact for pixel coordinates up
/// to a few thousand: the squares are formed in double.
inline bool within_radius(const cv::Point2f& a, const cv::Point2f& b, float radius) {
  const double dx = static_cast<double>(a.x) - b.x, dy = static_cast<double>(a.y) - b.y;
  return dx * dx + dy * dy <= static_cast<double>(radius) * radius;
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
///     any order, a point equal to the query included.
///
/// build() is O(n), a query O(points in the nine cells around). No allocation once the largest
/// number of points and the largest picture were seen. Not thread-safe.
class GridNeighborSearch {
 public:
  void build(const std::vector<cv::Point2f>& points, float radius) {
    points_ = &points;
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
    columns_ = static_cast<int>(width / cell_) + 1;
    rows_ = static_cast<int>(height / cell_) + 1;
    start_.assign(static_cast<std::size_t>(columns_) * rows_ + 1, 0);
    cell_of_.resize(n);
    for (std::size_t i = 0; i < n; ++i) {
      cell_of_[i] = row(points[i].y) * columns_ + column(points[i].x);
      ++start_[static_cast<std::size_t>(cell_of_[i]) + 1];
    }
    for (std::size_t c = 1; c < start_.size(); ++c) start_[c] += start_[c - 1];
    order_.resize(n);
    next_.assign(start_.begin(), start_.end());
    for (std::size_t i = 0; i < n; ++i)
      order_[static_cast<std::size_t>(next_[static_cast<std::size_t>(cell_of_[i])]++)] =
          static_cast<int>(i);
  }

  template <class Visit>
  void for_each_neighbor(const cv::Point2f& query, Visit&& visit) const {
    if (columns_ == 0 || !(radius_ >= 0)) return;
    const int x0 = std::max(0, column(query.x - radius_)), y0 = std::max(0, row(query.y - radius_));
    const int x1 = std::min(columns_ - 1, column(query.x + radius_));
    const int y1 = std::min(rows_ - 1, row(query.y + radius_));
    for (int y = y0; y <= y1; ++y) {
      if (x0 > x1) break;
      // The cells of a row are neighbors in memory: one run of indices.
      const int begin = start_[static_cast<std::size_t>(y) * columns_ + x0];
      const int end = start_[static_cast<std::size_t>(y) * columns_ + x1 + 1];
      for (int k = begin; k < end; ++k) {
        const int i = order_[static_cast<std::size_t>(k)];
        if (within_radius(query, (*points_)[static_cast<std::size_t>(i)], radius_)) visit(i);
      }
    }
  }

 private:
  static constexpr float kMaxCellsPerSide = 512;

  int column(float x) const { return index(x - min_.x); }
  int row(float y) const { return index(y - min_.y); }
  int index(float offset) const {
    // Far queries stay inside the range of int.
    return static_cast<int>(std::floor(std::min(std::max(offset / cell_, -1.0f), 1e6f)));
  }

  const std::vector<cv::Point2f>* points_ = nullptr;
  float radius_ = 0, cell_ = 1;
  cv::Point2f min_;
  int columns_ = 0, rows_ = 0;
  std::vector<int> start_, next_, cell_of_, order_;
};

}  // namespace stillpoint
