// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <opencv2/core.hpp>
#include <string>
#include <unordered_set>
#include <vector>

#include "stillpoint/core/camera.hpp"
#include "stillpoint/core/colored_point.hpp"
#include "stillpoint/core/distortion.hpp"
#include "stillpoint/core/error.hpp"
#include "stillpoint/core/frame.hpp"
#include "stillpoint/core/mask_functions.hpp"
#include "stillpoint/core/voxel_grid.hpp"

namespace stillpoint {

/// How many points of a map are ghosts of people.
struct GhostCounts {
  std::size_t points = 0, ghosts = 0;
  /// ghosts / points; NaN for an empty map.
  double share() const {
    return points ? static_cast<double>(ghosts) / static_cast<double>(points)
                  : std::numeric_limits<double>::quiet_NaN();
  }
};

/// The space where people were and nothing static is, by true masks, measured depth and true poses:
/// what of a map lies there is a ghost.
///
/// Space is divided into cells. A point is a ghost if its cell or one beside it held a person in
/// any frame, and neither it nor one beside it ever held something static (the floor under a foot
/// is no ghost). Pixels on depth edges count for neither, nor do static ones near a mask, whose
/// depth may be a mixture of both.
class GhostCounter {
 public:
  struct Settings {
    double cell_m = 0.05;
    /// Every n-th pixel of every n-th row.
    int stride_px = 2;
    double max_depth_m = 6;
    /// Neighbors that differ by more than this share of the depth make an edge.
    double edge_ratio = 0.04;
    /// Static pixels nearer to a mask than this do not count.
    int mask_margin_px = 6;
  };

  GhostCounter() : GhostCounter(Settings()) {}

  /// Throws Error for settings that make no sense.
  explicit GhostCounter(const Settings& settings) : settings_(settings), grid_(settings.cell_m) {
    detail::check(settings.cell_m > 0 && settings.stride_px > 0 && settings.max_depth_m > 0, [] {
      return std::string(
          "GhostCounter settings: expected cell_m, stride_px and max_depth_m above 0");
    });
  }

  /// Adds a frame with its true people mask (H x W, CV_8UC1, non-zero = person, not dilated) and
  /// true pose. Throws Error for inputs that do not fit each other, or a pose that is
  /// not finite or further than 2^19 cells from the origin. O(pixels / stride^2).
  void add(const RgbdFrame& frame, const Camera& camera, const cv::Mat& people,
           const Eigen::Isometry3d& T_world_camera) {
    check_frame(frame, camera);
    detail::check(camera.valid(), [] {
      return std::string("GhostCounter::add: expected a camera with focal lengths, found none");
    });
    detail::check(people.type() == CV_8UC1 && people.size() == frame.color.size(), [&] {
      return "GhostCounter::add: people: expected CV_8UC1 " + detail::size_text(frame.color) +
             ", found " + detail::type_text(people) + " " + detail::size_text(people);
    });
    grid_.check_pose("GhostCounter::add", T_world_camera);
    if (frame.depth.empty()) return;
    const cv::Mat clear = feature_mask(people, std::clamp(settings_.mask_margin_px, 0, 1000));
    const int s = settings_.stride_px;
    for (int y = s; y < people.rows - s; y += s)
      for (int x = s; x < people.cols - s; x += s) {
        const bool person = people.at<uchar>(y, x) != 0;
        if (!person && clear.at<uchar>(y, x) == 0) continue;
        const auto z = static_cast<double>(depth_m_at(frame, x, y));
        if (!(z > 0 && z <= settings_.max_depth_m) || on_edge(frame, x, y, z)) continue;
        const Eigen::Vector2d flat =
            undistort_pixel(camera, {static_cast<double>(x), static_cast<double>(y)});
        if (!flat.allFinite()) continue;  // the lens cannot see this pixel
        const Eigen::Vector3d p = T_world_camera * camera.unproject(flat.x(), flat.y(), z);
        (person ? person_ : static_).insert(grid_.key(p));
      }
  }

  /// Counts the ghosts among a map's points; `T_truth_map` maps them into the world of the true
  /// poses (align_poses()). O(points).
  GhostCounts count(const std::vector<ColoredPoint>& points,
                    const Eigen::Isometry3d& T_truth_map) const {
    GhostCounts counts;
    counts.points = points.size();
    for (const ColoredPoint& point : points) {
      const Eigen::Vector3d p = T_truth_map * point.position.cast<double>();
      counts.ghosts += near(person_, p) && !near(static_, p);
    }
    return counts;
  }

 private:
  using Cells = std::unordered_set<std::uint64_t>;

  bool near(const Cells& cells, const Eigen::Vector3d& p) const {
    for (int dz = -1; dz <= 1; ++dz)
      for (int dy = -1; dy <= 1; ++dy)
        for (int dx = -1; dx <= 1; ++dx)
          if (cells.count(grid_.key(p, {dx, dy, dz}))) return true;
    return false;
  }

  bool on_edge(const RgbdFrame& frame, int x, int y, double z) const {
    const int dx[] = {1, -1, 0, 0}, dy[] = {0, 0, 1, -1};
    for (int i = 0; i < 4; ++i) {
      const auto d = static_cast<double>(depth_m_at(frame, x + dx[i], y + dy[i]));
      if (!(d > 0) || std::abs(d - z) > settings_.edge_ratio * z) return true;
    }
    return false;
  }

  Settings settings_;
  detail::VoxelGrid grid_;
  Cells person_, static_;
};

}  // namespace stillpoint
