// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "stillpoint/backends/rgbd_slam/features.hpp"
#include "stillpoint/core/distortion.hpp"
#include "stillpoint/core/frame.hpp"

namespace stillpoint::rgbd_slam {

/// One keypoint as geometry sees it.
struct FrameKeypoint {
  /// Undistorted pixel.
  float x = 0, y = 0;
  /// Metres; 0 when there is no trustworthy measurement.
  float depth_m = 0;
  /// Degrees.
  float angle = 0;
  /// Pyramid level, and its scale (1 on level 0).
  int octave = 0;
  float scale = 1;
  /// True when (x, y) was refined on the image itself.
  bool refined = false;

  Eigen::Vector2d pixel() const { return {x, y}; }
};

/// The kept keypoints of one frame: undistorted, with depth, and found by place in O(1).
class KeypointFrame {
 public:
  struct Settings {
    /// Depth outside of this range is not used.
    double min_depth_m = 0.3, max_depth_m = 8;
    /// A keypoint whose 3x3 pixels differ in depth by more than this share of it lies on an edge,
    /// where a pixel's error is metres: it is used without depth.
    double edge_ratio = 0.05;
  };

  KeypointFrame() = default;

  /// Takes the keypoints `kept` (indices) out of `features`. O(kept).
  KeypointFrame(const RgbdFrame& frame, const Camera& camera, const Features& features,
                const std::vector<int>& kept, double scale_factor, const Settings& settings)
      : timestamp(frame.timestamp), width_(frame.color.cols), height_(frame.color.rows) {
    keypoints.reserve(kept.size());
    descriptors.reserve(kept.size());
    for (const int index : kept) {
      const auto i = static_cast<std::size_t>(index);
      const cv::KeyPoint& k = features.keypoints[i];
      const Eigen::Vector2d p = undistort_pixel(camera, {k.pt.x, k.pt.y});
      FrameKeypoint f;
      f.x = static_cast<float>(p.x()), f.y = static_cast<float>(p.y());
      f.octave = k.octave, f.angle = k.angle;
      f.scale = static_cast<float>(std::pow(scale_factor, k.octave));
      f.depth_m = trusted_depth(frame, k.pt, settings);
      keypoints.push_back(f);
      descriptors.push_back(features.descriptors[i]);
    }
    build_grid();
  }

  std::size_t size() const { return keypoints.size(); }

  /// Lists the keypoints within `radius` pixels (each axis) of (x, y) on the levels min_octave to
  /// max_octave, in ascending order of cells. The list is cleared first.
  void find(double x, double y, double radius, int min_octave, int max_octave,
            std::vector<int>& found) const {
    found.clear();
    if (starts_.empty()) return;
    const int c0 = column(x - radius), c1 = column(x + radius);
    const int r0 = row(y - radius), r1 = row(y + radius);
    for (int r = r0; r <= r1; ++r)
      for (int c = c0; c <= c1; ++c) {
        const auto cell = static_cast<std::size_t>(r * columns_ + c);
        for (int i = starts_[cell]; i < starts_[cell + 1]; ++i) {
          const int index = order_[static_cast<std::size_t>(i)];
          const FrameKeypoint& k = keypoints[static_cast<std::size_t>(index)];
          if (k.octave < min_octave || k.octave > max_octave) continue;
          if (std::abs(k.x - x) > radius || std::abs(k.y - y) > radius) continue;
          found.push_back(index);
        }
      }
  }

  /// True for a pixel inside the image.
  bool contains(const Eigen::Vector2d& p) const {
    return p.x() >= 0 && p.y() >= 0 && p.x() < width_ && p.y() < height_;
  }

  double timestamp = 0;
  std::vector<FrameKeypoint> keypoints;
  std::vector<Descriptor> descriptors;

 private:
  static constexpr double kCell = 16;

  static float trusted_depth(const RgbdFrame& frame, cv::Point2f p, const Settings& settings) {
    if (frame.depth.empty()) return 0;
    const int x = static_cast<int>(std::lround(p.x)), y = static_cast<int>(std::lround(p.y));
    if (x < 1 || y < 1 || x >= frame.depth.cols - 1 || y >= frame.depth.rows - 1) return 0;
    const float z = depth_m_at(frame, x, y);
    if (z < settings.min_depth_m || z > settings.max_depth_m) return 0;
    float low = z, high = z;
    for (int dy = -1; dy <= 1; ++dy)
      for (int dx = -1; dx <= 1; ++dx) {
        const float d = depth_m_at(frame, x + dx, y + dy);
        if (d <= 0) continue;
        low = std::min(low, d), high = std::max(high, d);
      }
    return high - low > settings.edge_ratio * z ? 0 : z;
  }

  int column(double x) const {
    return std::clamp(static_cast<int>(std::floor(x / kCell)), 0, columns_ - 1);
  }
  int row(double y) const {
    return std::clamp(static_cast<int>(std::floor(y / kCell)), 0, rows_ - 1);
  }

  void build_grid() {
    columns_ = static_cast<int>(width_ / kCell) + 1;
    rows_ = static_cast<int>(height_ / kCell) + 1;
    starts_.assign(static_cast<std::size_t>(columns_ * rows_) + 1, 0);
    const auto cell_of = [&](const FrameKeypoint& k) {
      return static_cast<std::size_t>(row(k.y) * columns_ + column(k.x));
    };
    for (const FrameKeypoint& k : keypoints) ++starts_[cell_of(k) + 1];
    for (std::size_t i = 1; i < starts_.size(); ++i) starts_[i] += starts_[i - 1];
    order_.resize(keypoints.size());
    std::vector<int> next(starts_.begin(), starts_.end() - 1);
    for (std::size_t i = 0; i < keypoints.size(); ++i)
      order_[static_cast<std::size_t>(next[cell_of(keypoints[i])]++)] = static_cast<int>(i);
  }

  int width_ = 0, height_ = 0, columns_ = 0, rows_ = 0;
  std::vector<int> starts_, order_;
};

}  // namespace stillpoint::rgbd_slam
