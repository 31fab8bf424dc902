// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "stillpoint/core/config.hpp"
#include "stillpoint/core/depth_view.hpp"
#include "stillpoint/core/frame_context.hpp"
#include "stillpoint/motion/corner_score.hpp"
#include "stillpoint/motion/patch_shift.hpp"

namespace stillpoint::detail {

/// By a whole factor; a rest of rows or columns is left out. `to` never shares memory with `from`.
inline void shrink(const cv::Mat& from, int factor, cv::Mat& to) {
  const cv::Size size(from.cols / factor, from.rows / factor);
  if (factor == 1)
    from.copyTo(to);
  else
    cv::resize(from(cv::Rect(cv::Point(), size * factor)), to, size, 0, 0, cv::INTER_AREA);
}

/// x, y: fine pixels; depth in metres.
struct Corner {
  int x, y;
  float depth_m, score;
  bool dynamic = false;  ///< on what was taken for dynamic
};

/// A frame in two sizes and its corners: fine, about 320 pixels in a row, so that all cameras are
/// treated alike, and coarse, half of that.
class CornerImage {
 public:
  /// What is nearer to the camera is not seen.
  static constexpr float kLeastDepthM = 0.2f;

  /// Pixels of the frame per fine one.
  int scale = 2;
  /// CV_32FC1: read many times.
  cv::Mat fine, coarse;
  std::vector<Corner> corners;
  /// Of the frame, for its undistorted pixels.
  float fx = 1, fy = 1, cx = 0, cy = 0;
  bool empty = true;

  cv::Size size() const { return frame_size_; }
  /// The coarse image in bytes.
  const cv::Mat& small_gray() const {
    static const cv::Mat none;
    return empty ? none : coarse_bytes_;
  }

  /// Where a fine pixel's centre is in the frame.
  float frame_px(int fine_px) const {
    const float s = static_cast<float>(scale);
    return s * static_cast<float>(fine_px) + 0.5f * (s - 1);
  }

  /// Where a point before the camera is in the undistorted frame.
  Eigen::Vector2f project(const Eigen::Vector3f& q) const {
    return {fx * q.x() / q.z() + cx, fy * q.y() / q.z() + cy};
  }

  /// O(pixels).
  void set(const FrameContext& context) {
    const DepthView& view = context.depth;
    empty = view.empty();
    corners.clear(), unmeasured_.clear();
    if (empty) return;
    frame_size_ = context.size();
    scale = std::max(1, (frame_size_.width + 160) / 320);
    empty = std::min(frame_size_.width, frame_size_.height) < 2 * kRim * scale;  // nothing in it
    if (empty) return;
    shrink(context.gray(), scale, fine_bytes_);
    shrink(fine_bytes_, 2, coarse_bytes_);
    fine_bytes_.convertTo(fine, CV_32F);
    coarse_bytes_.convertTo(coarse, CV_32F);
    const Lens& lens = view.lens();
    fx = lens.fx(), fy = lens.fy(), cx = lens.cx(), cy = lens.cy();
    find_corners(view);
  }

  /// Where most corners have no depth, and a quarter of these or more lie in large holes that end
  /// at the end of the sensor's range, those are taken for far away: they tell the rotation, which
  /// else a person close by would tell. Holes of what is too close or black end elsewhere.
  /// O(corners x width).
  void add_far_corners(const DepthView& view, double max_range_m) {
    if (corners.size() >= unmeasured_.size()) return;
    const float end_m = kEndOfRange * static_cast<float>(max_range_m);
    const auto last = std::partition(unmeasured_.begin(), unmeasured_.end(),
                                     [&](const Corner& c) { return in_far_hole(view, c, end_m); });
    if (4 * (last - unmeasured_.begin()) < unmeasured_.end() - unmeasured_.begin()) return;
    std::for_each(unmeasured_.begin(), last, [](Corner& c) { c.depth_m = kFarM; });
    corners.insert(corners.end(), unmeasured_.begin(), last);
  }

  /// Keeps the strongest corners: of the static world and, behind these, of what is dynamic.
  /// O(corners).
  void keep_strongest(std::size_t most_static, std::size_t most_dynamic) {
    const auto first_dynamic =
        std::partition(corners.begin(), corners.end(), [](const Corner& c) { return !c.dynamic; });
    const auto keep = [&](auto begin, auto end, std::size_t most) {
      if (end - begin <= static_cast<std::ptrdiff_t>(most)) return end;
      const auto last = begin + static_cast<std::ptrdiff_t>(most);
      std::nth_element(begin, last, end, [](const Corner& a, const Corner& b) {
        return a.score != b.score ? a.score > b.score : a.y != b.y ? a.y < b.y : a.x < b.x;
      });
      return last;
    };
    // From the end, as erasing moves what follows.
    corners.erase(keep(first_dynamic, corners.end(), most_dynamic), corners.end());
    corners.erase(keep(corners.begin(), first_dynamic, most_static), first_dynamic);
  }

  /// Depth around a pixel; 0 where it is not measured, or an edge tears the patch on the fine
  /// image.
  float whole_depth(const DepthView& view, int u, int v) const {
    if (!is_whole(view, u, v)) return 0;
    const int step = 2 * scale;
    int sum = 0, n = 0;
    for (int y = v - step; y <= v + step; y += step)
      for (int x = u - step; x <= u + step; x += step) {
        const std::uint16_t z = view.row(y)[x];
        sum += z, n += z != 0;
      }
    return n < 5 ? 0
                 : static_cast<float>(sum) / static_cast<float>(n) * view.metres_per_unit_value();
  }

  /// Whether the depth around a pixel, `depth_m` there, goes on evenly as far as the coarse patch
  /// reaches: on a surface of any slant it falls on one side by as much as it rises on the other.
  /// What is not measured is taken to be as deep as the pixel.
  bool is_even(const DepthView& view, const cv::Point& p, float depth_m) const {
    const int reach = kFar * scale, step = 2 * scale;
    const cv::Rect patch(p.x - reach, p.y - reach, 2 * reach + 1, 2 * reach + 1);
    if ((patch & cv::Rect(cv::Point(), view.size())) != patch) return false;
    const float most_m = most_step_m(depth_m);
    const auto at = [&](int x, int y) {
      const std::uint16_t units = view.row(p.y + y)[p.x + x];
      return units == 0 ? depth_m : view.to_m(units);
    };
    for (int y = 0; y <= reach; y += step)
      for (int x = -reach; x <= reach; x += step)
        if (std::abs(at(x, y) + at(-x, -y) - 2 * depth_m) > most_m) return false;
    return true;
  }

 private:
  // How far the patch on the fine and that on the coarse image reach, fine pixels.
  static constexpr int kNear = Patch::kRadius, kFar = 2 * Patch::kRadius;
  static constexpr int kBlock = 5;                 // coarse pixels; one corner each
  static constexpr int kRim = Patch::kRadius + 2;  // coarse pixels; no corner there
  static constexpr float kMinScore = 2e-4f;
  // Of what lies beyond the range: that it is nearer moves it by less than a pixel per centimetre.
  static constexpr float kFarM = 10;
  static constexpr float kEndOfRange = 0.85f;  // as in FarHoles

  // A greater step of the depth is an edge.
  static float most_step_m(float near_m) { return 0.05f + 0.07f * near_m; }

  // Whether no edge tears the depth in the patch around a pixel.
  bool is_whole(const DepthView& view, int u, int v) const {
    const int reach = kNear * scale, step = 2 * scale;
    if (u < reach || v < reach || u + reach >= view.size().width || v + reach >= view.size().height)
      return false;
    std::uint16_t lo = 65535, hi = 0;  // lo: one less, so that 0, no measurement, is the highest
    for (int y = v - reach; y <= v + reach; y += step) {
      const std::uint16_t* row = view.row(y) + u;
      for (int x = -reach; x <= reach; x += step) {
        lo = std::min(lo, static_cast<std::uint16_t>(row[x] - 1));
        hi = std::max(hi, row[x]);
      }
      // Most patches that are torn are so before the last row.
      const float near = view.to_m(static_cast<std::uint16_t>(lo + 1));
      if (!(view.to_m(hi) - near < most_step_m(near))) return false;
    }
    return true;
  }

  void find_corners(const DepthView& view) {
    scores_.find(coarse_bytes_, score_);
    const std::size_t width = static_cast<std::size_t>(coarse.cols);
    highest_.resize(width);
    for (int y0 = kRim; y0 + kBlock + kRim <= coarse.rows; y0 += kBlock) {
      std::copy_n(score_.ptr<float>(y0), width, highest_.begin());
      for (int y = y0 + 1; y < y0 + kBlock; ++y)
        raise(score_.ptr<float>(y), width, highest_.data());
      for (int x0 = kRim; x0 + kBlock + kRim <= coarse.cols; x0 += kBlock) {
        const float* column = highest_.data() + x0;
        float most = column[0];
        for (int x = 1; x < kBlock; ++x) most = std::max(most, column[x]);
        if (!(most > kMinScore)) continue;
        Corner best = first_of_block(x0, y0, most);
        best.depth_m = whole_depth(view, scale * best.x, scale * best.y);
        if (best.depth_m > 0)
          corners.push_back(best);
        else if (view.row(scale * best.y)[scale * best.x] == 0)
          unmeasured_.push_back(best);
      }
    }
  }

  // Whether, of the first depths in the four directions, two or more, and most, are beyond `end_m`
  // and none lies within the patch on the coarse image.
  bool in_far_hole(const DepthView& view, const Corner& c, float end_m) const {
    static constexpr int kNext[4][2] = {{-1, 0}, {1, 0}, {0, -1}, {0, 1}};
    const cv::Rect image(cv::Point(), frame_size_);
    int far = 0, near = 0;
    for (const auto& next : kNext) {
      const cv::Point step = 2 * scale * cv::Point(next[0], next[1]);
      cv::Point p(scale * c.x, scale * c.y);
      int steps = 0;
      for (; p.inside(image) && view.row(p.y)[p.x] == 0; p += step) ++steps;
      if (2 * steps <= kFar) return false;
      if (p.inside(image)) ++(view.to_m(view.row(p.y)[p.x]) > end_m ? far : near);
    }
    return far >= 2 && far > near;
  }

  // Where a block of the scores reaches its highest value first.
  Corner first_of_block(int x0, int y0, float most) const {
    for (int y = y0; y < y0 + kBlock; ++y) {
      const float* row = score_.ptr<float>(y);
      for (int x = x0; x < x0 + kBlock; ++x)
        if (row[x] == most) return {2 * x, 2 * y, 0, most};
    }
    return {0, 0, 0, 0};
  }

  STILLPOINT_ROW_LOOP static void raise(const float* STILLPOINT_RESTRICT by, std::size_t n,
                                        float* STILLPOINT_RESTRICT highest) {
    for (std::size_t x = 0; x < n; ++x) highest[x] = by[x] > highest[x] ? by[x] : highest[x];
  }

  std::vector<Corner> unmeasured_;  // in holes of the depth
  cv::Size frame_size_;
  CornerScore scores_;
  cv::Mat fine_bytes_, coarse_bytes_, score_;
  std::vector<float> highest_;  // score of the columns of a row of blocks
};

}  // namespace stillpoint::detail
