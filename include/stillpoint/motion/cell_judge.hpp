// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "stillpoint/core/cell_labels.hpp"
#include "stillpoint/core/config.hpp"
#include "stillpoint/core/depth_view.hpp"
#include "stillpoint/motion/cell_projection.hpp"
#include "stillpoint/motion/depth_cells.hpp"
#include "stillpoint/motion/depth_key_view.hpp"

namespace stillpoint {

/// Labels the cells of a new depth image by what earlier ones, from the oldest to the newest, saw
/// in their places. A cell that showed the same surface in the first three of them, and stood alone
/// there, is static; with these, and with those that have surely moved, later views are not
/// compared. Cells without depth stay unknown.
class CellJudge {
 public:
  /// Begins with a new image: all its cells are unknown. O(cells).
  void begin(const DepthCells& cells, CellLabels& labels) {
    labels.reset(cells.block_px, cells.width, cells.height);
    settled_.assign(cells.size(), 0);
    views_ = receding_views_ = 0;
    open_.resize(cells.size());
    row_.resize(static_cast<std::size_t>(cells.width));
    first_.assign(1, 0);
    std::size_t n = 0;
    for (int y = 0; y < cells.height; ++y) {
      for (int x = 0; x < cells.width; ++x) {
        const std::size_t i = cells.index(x, y);
        if (cells.depth_m[i] > 0) open_.set(n++, i, cells);
      }
      first_.push_back(n);
    }
    open_.know_nothing();
  }

  /// Compares the cells that are still open with a view that is `age_s` older. `free_to_m`: how far
  /// the cells of the view are free, metres. O(open cells).
  void compare(const CellProjection& projection, const DepthKeyView& view,
               const cv::Mat_<float>& free_to_m, double age_s, CellLabels& labels) {
    const bool receding = age_s > kRecedingFromS && age_s < kRecedingToS;
    receding_views_ += receding;
    for (std::size_t y = 0; y + 1 < first_.size(); ++y) {
      const std::size_t first = first_[y], n = first_[y + 1] - first;
      projection.row(static_cast<int>(y), n, &open_.ray_x[first], &open_.ray_y[first],
                     &open_.depth_m[first], row_.cell.data(), row_.z.data(),
                     row_.least_step2.data());
      row_.look_up(n, view.surface_m.ptr<float>(), free_to_m.ptr<float>(), view.alone.ptr<uchar>());
      count(row_, n, &open_.score[first], &open_.alone[first], &open_.seen[first]);
      if (receding)
        measure_speed(row_, n, 1 / static_cast<float>(age_s), &open_.least_m_s[first],
                      &open_.most_m_s[first]);
    }
    if (age_s >= kSettledS)
      for (std::size_t k = 0; k < first_.back(); ++k) settled_[open_.cell[k]] = open_.score[k] < 0;
    if (++views_ == kEnoughViews) close(labels);
  }

  /// Labels the cells that are still open, after the last view. O(open cells).
  void finish(CellLabels& labels) {
    for (std::size_t k = 0; k < first_.back(); ++k) label(k, labels);
  }

  /// Whether the surface of a cell was there 0.3 s before, too. O(1).
  bool settled(std::size_t cell) const { return settled_[cell] != 0; }

 private:
  static constexpr int kEnoughViews = 3;
  static constexpr double kSettledS = 0.3;
  static constexpr float kNever = 1e9f;  // m/s, of what does not recede
  static constexpr float kFreeMarginM = 0.02f;
  static constexpr double kRecedingFromS = 0.15, kRecedingToS = 0.7;
  static constexpr float kSlowestMS = 0.2f, kFastestMS = 2, kSteady = 1.7f;

  // The cells that are still open, row by row, and what the views have told of them.
  struct Open {
    std::vector<std::size_t> cell;
    std::vector<float> ray_x, ray_y, depth_m;
    std::vector<int> score, alone, seen;
    std::vector<float> least_m_s, most_m_s;  // of what recedes, over the views that tell

    void resize(std::size_t n) {
      cell.resize(n);
      for (auto* v : {&ray_x, &ray_y, &depth_m, &least_m_s, &most_m_s}) v->resize(n);
      for (auto* v : {&score, &alone, &seen}) v->resize(n);
    }
    void set(std::size_t k, std::size_t i, const DepthCells& cells) {
      cell[k] = i;
      ray_x[k] = cells.ray_x[i], ray_y[k] = cells.ray_y[i], depth_m[k] = cells.depth_m[i];
    }
    void know_nothing() {
      for (auto* v : {&score, &alone, &seen}) std::fill(v->begin(), v->end(), 0);
      std::fill(least_m_s.begin(), least_m_s.end(), kNever);
      std::fill(most_m_s.begin(), most_m_s.end(), 0.0f);
    }
    void move(std::size_t from, std::size_t to) {
      cell[to] = cell[from];
      for (auto* v : {&ray_x, &ray_y, &depth_m, &least_m_s, &most_m_s}) (*v)[to] = (*v)[from];
      for (auto* v : {&score, &alone, &seen}) (*v)[to] = (*v)[from];
    }
  };

  // A row of cells in an earlier image (CellProjection), and what that image knows there.
  struct Row {
    std::vector<int> cell, alone;
    std::vector<float> z, least_step2, surface_m, free_to_m;

    void resize(std::size_t n) {
      for (auto* v : {&cell, &alone}) v->resize(n);
      for (auto* v : {&z, &least_step2, &surface_m, &free_to_m}) v->resize(n);
    }
    void look_up(std::size_t n, const float* surface, const float* free_to,
                 const uchar* stood_alone) {
      for (std::size_t x = 0; x < n; ++x) {
        surface_m[x] = surface[cell[x]], free_to_m[x] = free_to[cell[x]];
        alone[x] = stood_alone[cell[x]];
      }
    }
  };

  // Labels the cells that are sure by now, and keeps the others open: once seen free, a cell has
  // moved, whatever later views say.
  void close(CellLabels& labels) {
    std::size_t kept = 0, k = 0;
    for (std::size_t y = 0; y + 1 < first_.size(); ++y) {
      const std::size_t end = first_[y + 1];
      for (; k < end; ++k)
        if (has_moved(k) || (open_.score[k] <= -kEnoughViews && open_.alone[k] != 0))
          label(k, labels);
        else
          open_.move(k, kept++);
      first_[y + 1] = kept;
    }
  }

  void label(std::size_t k, CellLabels& labels) const {
    const std::size_t i = open_.cell[k];
    labels[i] = has_moved(k) || recedes(k) ? CellLabel::kMoved
                : open_.score[k] < 0       ? CellLabel::kStatic
                                           : CellLabel::kUnknown;
    if (open_.alone[k] != 0) labels.set_alone(i);
    if (open_.seen[k] != 0) labels.set_seen(i);
  }

  // Seen free counts two, seen filled by the same surface counts minus one. Without branches: hard
  // to foresee, and so it becomes vector instructions. At the rim, and beyond, nothing was seen.
  STILLPOINT_ROW_LOOP static void count(const Row& row, std::size_t n,
                                        int* STILLPOINT_RESTRICT score,
                                        int* STILLPOINT_RESTRICT alone,
                                        int* STILLPOINT_RESTRICT seen) {
    const float *z = row.z.data(), *step2 = row.least_step2.data();
    const float *surface = row.surface_m.data(), *free_to = row.free_to_m.data();
    const int* stood_alone = row.alone.data();
    for (std::size_t x = 0; x < n; ++x) {
      const float free_by = free_to[x] - z[x] - kFreeMarginM, behind_by = z[x] - surface[x];
      const int sure = (surface[x] > DepthKeyView::kHole) | (z[x] > DepthView::kSurelyMeasuredM);
      const int free = (free_by > 0) & (free_by * free_by > step2[x]) & sure;
      const int same = (score[x] <= 0) & (behind_by * behind_by < step2[x]) & (1 - free);
      score[x] += 2 * free - same;
      alone[x] |= same & stood_alone[x];
      seen[x] |= (free_to[x] > 0) | (surface[x] > 0);
    }
  }

  // Who walks straight away is never where anything was seen free: he hides behind where he was.
  // But the longer ago, the nearer his surface was, at one speed; what comes into view behind an
  // edge was as far behind it at any time.
  STILLPOINT_ROW_LOOP static void measure_speed(const Row& row, std::size_t n, float per_s,
                                                float* STILLPOINT_RESTRICT least_m_s,
                                                float* STILLPOINT_RESTRICT most_m_s) {
    const float *z = row.z.data(), *step2 = row.least_step2.data();
    const float* surface = row.surface_m.data();
    for (std::size_t x = 0; x < n; ++x) {
      const float behind_by = z[x] - surface[x];
      const int behind = (behind_by > 0) & (behind_by * behind_by > step2[x]) & (surface[x] > 0) &
                         (z[x] < CellProjection::kBeyond);
      const float m_s = behind_by * per_s, never = kNever * static_cast<float>(1 - behind);
      const float speed = m_s > never ? m_s : never;
      const float least = least_m_s[x], most = most_m_s[x];
      least_m_s[x] = least < speed ? least : speed;
      most_m_s[x] = most > speed ? most : speed;
    }
  }

  bool has_moved(std::size_t k) const { return open_.score[k] > 1; }
  bool recedes(std::size_t k) const {
    return receding_views_ >= 2 && open_.least_m_s[k] > kSlowestMS &&
           open_.most_m_s[k] < kFastestMS && open_.most_m_s[k] < kSteady * open_.least_m_s[k];
  }

  Open open_;
  std::vector<std::size_t> first_;  // of each row in open_, and the end
  std::vector<std::uint8_t> settled_;
  int views_ = 0, receding_views_ = 0;
  Row row_;
};

}  // namespace stillpoint
