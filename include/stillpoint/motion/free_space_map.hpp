// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "stillpoint/core/cell_labels.hpp"
#include "stillpoint/core/fill_image.hpp"
#include "stillpoint/motion/cell_judge.hpp"
#include "stillpoint/motion/cell_projection.hpp"
#include "stillpoint/motion/depth_cells.hpp"
#include "stillpoint/motion/depth_key_view.hpp"
#include "stillpoint/motion/depth_shot.hpp"
#include "stillpoint/motion/far_holes.hpp"
#include "stillpoint/sensor/sensor_model.hpp"

namespace stillpoint {

/// The depth of the last 1.7 s in cells, with the poses of the depth camera, and the question
/// whether a place was free or filled when it was seen.
///
/// Bounded in time and, at any rate of frames, in memory: 52 images of 80 x 60 cells, 2.5 MB.
class FreeSpaceMap {
 public:
  explicit FreeSpaceMap(const SensorModel& sensor = {}) : sensor_(sensor), holes_(sensor) {}

  bool empty() const { return count_ == 0; }
  void clear() { count_ = 0, next_ = 0, older_ = 0; }

  /// Adds an image; `dynamic`: one byte per cell, not 0 = taken for dynamic in it. `touching`: the
  /// same for cells whose surface goes on into what is dynamic; may be empty. `gray`: their mean
  /// brightness; may be empty. Of a camera faster than 30 Hz not every image is kept. O(cells).
  void add(const DepthShot& shot, const DepthCells& cells, const std::vector<std::uint8_t>& dynamic,
           const std::vector<std::uint8_t>& touching = {}, const cv::Mat_<uchar>& gray = {}) {
    if (count_ > 0 && !is_due(shot.timestamp)) return;
    if (views_.size() < kCapacity) views_.resize(kCapacity);
    DepthKeyView& view = views_[next_];
    newest_ = next_;
    next_ = (next_ + 1) % kCapacity;
    count_ = std::min(count_ + 1, kCapacity);
    view.shot = shot;
    fill(shot, cells, dynamic, view);
    gray.copyTo(view.gray);
    view.alone.create(view.surface_m.size());
    for (std::size_t i = 0; i < cells.size(); ++i)
      view.alone.data[i] = touching.empty() || touching[i] == 0;
  }

  /// The cells that the depth camera sees, as far as the images tell (FarHoles).
  const cv::Rect& view() const { return holes_.view(); }

  /// Moves the image of a shot that add() was given last, once its pose is known better; nothing
  /// if that one was not kept.
  void correct(const DepthShot& shot) {
    if (count_ > 0 && views_[newest_].shot.timestamp == shot.timestamp)
      views_[newest_].shot.T_map_depth = shot.T_map_depth;
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
        const double view_age_s = timestamp - view.shot.timestamp;
        // A depth image may come later than one that was taken after it.
        if (view_age_s < 0 || view_age_s > kMemoryS) continue;
        if (!best ||
            std::abs(view_age_s - age_s) < std::abs(timestamp - best->shot.timestamp - age_s))
          best = &view;
      }
      if (best && (found.empty() || found.back() != best)) found.push_back(best);
    }
  }

  /// Labels the cells of a new image by what images of several ages saw (CellJudge). O(cells x 6).
  void judge(const DepthShot& shot, const DepthCells& cells, CellLabels& labels) {
    static constexpr std::array<double, 6> kAgesS = {1.6, 1.0, 0.6, 0.35, 0.2, 0.1};
    views_at(shot.timestamp, kAgesS, compared_);
    judge_.begin(cells, labels);
    for (const DepthKeyView* view : compared_)
      judge_.compare(CellProjection(cells, shot, view->shot, sensor_), *view,
                     free_space(*view, view->shot.lateral_cells + shot.lateral_cells),
                     shot.timestamp - view->shot.timestamp, labels);
    judge_.finish(labels);
  }

  /// Whether the surface of a cell of the last judge() was there 0.3 s before, too.
  bool settled(std::size_t cell) const { return judge_.settled(cell); }

 private:
  static constexpr double kMemoryS = 1.7, kLeastStepS = 0.0325;
  static constexpr std::size_t kCapacity = 52;  // kMemoryS / kLeastStepS
  static constexpr float kSurelyInRange = 0.8f;
  // A far hole stands if the view nearest to this age shows it; how old that must be.
  static constexpr double kStandsS = 1, kLeastStandsS = 0.9;

  // Whether an image is to be kept. Two in a row that are older than the newest one say that its
  // stamp was wrong: it is forgotten.
  bool is_due(double timestamp) {
    const double step_s = timestamp - views_[newest_].shot.timestamp;
    if (step_s > -kLeastStepS) {
      older_ = 0;
      return step_s >= kLeastStepS;
    }
    if (++older_ < 2) return false;
    older_ = 0, next_ = newest_, --count_;
    return true;
  }

  // Surfaces and free space of a new image. Nothing is known at the rim: it stands for all beyond.
  void fill(const DepthShot& shot, const DepthCells& cells,
            const std::vector<std::uint8_t>& dynamic, DepthKeyView& view) {
    const cv::Mat_<float> depth(cells.height, cells.width,
                                const_cast<float*>(cells.depth_m.data()));
    // A place is free as far as all cells around saw through it.
    cv::erode(depth, view.free_to_m, cv::Mat(), cv::Point(-1, -1), 1, cv::BORDER_CONSTANT, 0);
    view.surface_m.create(depth.size());
    const std::vector<std::uint8_t>& far = holes_.find(shot.timestamp, cells, dynamic);
    const float hole_free_to_m = kSurelyInRange * holes_.range_m();
    find_standing(shot, cells, far, hole_free_to_m);
    float *surface = view.surface_m.ptr<float>(), *free_to = view.free_to_m.ptr<float>();
    for (std::size_t i = 0; i < cells.size(); ++i) {
      const float z = cells.depth_m[i];
      const bool is_static = (z > 0) & (dynamic[i] == 0);
      surface[i] = is_static ? z : DepthKeyView::kNoSurface;
      surface[i] = far[i] != 0 ? DepthKeyView::kHole : surface[i];
      free_to[i] = standing_[i] != 0 ? hole_free_to_m : free_to[i];
    }
    const auto set_rim = [](cv::Mat_<float>& image, float value) {
      for (const int x : {0, image.cols - 1})
        detail::fill_part(image, {x, 0, 1, image.rows}, value);
      for (const int y : {0, image.rows - 1})
        detail::fill_part(image, {0, y, image.cols, 1}, value);
    };
    set_rim(view.surface_m, DepthKeyView::kNoSurface);
    set_rim(view.free_to_m, 0);
  }

  // Those of the far holes that stood for a while. Who passes right before the lens is a hole, too,
  // and may have the wall at the end of the range as its border, but only for a moment.
  void find_standing(const DepthShot& shot, const DepthCells& cells,
                     const std::vector<std::uint8_t>& far, float depth_m) {
    standing_.assign(far.size(), 0);
    if (std::find(far.begin(), far.end(), 1) == far.end()) return;
    views_at(shot.timestamp, std::array<double, 1>{kStandsS}, compared_);
    if (compared_.empty()) return;
    const DepthKeyView& before = *compared_[0];
    if (!(shot.timestamp - before.shot.timestamp > kLeastStandsS)) return;
    const CellProjection projection(cells, shot, before.shot, sensor_);
    const std::size_t n = static_cast<std::size_t>(cells.width);
    row_depth_m_.assign(n, depth_m);
    row_cell_.resize(n), row_z_.resize(n), row_least_step2_.resize(n);
    for (int y = 0; y < cells.height; ++y) {
      const std::size_t first = cells.index(0, y);
      projection.row(y, n, &cells.ray_x[first], &cells.ray_y[first], row_depth_m_.data(),
                     row_cell_.data(), row_z_.data(), row_least_step2_.data());
      for (std::size_t x = 0; x < n; ++x)
        standing_[first + x] = far[first + x] != 0 &&
                               before.surface_m.ptr<float>()[row_cell_[x]] == DepthKeyView::kHole;
    }
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
  int older_ = 0;  // how many in a row were older than the newest
  FarHoles holes_;
  // Of find_standing(): the holes that stand, and a row of cells in the earlier view.
  std::vector<std::uint8_t> standing_;
  std::vector<int> row_cell_;
  std::vector<float> row_depth_m_, row_z_, row_least_step2_;
  std::vector<const DepthKeyView*> compared_;
  CellJudge judge_;
  cv::Mat_<float> free_;
};

}  // namespace stillpoint
