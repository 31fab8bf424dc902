// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "stillpoint/core/cell_labels.hpp"
#include "stillpoint/core/config.hpp"
#include "stillpoint/motion/cell_projection.hpp"
#include "stillpoint/motion/depth_cells.hpp"
#include "stillpoint/motion/depth_shot.hpp"
#include "stillpoint/motion/far_holes.hpp"
#include "stillpoint/sensor/sensor_model.hpp"

namespace stillpoint {

/// A depth image of the last seconds in cells, with its pose.
struct DepthKeyView {
  DepthShot shot;
  /// Depth of the static surface in each cell, metres; kNoSurface, or kHole beyond the range of the
  /// sensor.
  cv::Mat_<float> surface_m;
  /// Where the surface did not touch anything dynamic: 1, else 0.
  cv::Mat_<uchar> alone;
  /// Up to which depth a cell and its eight neighbors are free, metres; 0: not known.
  cv::Mat_<float> free_to_m;

  static constexpr float kNoSurface = -1e9f, kHole = -2e9f;
};

/// The depth of the last 1.7 s in cells, with the poses of the depth camera, and the question
/// whether a place was free or filled when it was seen.
///
/// Bounded in time and, at any rate of frames, in memory: 52 images of 80 x 60 cells, 2.5 MB.
class FreeSpaceMap {
 public:
  explicit FreeSpaceMap(const SensorModel& sensor = {}) : sensor_(sensor), holes_(sensor) {}

  bool empty() const { return count_ == 0; }
  void clear() { count_ = 0, next_ = 0; }

  /// Adds an image; `dynamic`: one byte per cell, not 0 = taken for dynamic in it. `touching`: the
  /// same for cells whose surface goes on into what is dynamic; may be empty. Of a camera faster
  /// than 30 Hz not every image is kept. O(cells).
  void add(const DepthShot& shot, const DepthCells& cells, const std::vector<std::uint8_t>& dynamic,
           const std::vector<std::uint8_t>& touching = {}) {
    if (count_ > 0 && shot.timestamp - views_[newest_].shot.timestamp < kLeastStepS) return;
    if (views_.size() < kCapacity) views_.resize(kCapacity);
    DepthKeyView& view = views_[next_];
    newest_ = next_;
    next_ = (next_ + 1) % kCapacity;
    count_ = std::min(count_ + 1, kCapacity);
    view.shot = shot;
    fill(shot.timestamp, cells, dynamic, view);
    view.alone.create(view.surface_m.size());
    for (std::size_t i = 0; i < cells.size(); ++i)
      view.alone.data[i] = touching.empty() || touching[i] == 0;
  }

  /// Moves the newest image, once its pose is known better.
  void set_newest_pose(const Eigen::Isometry3d& T_map_depth) {
    if (count_ > 0) views_[newest_].shot.T_map_depth = T_map_depth;
  }

  /// The images nearest to the given ages at a time, each once, none older than the memory.
  template <std::size_t N>
  void views_at(double timestamp, const std::array<double, N>& ages_s,
                std::vector<const DepthKeyView*>& found) const {
    found.clear();
    for (const double age_s : ages_s) {
      const DepthKeyView* best = nullptr;
      for (std::size_t i = 0; i < count_; ++i) {
        const DepthKeyView& view = views_[i];
        if (timestamp - view.shot.timestamp > kMemoryS) continue;
        if (!best || std::abs(timestamp - view.shot.timestamp - age_s) <
                         std::abs(timestamp - best->shot.timestamp - age_s))
          best = &view;
      }
      if (best && (found.empty() || found.back() != best)) found.push_back(best);
    }
  }

  /// Labels the cells of a new image by what images of several ages saw. O(cells x 6).
  void judge(const DepthShot& shot, const DepthCells& cells, CellLabels& labels) {
    static constexpr std::array<double, 6> kAgesS = {1.6, 1.0, 0.6, 0.35, 0.2, 0.1};
    labels.reset(cells.block_px, cells.width, cells.height);
    views_at(shot.timestamp, kAgesS, compared_);
    score_.assign(cells.size(), 0);
    settled_.assign(cells.size(), 0);
    alone_.assign(cells.size(), 0);
    seen_.assign(cells.size(), 0);
    least_m_s_.assign(cells.size(), kNever);
    most_m_s_.assign(cells.size(), 0);
    receding_views_ = 0;
    for (const DepthKeyView* view : compared_) {
      const double age_s = shot.timestamp - view->shot.timestamp;
      compare(*view, shot,
              age_s > kRecedingFromS && age_s < kRecedingToS ? static_cast<float>(age_s) : 0,
              cells);
      if (age_s >= kSettledS)
        for (std::size_t i = 0; i < cells.size(); ++i) settled_[i] = score_[i] < 0;
    }
    for (std::size_t i = 0; i < cells.size(); ++i)
      labels[i] = score_[i] > 1 || recedes(i) ? CellLabel::kMoved
                  : score_[i] < 0             ? CellLabel::kStatic
                                              : CellLabel::kUnknown;
    for (std::size_t i = 0; i < cells.size(); ++i) {
      if (alone_[i] != 0) labels.set_alone(i);
      if (seen_[i] != 0) labels.set_seen(i);
    }
  }

  /// Whether the surface of a cell of the last judge() was there 0.3 s before, too.
  bool settled(std::size_t cell) const { return settled_[cell] != 0; }

 private:
  static constexpr double kMemoryS = 1.7, kLeastStepS = 0.0325, kSettledS = 0.3;
  static constexpr std::size_t kCapacity = 52;  // kMemoryS / kLeastStepS
  static constexpr float kNever = 1e9f;         // m/s, of what does not recede
  static constexpr float kSurelyInRange = 0.8f;
  // Sensors measure nothing close by either: so near, a hole does not tell what was there.
  static constexpr float kSurelyMeasuredM = 1;
  static constexpr float kFreeMarginM = 0.02f;
  static constexpr double kRecedingFromS = 0.15, kRecedingToS = 0.7;
  static constexpr float kSlowestMS = 0.2f, kFastestMS = 2, kSteady = 1.7f;

  // Surfaces and free space of a new image. Nothing is known at the rim: it stands for all beyond.
  void fill(double timestamp, const DepthCells& cells, const std::vector<std::uint8_t>& dynamic,
            DepthKeyView& view) {
    const cv::Mat_<float> depth(cells.height, cells.width,
                                const_cast<float*>(cells.depth_m.data()));
    // A place is free as far as all cells around saw through it.
    cv::erode(depth, view.free_to_m, cv::Mat(), cv::Point(-1, -1), 1, cv::BORDER_CONSTANT, 0);
    view.surface_m.create(depth.size());
    const std::vector<std::uint8_t>& far = holes_.find(timestamp, cells, dynamic);
    const float hole_free_to_m = kSurelyInRange * holes_.range_m();
    for (int y = 0; y < cells.height; ++y)
      for (int x = 0; x < cells.width; ++x) {
        const std::size_t i = cells.index(x, y);
        const bool rim = x == 0 || y == 0 || x + 1 == cells.width || y + 1 == cells.height;
        float& surface = view.surface_m(y, x);
        surface = !rim && depth(y, x) > 0 && !dynamic[i] ? depth(y, x) : DepthKeyView::kNoSurface;
        if (rim) view.free_to_m(y, x) = 0;
        if (far[i] != 0) surface = DepthKeyView::kHole, view.free_to_m(y, x) = hole_free_to_m;
      }
  }

  // A row of cells in an earlier image (CellProjection), and what that image knows there.
  struct Row {
    std::vector<int> cell, alone;
    std::vector<float> z, least_step2, surface_m, free_to_m;

    void resize(std::size_t n) {
      for (auto* v : {&cell, &alone}) v->resize(n);
      for (auto* v : {&z, &least_step2, &surface_m, &free_to_m}) v->resize(n);
    }
    void look_up(const float* surface, const float* free_to, const uchar* stood_alone) {
      for (std::size_t x = 0; x < cell.size(); ++x) {
        surface_m[x] = surface[cell[x]], free_to_m[x] = free_to[cell[x]];
        alone[x] = stood_alone[cell[x]];
      }
    }
  };

  // `receding_s`: the age of the view, if it is one to look for receding surfaces in.
  void compare(const DepthKeyView& view, const DepthShot& shot, float receding_s,
               const DepthCells& cells) {
    const CellProjection projection(cells, shot, view.shot, sensor_);
    const float* free_to_m =
        free_space(view, view.shot.lateral_cells + shot.lateral_cells).ptr<float>();
    const std::size_t n = static_cast<std::size_t>(cells.width);
    row_.resize(n);
    receding_views_ += receding_s > 0;
    for (int y = 0; y < cells.height; ++y) {
      const std::size_t first = cells.index(0, y);
      projection.row(y, row_.cell.data(), row_.z.data(), row_.least_step2.data());
      row_.look_up(view.surface_m.ptr<float>(), free_to_m, view.alone.ptr<uchar>());
      count(row_, n, &score_[first], &alone_[first], &seen_[first]);
      if (receding_s > 0)
        measure_speed(row_, n, 1 / receding_s, &least_m_s_[first], &most_m_s_[first]);
    }
  }

  // Seen free counts two, seen filled by the same surface counts minus one. Without branches: hard
  // to foresee, and so it becomes vector instructions. At the rim, and beyond, nothing was seen.
  static void count(const Row& row, std::size_t n, int* STILLPOINT_RESTRICT score,
                    int* STILLPOINT_RESTRICT alone, int* STILLPOINT_RESTRICT seen) {
    const float *z = row.z.data(), *step2 = row.least_step2.data();
    const float *surface = row.surface_m.data(), *free_to = row.free_to_m.data();
    const int* stood_alone = row.alone.data();
    for (std::size_t x = 0; x < n; ++x) {
      const float free_by = free_to[x] - z[x] - kFreeMarginM, behind_by = z[x] - surface[x];
      const int sure = (surface[x] > DepthKeyView::kHole) | (z[x] > kSurelyMeasuredM);
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
  static void measure_speed(const Row& row, std::size_t n, float per_s,
                            float* STILLPOINT_RESTRICT least_m_s,
                            float* STILLPOINT_RESTRICT most_m_s) {
    const float *z = row.z.data(), *step2 = row.least_step2.data();
    const float* surface = row.surface_m.data();
    for (std::size_t x = 0; x < n; ++x) {
      const float behind_by = z[x] - surface[x];
      const bool behind = (behind_by > 0) & (behind_by * behind_by > step2[x]) & (surface[x] > 0) &
                          (z[x] < CellProjection::kBeyond);
      const float speed = behind ? behind_by * per_s : kNever;
      least_m_s[x] = least_m_s[x] < speed ? least_m_s[x] : speed;
      most_m_s[x] = most_m_s[x] > speed ? most_m_s[x] : speed;
    }
  }

  bool recedes(std::size_t i) const {
    return receding_views_ >= 2 && least_m_s_[i] > kSlowestMS && most_m_s_[i] < kFastestMS &&
           most_m_s_[i] < kSteady * least_m_s_[i];
  }

  // How far the cells of an image are free if they may lie beside where they are drawn.
  const cv::Mat_<float>& free_space(const DepthKeyView& view, const Eigen::Vector2f& lateral) {
    const auto cells = [](int all, float reach) {  // all, if it is not a number
      return static_cast<int>(std::min(static_cast<float>(all), reach));
    };
    const int rx = cells(view.free_to_m.cols, lateral.x());
    const int ry = cells(view.free_to_m.rows, lateral.y());
    if (rx <= 0 && ry <= 0) return view.free_to_m;
    const cv::Size window(2 * rx + 1, 2 * ry + 1);
    cv::erode(view.free_to_m, free_, cv::getStructuringElement(cv::MORPH_RECT, window),
              cv::Point(-1, -1), 1, cv::BORDER_CONSTANT, 0);
    return free_;
  }

  SensorModel sensor_;
  std::vector<DepthKeyView> views_;
  std::size_t count_ = 0, next_ = 0, newest_ = 0;
  FarHoles holes_;
  std::vector<const DepthKeyView*> compared_;
  std::vector<int> score_, alone_, seen_;
  std::vector<std::uint8_t> settled_;
  std::vector<float> least_m_s_, most_m_s_;  // of what recedes, over the views that tell
  int receding_views_ = 0;
  cv::Mat_<float> free_;
  Row row_;
};

}  // namespace stillpoint
