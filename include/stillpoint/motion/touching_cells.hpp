// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <opencv2/core.hpp>
#include <vector>

#include "stillpoint/motion/depth_cells.hpp"
#include "stillpoint/sensor/sensor_model.hpp"

namespace stillpoint {

/// Finds the cells that may be parts of what is dynamic though they do not move now: those whose
/// surface goes on into it, not farther than 0.35 m from it. What lies in one plane with a
/// surface beyond is a table or a wall, and no part of it.
class TouchingCells {
 public:
  explicit TouchingCells(const SensorModel& sensor = {}) : sensor_(sensor) {}

  /// One byte per cell, not 0 = touching or dynamic; `dynamic`: the same for what is dynamic. The
  /// reference stays valid until the next call. O(cells).
  const std::vector<std::uint8_t>& find(const DepthCells& cells,
                                        const std::vector<std::uint8_t>& dynamic) {
    touching_ = dynamic;
    queue_.clear();
    for (int y = 0; y < cells.height; ++y)
      for (int x = 0; x < cells.width; ++x)
        if (dynamic[cells.index(x, y)] != 0) queue_.push_back({x, y, 0});
    if (queue_.empty()) return touching_;
    spread(cells);
    release_planes(cells, dynamic);
    return touching_;
  }

 private:
  static constexpr float kReachM = 0.35f;
  static constexpr float kPlaneSigmas = 2;  // of a pixel's depth; a cell is the mean of many

  struct Visit {
    int x, y, distance;
  };

  static bool inside(const DepthCells& cells, int x, int y) {
    return x >= 0 && y >= 0 && x < cells.width && y < cells.height;
  }

  // Breadth first from what is dynamic, over depth that goes on without a step.
  void spread(const DepthCells& cells) {
    for (std::size_t k = 0; k < queue_.size(); ++k) {
      const Visit visit = queue_[k];
      const float z = cells.depth_m[cells.index(visit.x, visit.y)];
      if (!(z > 0) || visit.distance >= static_cast<int>(kReachM * cells.fx / z)) continue;
      for (const auto& next : DepthCells::kNext) {
        const int x = visit.x + next[0], y = visit.y + next[1];
        if (!inside(cells, x, y)) continue;
        const std::size_t i = cells.index(x, y);
        if (touching_[i] != 0 || std::abs(cells.depth_m[i] - z) > DepthCells::most_step_m(z))
          continue;
        touching_[i] = 1;
        queue_.push_back({x, y, visit.distance + 1});
      }
    }
  }

  // What continues a plane does not touch what is dynamic: a table, a wall. Along the image's rows
  // as well as across them, as people are straight, too, from foot to head. From each corner of the
  // image once, so that it goes on from cell to cell.
  void release_planes(const DepthCells& cells, const std::vector<std::uint8_t>& dynamic) {
    collect(cells, dynamic);
    const auto release = [&](const cv::Point& at) {
      std::uint8_t& touching = touching_[cells.index(at.x, at.y)];
      if (touching != 0 && continues_planes(cells, at.x, at.y)) touching = 0;
    };
    std::for_each(rightward_.begin(), rightward_.end(), release);
    std::for_each(leftward_.begin(), leftward_.end(), release);
    std::for_each(leftward_.rbegin(), leftward_.rend(), release);
    std::for_each(rightward_.rbegin(), rightward_.rend(), release);
  }

  // The cells that touch what is dynamic, row by row, each row rightward and leftward.
  void collect(const DepthCells& cells, const std::vector<std::uint8_t>& dynamic) {
    rightward_.clear(), leftward_.clear();
    for (int y = 0; y < cells.height; ++y) {
      const auto begin = static_cast<std::ptrdiff_t>(rightward_.size());
      for (int x = 0; x < cells.width; ++x)
        if (touching_[cells.index(x, y)] != 0 && dynamic[cells.index(x, y)] == 0)
          rightward_.push_back({x, y});
      std::reverse_copy(rightward_.begin() + begin, rightward_.end(),
                        std::back_inserter(leftward_));
    }
  }

  bool continues_planes(const DepthCells& cells, int x, int y) const {
    const auto along = [&](int dx, int dy) {
      return continues_plane(cells, x, y, -dx, -dy) || continues_plane(cells, x, y, dx, dy);
    };
    return along(1, 0) && (along(0, 1) || along(1, 1) || along(1, -1));
  }

  // Whether a cell lies in one plane with the next two in a direction, which do not touch what is
  // dynamic. In the image of a plane one over the depth grows evenly.
  bool continues_plane(const DepthCells& cells, int x, int y, int dx, int dy) const {
    if (!inside(cells, x + 2 * dx, y + 2 * dy)) return false;
    const std::size_t near = cells.index(x + dx, y + dy), far = cells.index(x + 2 * dx, y + 2 * dy);
    if (touching_[near] != 0 || touching_[far] != 0) return false;
    const float z = cells.depth_m[cells.index(x, y)], z1 = cells.depth_m[near],
                z2 = cells.depth_m[far];
    if (!(z1 > 0 && z2 > 0)) return false;
    return std::abs(z - 1 / (2 / z1 - 1 / z2)) < kPlaneSigmas * sensor_.depth_sigma_m(z);
  }

  SensorModel sensor_;
  std::vector<std::uint8_t> touching_;
  std::vector<Visit> queue_;
  std::vector<cv::Point> rightward_, leftward_;  // see collect()
};

}  // namespace stillpoint
