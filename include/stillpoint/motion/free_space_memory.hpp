// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "stillpoint/motion/coarse_frame.hpp"

namespace stillpoint {

/// What earlier frames say of a cell of the current one.
enum class CellEvidence : std::uint8_t {
  kUnknown,  ///< no depth, or never seen from where it could be judged
  kStatic,   ///< the same surface was there before
  kMoved     ///< earlier frames looked through the place where it is now
};

/// The coarse depth of the last frames with their poses, and the question whether a place was free
/// or filled when they saw it.
class FreeSpaceMemory {
 public:
  bool empty() const { return count_ == 0; }
  void clear() { count_ = 0, next_ = 0; }

  /// Adds a frame; `dynamic`: one byte per cell, not 0 = taken for dynamic in it. O(cells).
  void add(double timestamp, const Eigen::Isometry3d& T_world_camera, const CoarseFrame& frame,
           const std::vector<std::uint8_t>& dynamic) {
    if (views_.size() < kCapacity) views_.resize(kCapacity);
    View& view = views_[next_];
    newest_ = next_;
    next_ = (next_ + 1) % kCapacity;
    count_ = std::min(count_ + 1, kCapacity);
    view.timestamp = timestamp;
    view.T_world_camera = T_world_camera;
    view.frame = frame;
    view.dynamic = dynamic;
    view.free_to_m.assign(frame.size(), 0);
    for (int y = 1; y + 1 < frame.height; ++y)
      for (int x = 1; x + 1 < frame.width; ++x) {
        // A place is free as far as all cells around saw through it.
        float nearest = 1e9f;
        for (int dy = -1; dy <= 1; ++dy)
          for (int dx = -1; dx <= 1; ++dx)
            nearest = std::min(nearest, frame.depth_m[frame.index(x + dx, y + dy)]);
        view.free_to_m[frame.index(x, y)] = nearest;
      }
  }

  /// Moves the newest frame, once its pose is known better.
  void set_newest_pose(const Eigen::Isometry3d& T_world_camera) {
    if (count_ > 0) views_[newest_].T_world_camera = T_world_camera;
  }

  /// Judges the cells of a new frame against frames of several ages. O(cells x 6).
  void judge(double timestamp, const Eigen::Isometry3d& T_world_camera, const CoarseFrame& frame,
             std::vector<CellEvidence>& evidence) {
    evidence.assign(frame.size(), CellEvidence::kUnknown);
    if (count_ == 0) return;
    score_.assign(frame.size(), 0);
    std::size_t last = kCapacity;
    static constexpr double kAgesS[] = {1.6, 1.0, 0.6, 0.35, 0.2, 0.1};
    for (const double age : kAgesS) {
      std::size_t best = newest_;
      for (std::size_t i = 0; i < count_; ++i)
        if (std::abs(timestamp - views_[i].timestamp - age) <
            std::abs(timestamp - views_[best].timestamp - age))
          best = i;
      if (best == last) continue;
      last = best;
      compare(views_[best], T_world_camera, frame);
    }
    for (std::size_t i = 0; i < frame.size(); ++i)
      if (score_[i] != 0)
        evidence[i] = score_[i] > 1   ? CellEvidence::kMoved
                      : score_[i] < 0 ? CellEvidence::kStatic
                                      : CellEvidence::kUnknown;
  }

 private:
  static constexpr std::size_t kCapacity = 52;  // 1.7 s at 30 Hz

  struct View {
    double timestamp = 0;
    Eigen::Isometry3d T_world_camera = Eigen::Isometry3d::Identity();
    CoarseFrame frame;
    std::vector<float> free_to_m;       // 0: not known
    std::vector<std::uint8_t> dynamic;  // not 0: taken for dynamic
  };

  // Seen free counts two, seen filled by the same surface counts minus one.
  void compare(const View& view, const Eigen::Isometry3d& T_world_camera,
               const CoarseFrame& frame) {
    const Eigen::Isometry3d T = view.T_world_camera.inverse() * T_world_camera;
    const Eigen::Matrix3f R = T.linear().cast<float>();
    const Eigen::Vector3f t = T.translation().cast<float>();
    const CoarseFrame& then = view.frame;
    const float right = static_cast<float>(then.width) - 1.5f;
    const float bottom = static_cast<float>(then.height) - 1.5f;
    for (int y = 0; y < frame.height; ++y) {
      const float ry = (static_cast<float>(y) - frame.cy) / frame.fy;
      for (int x = 0; x < frame.width; ++x) {
        const std::size_t i = frame.index(x, y);
        const float z = frame.depth_m[i];
        if (z <= 0) continue;
        const float rx = (static_cast<float>(x) - frame.cx) / frame.fx;
        const Eigen::Vector3f Y = R * Eigen::Vector3f(rx * z, ry * z, z) + t;
        if (Y.z() < 0.3f) continue;
        const float u = then.fx * Y.x() / Y.z() + then.cx, v = then.fy * Y.y() / Y.z() + then.cy;
        if (!(u >= 0.5f && v >= 0.5f && u < right && v < bottom)) continue;
        const std::size_t j = then.index(static_cast<int>(u + 0.5f), static_cast<int>(v + 0.5f));
        const float slack = 0.03f + 0.012f * Y.z() * Y.z();  // noise and rounding of the pose
        if (view.free_to_m[j] > Y.z() + slack + 0.02f)
          score_[i] = static_cast<signed char>(score_[i] + 2);
        else if (!view.dynamic[j] && then.depth_m[j] > 0 &&
                 std::abs(then.depth_m[j] - Y.z()) < slack && score_[i] <= 0)
          score_[i] = static_cast<signed char>(score_[i] - 1);
      }
    }
  }

  std::vector<View> views_;
  std::size_t count_ = 0, next_ = 0, newest_ = 0;
  std::vector<signed char> score_;
};

}  // namespace stillpoint
