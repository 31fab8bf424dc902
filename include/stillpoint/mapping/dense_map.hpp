// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <string>
#include <unordered_map>
#include <vector>

#include "stillpoint/core/camera.hpp"
#include "stillpoint/core/colored_point.hpp"
#include "stillpoint/core/distortion.hpp"
#include "stillpoint/core/error.hpp"
#include "stillpoint/core/frame.hpp"
#include "stillpoint/core/mask.hpp"
#include "stillpoint/core/voxel_grid.hpp"

namespace stillpoint {

/// Colored point cloud of the static world, one point per occupied voxel.
///
/// Integrates the static pixels of frames with known poses. Pixels in the mask, out of range or on
/// a depth edge stay out. A voxel that two later frames see clearly through, with none between that
/// hits it, is removed: so what moved and was not masked goes too. Memory is bounded: over
/// `max_voxels`, those seen by the fewest frames, then the oldest, go first. The same calls give
/// the same map. One thread at a time. integrate() costs O(pixels / stride^2 + voxels).
class DenseMap {
 public:
  struct Settings {
    double voxel_m = 0.02;
    /// Every n-th pixel of every n-th row.
    int stride_px = 2;
    double min_depth_m = 0.3, max_depth_m = 5;
    /// A pixel whose neighbors at stride differ by more than this share of its depth is an edge.
    double edge_ratio = 0.04;
    bool carve = true;
    /// A voxel is seen through when the depth lies this far behind it: a fixed part, and one that
    /// grows with the square of the depth like a structured-light camera's noise.
    double carve_margin_m = 0.06, carve_margin_per_m = 0.02;
    /// So many frames must see through a voxel, with none that hits it between, to remove it.
    int carve_frames = 2;
    std::size_t max_voxels = 2000000;
  };

  DenseMap() : DenseMap(Settings()) {}

  /// Throws Error for settings that make no sense.
  explicit DenseMap(const Settings& settings) : settings_(settings), grid_(settings.voxel_m) {
    const auto require = [](bool condition, const char* what) {
      detail::check(condition, [&] { return "DenseMap settings: expected " + std::string(what); });
    };
    require(settings.voxel_m >= 1e-4 && settings.voxel_m <= 1e3, "voxel_m of 1e-4 to 1e3");
    require(settings.stride_px > 0, "stride_px > 0");
    require(settings.max_voxels > 0, "max_voxels > 0");
    require(settings.min_depth_m >= 0 && settings.max_depth_m > settings.min_depth_m,
            "0 <= min_depth_m < max_depth_m");
    require(settings.edge_ratio >= 0, "edge_ratio >= 0");
    require(settings.carve_margin_m >= 0, "carve_margin_m >= 0");
    require(settings.carve_margin_per_m >= 0, "carve_margin_per_m >= 0");
  }

  /// Adds a frame taken with `camera` (distorted or not) from `T_world_camera`. `mask.image` may be
  /// empty: nothing is dynamic. A frame without depth changes nothing. Throws Error for a frame,
  /// mask or camera that breaks its own description, and for a pose that is not finite or further
  /// than 2^19 voxels from the origin.
  void integrate(const RgbdFrame& frame, const Camera& camera, const DynamicMask& mask,
                 const Eigen::Isometry3d& T_world_camera) {
    check_frame(frame, camera);
    check_camera("DenseMap::integrate", camera);
    detail::check(mask.image.empty() ||
                      (mask.image.type() == CV_8UC1 && mask.image.size() == frame.color.size()),
                  [&] {
                    return "DenseMap::integrate: expected a CV_8UC1 mask of the frame's size " +
                           detail::size_text(frame.color) + ", found " +
                           detail::type_text(mask.image) + " " + detail::size_text(mask.image);
                  });
    grid_.check_pose("DenseMap::integrate", T_world_camera);
    if (frame.depth.empty()) return;
    ++frames_;
    if (settings_.carve) carve(frame, camera, T_world_camera.inverse());
    prepare_rays(camera, frame.color.size());
    const int s = settings_.stride_px;
    std::size_t ray = 0;
    for (int y = s; y < frame.color.rows - s; y += s)
      for (int x = s; x < frame.color.cols - s; x += s, ++ray) {
        if (!mask.image.empty() && mask.image.at<uchar>(y, x)) continue;
        const float z = depth_m_at(frame, x, y);
        if (!(z >= settings_.min_depth_m && z <= settings_.max_depth_m)) continue;
        if (on_edge(frame, x, y, z)) continue;
        if (!rays_[ray].allFinite()) continue;  // the lens cannot see this pixel
        const Eigen::Vector3d p(rays_[ray].x() * z, rays_[ray].y() * z, z);
        add((T_world_camera * p).cast<float>(), color_at(frame, x, y));
      }
    if (voxels_.size() > settings_.max_voxels) shrink();
  }

  /// The voxels that at least `min_count` frames saw, in order of first sight. O(n log n).
  std::vector<ColoredPoint> points(std::uint32_t min_count = 1) const {
    std::vector<Voxel> seen;
    for (const Voxel& v : voxels_)
      if (v.frames >= min_count) seen.push_back(v);
    std::sort(seen.begin(), seen.end(),
              [](const Voxel& a, const Voxel& b) { return a.number < b.number; });
    std::vector<ColoredPoint> points;
    points.reserve(seen.size());
    for (const Voxel& v : seen) {
      ColoredPoint p;
      p.position = v.position;
      for (int c = 0; c < 3; ++c) p.bgr[c] = cv::saturate_cast<uchar>(v.color[c]);
      p.count = v.frames;
      points.push_back(p);
    }
    return points;
  }

  std::size_t size() const { return voxels_.size(); }
  /// Voxels removed so far because later frames saw through them.
  std::size_t carved() const { return carved_; }
  const Settings& settings() const { return settings_; }

  void clear() {
    voxels_.clear();
    index_.clear();
    frames_ = 0;
    carved_ = 0;
  }

 private:
  struct Voxel {
    std::uint64_t key;
    Eigen::Vector3f position;
    cv::Vec3f color;
    std::uint32_t samples, frames, last_frame;
    std::uint32_t seen_through;
    std::uint64_t number;  // in order of first sight
  };

  static cv::Vec3f color_at(const RgbdFrame& frame, int x, int y) {
    if (frame.color.channels() == 3) return cv::Vec3f(frame.color.at<cv::Vec3b>(y, x));
    const float v = frame.color.at<uchar>(y, x);
    return {v, v, v};
  }

  bool on_edge(const RgbdFrame& frame, int x, int y, float z) const {
    const int s = settings_.stride_px;
    const auto limit = static_cast<float>(settings_.edge_ratio) * z;
    const int dx[] = {s, -s, 0, 0}, dy[] = {0, 0, s, -s};
    for (int i = 0; i < 4; ++i) {
      const float d = depth_m_at(frame, x + dx[i], y + dy[i]);
      if (!(d > 0) || std::abs(d - z) > limit) return true;
    }
    return false;
  }

  void add(const Eigen::Vector3f& p, const cv::Vec3f& color) {
    const auto [entry, fresh] =
        index_.try_emplace(grid_.key(p.cast<double>()), static_cast<std::uint32_t>(voxels_.size()));
    if (fresh) {
      voxels_.push_back({entry->first, p, color, 1, 1, frames_, 0, next_number_++});
      return;
    }
    Voxel& v = voxels_[entry->second];
    // The mean moves on slowly for ever, so that old and new light mix.
    v.samples = std::min<std::uint32_t>(v.samples + 1, 1000);
    const float share = 1.0f / static_cast<float>(v.samples);
    v.position += (p - v.position) * share;
    v.color += (color - v.color) * share;
    v.seen_through = 0;
    if (v.last_frame != frames_) ++v.frames, v.last_frame = frames_;
  }

  // Counts the frame against every voxel that it sees through, and removes those that had enough.
  void carve(const RgbdFrame& frame, const Camera& camera,
             const Eigen::Isometry3d& T_camera_world) {
    const Eigen::Isometry3f T = T_camera_world.cast<float>();
    const cv::Size size = frame.color.size();
    const auto enough = static_cast<std::uint32_t>(std::max(1, settings_.carve_frames));
    for (std::size_t i = 0; i < voxels_.size();) {
      if (sees_through(frame, camera, T * voxels_[i].position, size)) ++voxels_[i].seen_through;
      if (voxels_[i].seen_through < enough) {
        ++i;
        continue;
      }
      // The last one takes its place.
      index_.erase(voxels_[i].key);
      ++carved_;
      if (i + 1 < voxels_.size()) {
        voxels_[i] = voxels_.back();
        index_[voxels_[i].key] = static_cast<std::uint32_t>(i);
      }
      voxels_.pop_back();
    }
  }

  bool sees_through(const RgbdFrame& frame, const Camera& camera, const Eigen::Vector3f& p,
                    cv::Size size) const {
    if (p.z() < settings_.min_depth_m) return false;
    Eigen::Vector2d pixel = camera.project(p.cast<double>());
    // Far outside, the lens polynomial folds back into the image: look no further than its rim.
    if (pixel.x() < -0.25 * size.width || pixel.x() > 1.25 * size.width ||
        pixel.y() < -0.25 * size.height || pixel.y() > 1.25 * size.height)
      return false;
    pixel = distort_pixel(camera, pixel);
    const int x = static_cast<int>(std::lround(pixel.x()));
    const int y = static_cast<int>(std::lround(pixel.y()));
    if (x < 1 || y < 1 || x >= size.width - 1 || y >= size.height - 1) return false;
    const double behind =
        p.z() + settings_.carve_margin_m + settings_.carve_margin_per_m * p.z() * p.z();
    // All around, so that neither an edge nor a pixel's pose error carves what is there.
    for (int dy = -1; dy <= 1; ++dy)
      for (int dx = -1; dx <= 1; ++dx)
        if (!(depth_m_at(frame, x + dx, y + dy) > behind)) return false;
    return true;
  }

  void prepare_rays(const Camera& camera, cv::Size size) {
    const std::array<double, 11> id = {camera.fx,
                                       camera.fy,
                                       camera.cx,
                                       camera.cy,
                                       camera.k1,
                                       camera.k2,
                                       camera.p1,
                                       camera.p2,
                                       camera.k3,
                                       static_cast<double>(size.width),
                                       static_cast<double>(size.height)};
    if (!rays_.empty() && id == rays_id_) return;
    rays_id_ = id;
    rays_.clear();
    const int s = settings_.stride_px;
    for (int y = s; y < size.height - s; y += s)
      for (int x = s; x < size.width - s; x += s) {
        const Eigen::Vector2d flat = undistort_pixel(camera, {x, y});
        rays_.emplace_back((flat.x() - camera.cx) / camera.fx, (flat.y() - camera.cy) / camera.fy);
      }
  }

  // Drops a tenth of the limit at once, so that not every frame sorts.
  void shrink() {
    const std::size_t keep = std::max<std::size_t>(1, settings_.max_voxels / 10 * 9);
    const auto better = [](const Voxel& a, const Voxel& b) {
      if (a.frames != b.frames) return a.frames > b.frames;
      if (a.last_frame != b.last_frame) return a.last_frame > b.last_frame;
      return a.key < b.key;
    };
    std::vector<Voxel> sorted = voxels_;
    const auto last = sorted.begin() + static_cast<std::ptrdiff_t>(keep);
    std::nth_element(sorted.begin(), last, sorted.end(), better);
    const Voxel limit = *last;
    std::size_t n = 0;
    for (const Voxel& v : voxels_)
      if (better(v, limit)) voxels_[n++] = v;
    voxels_.resize(n);
    index_.clear();
    for (std::size_t i = 0; i < n; ++i) index_[voxels_[i].key] = static_cast<std::uint32_t>(i);
  }

  Settings settings_;
  detail::VoxelGrid grid_;
  std::vector<Voxel> voxels_;
  std::unordered_map<std::uint64_t, std::uint32_t> index_;  // only ever asked, never walked
  std::vector<Eigen::Vector2d> rays_;
  std::array<double, 11> rays_id_{};
  std::uint32_t frames_ = 0;
  std::uint64_t next_number_ = 0;
  std::size_t carved_ = 0;
};

}  // namespace stillpoint
