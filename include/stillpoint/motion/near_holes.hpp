// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "stillpoint/core/cell_labels.hpp"
#include "stillpoint/core/depth_view.hpp"
#include "stillpoint/motion/cell_projection.hpp"
#include "stillpoint/motion/depth_cells.hpp"
#include "stillpoint/motion/depth_holes.hpp"
#include "stillpoint/motion/depth_key_view.hpp"
#include "stillpoint/motion/depth_shot.hpp"
#include "stillpoint/motion/free_space_map.hpp"
#include "stillpoint/sensor/sensor_model.hpp"

namespace stillpoint {

/// Finds who stands so close before the lens that depth cannot be measured: a large hole in the
/// depth, open towards the border of the image, where the views of the last second had measured a
/// surface and saw it in another brightness. A hole before black or glossy surfaces, or of a sensor
/// that fails, shows the brightness that was there before. Where such a hole shows the pattern that
/// was there before, the image sees past the body.
///
/// Once found, such a hole is followed from frame to frame for a while, also where the camera's
/// pose is lost because it hides the world. O(cells) in frames with a large hole.
class NearHoles {
 public:
  explicit NearHoles(const SensorModel& sensor = {}) : sensor_(sensor) {}

  /// Forgets what was found.
  void reset() { found_.clear(); }

  /// Labels the cells of a frame that are too near (CellLabel::kNear), and of measured ones those
  /// that a hole goes on into. `gray`: mean brightness of the cells, CV_8UC1. `shot`: where the
  /// depth camera is in the map; null: not known. Whether there are any.
  bool find(double timestamp, const DepthCells& cells, const cv::Mat_<uchar>& gray,
            const DepthShot* shot, const FreeSpaceMap& map, CellLabels& labels) {
    std::swap(found_, last_);
    last_.resize(cells.size());
    found_.assign(cells.size(), Found::kNothing);
    view_ = map.view() & cv::Rect(0, 0, cells.width, cells.height);
    if (!is_large(count_holes(cells), cells)) return false;
    views_.clear();
    if (shot) map.views_at(timestamp, kAgesS, views_);
    judged_.assign(cells.size(), 0), changed_.assign(cells.size(), 0);
    expected_.assign(cells.size(), kUnknown);
    for (const DepthKeyView* view : views_) compare(cells, gray, *shot, *view);
    bool any = false;
    holes_.for_each(cells, view_, [&](const std::vector<cv::Point>& hole) {
      if (!is_large(static_cast<int>(hole.size()), cells) || !is_near(cells, hole, timestamp))
        return;
      grow(cells, gray, labels, hole);
      any = true;
    });
    if (any) mark(cells, labels);
    return any;
  }

 private:
  static constexpr std::array<double, 4> kAgesS = {0.8, 0.5, 0.3, 0.15};
  static constexpr int kFewestViews = 3;  // that a cell is judged by
  static constexpr int kLargeShare = 20;  // of the image: one in 20
  // Of a hole's cells so many must be judged, and of these so many must have changed: what stands
  // there may be as bright as the wall behind.
  static constexpr double kJudged = 0.5, kChanged = 0.3;
  static constexpr double kFollowedS = 2;  // since such a hole was last judged
  // Gray levels that mean nothing, and how many times what nine in ten static cells are off.
  static constexpr float kLeastOff = 4, kTimesUsual = 1.5f;
  static constexpr double kUsual = 0.9;
  static constexpr std::size_t kFewestStatic = 100;  // cells that tell what is usual
  static constexpr int kMarginCells = 4;             // never measured, beside the view
  static constexpr float kUnknown = -1000;
  // Pattern: cells to each side, how many must be known, its contrast (gray levels), correlation.
  static constexpr int kPattern = 3;
  static constexpr float kFewestPattern = 25, kLeastContrast = 8, kAlike = 0.7f;

  enum class Found : std::uint8_t {
    kNothing,
    kBody,  // too near
    kRoom   // in such a hole, but the image shows the room there
  };
  // Where a surface of an earlier view falls in the frame, and how much brighter than in that view
  // it is there: than the darkest, the brightest and the middle of nine cells.
  struct Pair {
    std::size_t cell;
    bool hole;
    float than_darkest, than_brightest, than_middle;
  };

  static bool is_large(int n, const DepthCells& cells) {
    return n * kLargeShare >= cells.width * cells.height;
  }

  int count_holes(const DepthCells& cells) const {
    int n = 0;
    for (int y = view_.y; y < view_.br().y; ++y) {
      const float* row = cells.depth_m.data() + cells.index(0, y);
      for (int x = view_.x; x < view_.br().x; ++x) n += row[x] < 0;
    }
    return n;
  }

  // Counts for each cell of a hole the views that judge it, and those that say that it has changed.
  void compare(const DepthCells& cells, const cv::Mat_<uchar>& gray, const DepthShot& shot,
               const DepthKeyView& view) {
    if (view.gray.size() != gray.size()) return;
    pair_up(cells, gray, shot, view);
    // Of several views the newest, which comes last, tells best what would be seen there.
    for (const Pair& p : pairs_) expected_[p.cell] = gray.data[p.cell] - p.than_middle;
    off_.clear();
    for (const Pair& p : pairs_)
      if (!p.hole) off_.push_back(p.than_middle);
    if (off_.size() < kFewestStatic) return;
    const float brighter = share_of(off_, 0.5);  // exposure
    const auto off = [&](const Pair& p) {
      return std::max({0.0f, p.than_brightest - brighter, brighter - p.than_darkest});
    };
    off_.clear();
    for (const Pair& p : pairs_)
      if (!p.hole) off_.push_back(off(p));
    const float most = std::max(kLeastOff, kTimesUsual * share_of(off_, kUsual));
    for (const Pair& p : pairs_)
      if (p.hole) ++judged_[p.cell], changed_[p.cell] += off(p) > most;
  }

  // Surfaces that were surely far enough away to be measured now, where the frame has a hole or the
  // same surface.
  void pair_up(const DepthCells& cells, const cv::Mat_<uchar>& gray, const DepthShot& shot,
               const DepthKeyView& view) {
    cv::erode(view.gray, darkest_, cv::Mat());
    cv::dilate(view.gray, brightest_, cv::Mat());
    const CellProjection projection(cells, view.shot, shot, sensor_);
    const std::size_t n = cells.row_size();
    cell_.resize(n), z_.resize(n), least_step2_.resize(n);
    pairs_.clear();
    for (int y = 0; y < cells.height; ++y) {
      const std::size_t first = cells.index(0, y);
      projection.row(y, n, &cells.ray_x[first], &cells.ray_y[first], view.surface_m.ptr<float>(y),
                     cell_.data(), z_.data(), least_step2_.data());
      for (std::size_t x = 0; x < n; ++x) {
        const float z = z_[x];
        if (!(view.surface_m.ptr<float>(y)[x] > 0 && z > DepthView::kSurelyMeasuredM &&
              z < CellProjection::kBeyond))
          continue;
        const std::size_t cell = static_cast<std::size_t>(cell_[x]);
        const cv::Point at(cell_[x] % cells.width, cell_[x] / cells.width);
        if (!view_.contains(at)) continue;
        const bool hole = cells.depth_m[cell] < 0;
        const float behind_m = z - cells.depth_m[cell];
        if (!hole && !(behind_m * behind_m < least_step2_[x])) continue;
        const float now = gray(at);
        pairs_.push_back({cell, hole, now - darkest_.ptr<uchar>(y)[x],
                          now - brightest_.ptr<uchar>(y)[x], now - view.gray.ptr<uchar>(y)[x]});
      }
    }
  }

  // The value that a share of them do not exceed.
  static float share_of(std::vector<float>& values, double share) {
    const auto it =
        values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size()));
    std::nth_element(values.begin(), it, values.end());
    return *it;
  }

  bool is_near(const DepthCells& cells, const std::vector<cv::Point>& hole, double timestamp) {
    const cv::Rect inner(view_.x + 1, view_.y + 1, view_.width - 2, view_.height - 2);
    int judged = 0, changed = 0, at_border = 0, found_before = 0;
    for (const cv::Point& p : hole) {
      const std::size_t i = cells.index(p.x, p.y);
      if (judged_[i] >= kFewestViews) ++judged, changed += 2 * changed_[i] > judged_[i];
      at_border += !inner.contains(p), found_before += last_[i] != Found::kNothing;
    }
    const int n = static_cast<int>(hole.size());
    if (judged < kJudged * n) return 2 * found_before > n && timestamp - judged_s_ < kFollowedS;
    // Who is so close is cut off by the border, over more than the side of a square as large.
    const bool near = changed > kChanged * judged && at_border * at_border > n;
    if (near) judged_s_ = timestamp;
    return near;
  }

  // Adds the cells of a hole, and what is measured of the same body: connected, not farther than
  // what may be too near. A torn cell does not lead to another one.
  void grow(const DepthCells& cells, const cv::Mat_<uchar>& gray, const CellLabels& labels,
            const std::vector<cv::Point>& hole) {
    queue_ = hole;
    const auto body_or_room = [&](const cv::Point& p) {
      return looks_as_expected(cells, gray, p) ? Found::kRoom : Found::kBody;
    };
    for (const cv::Point& p : queue_) found_[cells.index(p.x, p.y)] = body_or_room(p);
    const cv::Rect image(0, 0, cells.width, cells.height);
    for (std::size_t k = 0; k < queue_.size(); ++k) {
      const cv::Point p = queue_[k];
      const bool torn = cells.depth_m[cells.index(p.x, p.y)] == 0;
      for (const auto& next : DepthCells::kNext) {
        const cv::Point q(p.x + next[0], p.y + next[1]);
        if (!image.contains(q)) continue;
        const std::size_t j = cells.index(q.x, q.y);
        const float z = cells.depth_m[j];
        if (found_[j] != Found::kNothing || z < 0 || z > DepthView::kSurelyMeasuredM ||
            (torn && z == 0) || (!labels.empty() && labels[j] == CellLabel::kStatic))
          continue;
        found_[j] = z > 0 ? Found::kBody : body_or_room(q);
        queue_.push_back(q);
      }
    }
  }

  // Whether the pattern around a cell is the one that was there before: there the image shows the
  // room. Depth, taken at another moment and from another place, has its hole beside the body.
  bool looks_as_expected(const DepthCells& cells, const cv::Mat_<uchar>& gray,
                         const cv::Point& p) const {
    const cv::Rect image(0, 0, cells.width, cells.height);
    const cv::Rect window =
        cv::Rect(p.x - kPattern, p.y - kPattern, 2 * kPattern + 1, 2 * kPattern + 1) & image;
    float n = 0, a = 0, b = 0, aa = 0, bb = 0, ab = 0;
    for (int y = window.y; y < window.br().y; ++y)
      for (int x = window.x; x < window.br().x; ++x) {
        const float then = expected_[cells.index(x, y)], now = gray(y, x);
        if (then == kUnknown) continue;
        ++n, a += then, b += now, aa += then * then, bb += now * now, ab += then * now;
      }
    if (n < kFewestPattern) return false;
    const float of_then = aa - a * a / n, of_now = bb - b * b / n, both = ab - a * b / n;
    const float least = n * kLeastContrast * kLeastContrast;
    return of_then > least && of_now > least && both > 0 &&
           both * both > kAlike * kAlike * of_then * of_now;
  }

  // What was found goes on into the margin that is never measured.
  void mark(const DepthCells& cells, CellLabels& labels) const {
    if (labels.empty()) labels.reset(cells.block_px, cells.width, cells.height);
    for (int y = 0; y < cells.height; ++y)
      for (int x = 0; x < cells.width; ++x) {
        const cv::Point inside(std::clamp(x, view_.x, view_.br().x - 1),
                               std::clamp(y, view_.y, view_.br().y - 1));
        if (found_[cells.index(inside.x, inside.y)] == Found::kBody &&
            std::max(std::abs(x - inside.x), std::abs(y - inside.y)) <= kMarginCells)
          labels.set_near(x, y);
      }
  }

  SensorModel sensor_;
  cv::Rect view_;                    // where depth is measured at all, cells
  std::vector<Found> found_, last_;  // of this frame and the one before, by cell
  double judged_s_ = -std::numeric_limits<double>::infinity();
  // Scratch.
  std::vector<const DepthKeyView*> views_;
  std::vector<int> judged_, changed_;  // views, by cell
  std::vector<Pair> pairs_;
  std::vector<float> off_, expected_;  // gray levels; the latter by cell
  cv::Mat darkest_, brightest_;
  std::vector<int> cell_;
  std::vector<float> z_, least_step2_;
  std::vector<cv::Point> queue_;  // see grow()
  DepthHoles holes_;
};

}  // namespace stillpoint
