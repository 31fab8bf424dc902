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
      if (!p.allFinite()) continue;  // the lens cannot see this pixel
      FrameKeypoint f;
      f.x = static_cast<float>(p.x()), f.y = static_cast<float>(p.y());
      f.octave = k.octave;
      f.scale = static_cast<float>(std::pow(scale_factor, k.octave));
      f.depth_m = trusted_depth(frame, k.pt, settings);
      keypoints.push_back(f);
      descriptors.push_back(features.descriptors[i]);
    }
    columns_ = static_cast<int>(width_ / kCell) + 1, rows_ = static_cast<int>(height_ / kCell) + 1;
    cells_.resize(static_cast<std::size_t>(columns_ * rows_));
    for (std::size_t i = 0; i < keypoints.size(); ++i)
      cells_[static_cast<std::size_t>(row(keypoints[i].y) * columns_ + column(keypoints[i].x))]
          .push_back(i);
  }

  std::size_t size() const { return keypoints.size(); }

  /// Lists the keypoints within `radius` pixels (each axis) of (x, y) on the levels min_octave to
  /// max_octave, in ascending order of cells. The list is cleared first.
  void find(double x, double y, double radius, int min_octave, int max_octave,
            std::vector<std::size_t>& found) const {
    found.clear();
    if (cells_.empty()) return;
    const int c1 = column(x + radius), r1 = row(y + radius);
    for (int r = row(y - radius); r <= r1; ++r)
      for (int c = column(x - radius); c <= c1; ++c)
        for (const std::size_t i : cells_[static_cast<std::size_t>(r * columns_ + c)]) {
          const FrameKeypoint& k = keypoints[i];
          if (k.octave >= min_octave && k.octave <= max_octave && std::abs(k.x - x) <= radius &&
              std::abs(k.y - y) <= radius)
            found.push_back(i);
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

  int width_ = 0, height_ = 0, columns_ = 0, rows_ = 0;
  std::vector<std::vector<std::size_t>> cells_;  // the keypoints in each
};

}  // namespace stillpoint::rgbd_slam
