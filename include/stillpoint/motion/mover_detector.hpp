// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "stillpoint/core/cell_labels.hpp"
#include "stillpoint/core/fill_image.hpp"
#include "stillpoint/core/instance.hpp"
#include "stillpoint/core/mask_pool.hpp"
#include "stillpoint/core/scratch.hpp"
#include "stillpoint/motion/depth_cells.hpp"
#include "stillpoint/motion/mover_detector_settings.hpp"

namespace stillpoint {

/// From cells that have moved to objects: moved cells that hang together grow over connected depth,
/// never into static cells, and become instances without a class. O(cells).
class MoverDetector {
 public:
  using Settings = MoverDetectorSettings;

  explicit MoverDetector(const Settings& settings = {}) : settings_(settings) { settings.check(); }

  const Settings& settings() const { return settings_; }

  /// Finds the movers of a frame. `outlier_corners`: the cells of corners that move otherwise than
  /// the camera says. The reference stays valid until the next call; masks that are copied out of
  /// it stay as they are.
  const std::vector<Instance>& find(const DepthCells& cells, const CellLabels& labels,
                                    const std::vector<std::size_t>& outlier_corners = {}) {
    clear();
    taken_.assign(cells.size(), 0);
    corner_.assign(cells.size(), 0);
    for (const std::size_t i : outlier_corners) corner_[i] = 1;
    for (int y = 0; y < cells.height; ++y)
      for (int x = 0; x < cells.width; ++x) {
        const std::size_t i = cells.index(x, y);
        if (labels[i] != CellLabel::kMoved || taken_[i] != 0) continue;
        const Region region = grow(cells, labels, x, y);
        if (is_mover(region)) add_instance(cells.block_px, region.box);
      }
    return found_;
  }

  /// What the last find() returned.
  const std::vector<Instance>& found() const { return found_; }
  /// Nothing is found.
  void clear() { found_.clear(); }

 private:
  static constexpr int kManyCells = 50;
  // Of a mover that is large and close the border says little: the image cuts it off, or its
  // inside, where its depth is the same as a moment ago, was not found. Much of what was found of
  // it has moved then, and so many cells have corners that show it. Where depth errs, as on a black
  // screen, corners don't.
  static constexpr float kNoDepthM = 1e9f;  // how much farther a cell without depth is
  static constexpr int kManyCorners = 8;
  static constexpr double kMuchMoved = 0.3;

  struct Visit {
    int x, y, distance;
  };
  struct Region {
    cv::Rect box;
    int moved = 0, judged = 0, corners = 0;  // cells
    double moved_m2 = 0;
    int open = 0, closed = 0;  // sides of cells at its border
  };

  // The region of a moved cell; its cells are in queue_.
  Region grow(const DepthCells& cells, const CellLabels& labels, int x0, int y0) {
    Region region;
    region.box = cv::Rect(x0, y0, 1, 1);
    queue_.assign(1, {x0, y0, 0});
    taken_[cells.index(x0, y0)] = 1;
    for (std::size_t k = 0; k < queue_.size(); ++k) {
      const Visit visit = queue_[k];
      const std::size_t i = cells.index(visit.x, visit.y);
      const float z = cells.depth_m[i];
      if (labels[i] == CellLabel::kMoved) {
        ++region.moved;
        region.moved_m2 += static_cast<double>(z) * z / (cells.fx * cells.fy);
      }
      region.corners += corner_[i];
      region.judged += labels[i] == CellLabel::kMoved || labels.seen(i);
      region.box |= cv::Rect(visit.x, visit.y, 1, 1);
      const int reach = static_cast<int>(settings_.growth_m * cells.fx / z);
      for (const auto& next : DepthCells::kNext) {
        const int x = visit.x + next[0], y = visit.y + next[1];
        if (x < 0 || y < 0 || x >= cells.width || y >= cells.height) continue;
        const std::size_t j = cells.index(x, y);
        if (taken_[j] != 0) continue;
        const float step = cells.depth_m[j] > 0 ? cells.depth_m[j] - z : kNoDepthM;
        if (step > DepthCells::most_step_m(z)) ++region.closed;
        if (std::abs(step) > DepthCells::most_step_m(z)) continue;
        const int distance = labels[j] == CellLabel::kMoved ? 0 : visit.distance + 1;
        if (labels[j] == CellLabel::kStatic || distance > reach) {
          ++region.open;
          continue;
        }
        taken_[j] = 1;
        queue_.push_back({x, y, distance});
      }
    }
    return region;
  }

  bool is_mover(const Region& region) const {
    return region.moved >= settings_.min_moved_cells &&
           (region.moved_m2 >= settings_.min_moved_area_m2 || region.moved >= kManyCells) &&
           region.moved >= settings_.min_moved_share * region.judged &&
           (region.open <= settings_.max_open_share * (region.open + region.closed) ||
            (region.corners >= kManyCorners && region.moved >= kMuchMoved * region.judged));
  }

  void add_instance(int block_px, const cv::Rect& box) {
    const int b = block_px;
    found_.emplace_back();
    Instance& instance = found_.back();
    instance.class_name.clear();
    instance.box = cv::Rect(box.x * b, box.y * b, box.width * b, box.height * b);
    instance.mask = masks_.zeros(instance.box.size());
    for (const Visit& v : queue_)
      detail::fill_part(instance.mask, {(v.x - box.x) * b, (v.y - box.y) * b, b, b}, uchar{255});
  }

  Settings settings_;
  std::vector<std::uint8_t> taken_, corner_;  // cells
  std::vector<Visit> queue_;
  std::vector<Instance> found_;
  detail::MaskPool masks_;
};

}  // namespace stillpoint
