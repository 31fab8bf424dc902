// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

#include <algorithm>
#include <bitset>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "stillpoint/core/config.hpp"
#include "stillpoint/core/scratch.hpp"

namespace stillpoint {

namespace detail {

/// How many bits are set.
inline int count_bits(std::uint64_t v) { return static_cast<int>(std::bitset<64>(v).count()); }

/// Place of the lowest bit of a word that is not zero.
inline std::size_t lowest_bit(std::uint64_t v) {
#if defined(__GNUC__) || defined(__clang__)
  return static_cast<std::size_t>(__builtin_ctzll(v));
#else
  return static_cast<std::size_t>(count_bits(~v & (v - 1)));
#endif
}

/// For each of n points its cell in a grid from `origin` on, row by row; the first or last ones for
/// points beyond.
STILLPOINT_ROW_LOOP inline void find_cells(const cv::Point2f* STILLPOINT_RESTRICT points,
                                           std::size_t n, const cv::Point2f& origin, float per_cell,
                                           const cv::Size& grid, int* STILLPOINT_RESTRICT cells) {
  const float left = origin.x, top = origin.y;
  const float last_x = static_cast<float>(grid.width - 1);
  const float last_y = static_cast<float>(grid.height - 1);
  const int columns = grid.width;
  for (std::size_t i = 0; i < n; ++i) {
    const float u = (points[i].x - left) * per_cell, v = (points[i].y - top) * per_cell;
    const float x = u < 0 ? 0 : u > last_x ? last_x : u, y = v < 0 ? 0 : v > last_y ? last_y : v;
    cells[i] = static_cast<int>(y) * columns + static_cast<int>(x);
  }
}

}  // namespace detail

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
/// number of points and the largest image were seen. Not thread-safe.
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
    // A tiny radius in a huge image must not make more cells than points can fill.
    const float width = max.x - min_.x, height = max.y - min_.y;
    cell_ = std::max({radius, 1.0f, std::max(width, height) / kMaxCellsPerSide});
    per_cell_ = 1 / cell_;
    columns_ = static_cast<int>(width * per_cell_) + 1;
    rows_ = static_cast<int>(height * per_cell_) + 1;
    detail::refill(start_, static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_) + 1,
                   0);
    cell_of_.resize(n);
    detail::find_cells(points.data(), n, min_, per_cell_, {columns_, rows_}, cell_of_.data());
    for (const int c : cell_of_) ++start_[static_cast<std::size_t>(c) + 1];
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
    // Which candidates are near is hard to foresee: no branch before all of a run are judged.
    for_each_run(query, [&](std::size_t begin, std::size_t end) {
      for (; begin < end; begin += kChunk) {
        const std::size_t n = std::min(kChunk, end - begin);
        for (std::uint64_t bits = near_bits(query, begin, n); bits != 0; bits &= bits - 1)
          visit(index_[begin + detail::lowest_bit(bits)]);
      }
    });
  }

  /// How many points for_each_neighbor() would visit; several times faster.
  int count_neighbors(const cv::Point2f& query) const {
    int count = 0;
    for_each_run(query, [&](std::size_t begin, std::size_t end) {
      for (; begin < end; begin += kChunk)
        count += detail::count_bits(near_bits(query, begin, std::min(kChunk, end - begin)));
    });
    return count;
  }

 private:
  // For n points from `begin` on, at most 64, a bit each: 1 where within_radius() is true.
  std::uint64_t near_bits(const cv::Point2f& query, std::size_t begin, std::size_t n) const {
    std::uint64_t bits = 0;
#if defined(__SSE2__)
    const __m128 qx = _mm_set1_ps(query.x), qy = _mm_set1_ps(query.y);
    const __m128 limit = _mm_set1_ps(radius_ * radius_);
    for (std::size_t i = 0; i < n; i += kVector) {  // also over the end
      const __m128 dx = _mm_sub_ps(qx, _mm_loadu_ps(x_.data() + begin + i));
      const __m128 dy = _mm_sub_ps(qy, _mm_loadu_ps(y_.data() + begin + i));
      const __m128 squared = _mm_add_ps(_mm_mul_ps(dx, dx), _mm_mul_ps(dy, dy));
      bits |= static_cast<std::uint64_t>(_mm_movemask_ps(_mm_cmple_ps(squared, limit))) << i;
    }
#else
    for (std::size_t i = 0; i < n; ++i)
      bits |=
          static_cast<std::uint64_t>(within_radius(query, {x_[begin + i], y_[begin + i]}, radius_))
          << i;
#endif
    return bits & (~std::uint64_t{0} >> (64 - n));
  }

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
  static constexpr std::size_t kVector = 4, kChunk = 64;

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
