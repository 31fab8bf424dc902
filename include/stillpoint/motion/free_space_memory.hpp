// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "stillpoint/core/config.hpp"
#include "stillpoint/motion/coarse_frame.hpp"
#include "stillpoint/motion/far_holes.hpp"

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
    view.width = frame.width, view.height = frame.height;
    view.fx = frame.fx, view.fy = frame.fy, view.cx = frame.cx, view.cy = frame.cy;
    // Nothing is known at the rim: it stands for all beyond.
    view.places.assign(frame.size(), {kNone, 0});
    // A place is free as far as all cells around saw through it.
    const std::size_t w = static_cast<std::size_t>(frame.width);
    nearest_.resize(w);
    const std::vector<std::uint8_t>& far = holes_.find(frame, dynamic);
    const Place hole{kHole, kSurelyInRange * holes_.range_m()};
    for (int y = 1; y + 1 < frame.height; ++y) {
      const float* z = frame.depth_m.data() + frame.index(0, y);
      const std::uint8_t* moves = dynamic.data() + frame.index(0, y);
      nearest_of_three(z - w, z, z + w, w, nearest_.data());
      Place* place = view.places.data() + frame.index(0, y);
      for (std::size_t x = 1; x + 1 < w; ++x)
        place[x] = {z[x] > 0 && !moves[x] ? z[x] : kNone,
                    std::min({nearest_[x - 1], nearest_[x], nearest_[x + 1]})};
      for (std::size_t x = 1; x + 1 < w; ++x)
        if (far[frame.index(0, y) + x] != 0) place[x] = hole;
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
    static_assert(static_cast<int>(CellEvidence::kMoved) == 2 &&
                  static_cast<int>(CellEvidence::kStatic) == 1);
    for (std::size_t i = 0; i < frame.size(); ++i)
      evidence[i] = static_cast<CellEvidence>(2 * (score_[i] > 1) + (score_[i] < 0));
  }

 private:
  static constexpr std::size_t kCapacity = 52;  // 1.7 s at 30 Hz

  static constexpr float kNone = -1e9f, kHole = -2e9f, kBeyond = 1e9f;
  static constexpr float kNearest = 0.3f;
  static constexpr float kSurelyInRange = 0.8f;
  // Sensors measure nothing close by either: so near, a hole does not tell what was there.
  static constexpr float kSurelyMeasuredM = 1;

  // One cell: depth of the static surface seen there, kNone or, beyond the sensor's range, kHole;
  // free up to a depth, 0 or less: not known.
  struct Place {
    float surface_m, free_to_m;
  };
  struct View {
    double timestamp = 0;
    Eigen::Isometry3d T_world_camera = Eigen::Isometry3d::Identity();
    int width = 0, height = 0;
    float fx = 1, fy = 1, cx = 0, cy = 0;
    std::vector<Place> places;
  };

  static void nearest_of_three(const float* a, const float* b, const float* c, std::size_t n,
                               float* STILLPOINT_RESTRICT nearest) {
    for (std::size_t i = 0; i < n; ++i) {
      const float ab = a[i] < b[i] ? a[i] : b[i];
      nearest[i] = ab < c[i] ? ab : c[i];
    }
  }

  // The cells of a row in an earlier view: the place they fall on; the depth they have there, far
  // beyond everything if they have none or lie behind; what noise and rounding of the pose may do
  // to it.
  struct Row {
    std::vector<int> place;
    std::vector<float> z, slack;
  };
  struct Projection {
    Eigen::Vector3f first, per_cell, t;  // p = (first + per_cell * x) * depth + t
    float fx, fy, cx, cy;                // half a cell added: to be rounded down
    float columns, right, bottom;
  };

  // Choices between numbers only, which become vector instructions.
  static void project(const Projection& p, const float* STILLPOINT_RESTRICT depth, std::size_t n,
                      int* STILLPOINT_RESTRICT place, float* STILLPOINT_RESTRICT z,
                      float* STILLPOINT_RESTRICT slack) {
    const float x0 = p.first.x(), y0 = p.first.y(), z0 = p.first.z();
    const float dx = p.per_cell.x(), dy = p.per_cell.y(), dz = p.per_cell.z();
    const float tx = p.t.x(), ty = p.t.y(), tz = p.t.z();
    const float fx = p.fx, fy = p.fy, cx = p.cx, cy = p.cy;
    const float columns = p.columns, right = p.right, bottom = p.bottom;
    for (std::size_t i = 0; i < n; ++i) {
      const float x = static_cast<float>(static_cast<int>(i)), d = depth[i];
      const float px = (x0 + dx * x) * d + tx;
      const float py = (y0 + dy * x) * d + ty;
      const float pz = (z0 + dz * x) * d + tz;
      const float inverse = 1 / pz;
      const float u = fx * px * inverse + cx, v = fy * py * inverse + cy;
      const float from_left = u > 0 ? u : 0, from_top = v > 0 ? v : 0;  // 0 for NaN
      const float column = from_left < right ? from_left : right;
      const float row = from_top < bottom ? from_top : bottom;
      place[i] = static_cast<int>(static_cast<float>(static_cast<int>(row)) * columns +
                                  static_cast<float>(static_cast<int>(column)));
      const float measured = d > 0 ? pz : kBeyond;
      z[i] = pz < kNearest ? kBeyond : measured;
      slack[i] = 0.03f + 0.012f * pz * pz;
    }
  }

  // Seen free counts two, seen filled by the same surface counts minus one.
  void compare(const View& view, const Eigen::Isometry3d& T_world_camera,
               const CoarseFrame& frame) {
    const Eigen::Isometry3d T = view.T_world_camera.inverse() * T_world_camera;
    const Eigen::Matrix3f R = T.linear().cast<float>();
    const std::size_t n = static_cast<std::size_t>(frame.width);
    row_.place.resize(n), row_.z.resize(n), row_.slack.resize(n);
    Projection p;
    p.t = T.translation().cast<float>();
    p.per_cell = R.col(0) / frame.fx;
    p.fx = view.fx, p.fy = view.fy, p.cx = view.cx + 0.5f, p.cy = view.cy + 0.5f;
    p.columns = static_cast<float>(view.width);
    p.right = static_cast<float>(view.width) - 1, p.bottom = static_cast<float>(view.height) - 1;
    for (int y = 0; y < frame.height; ++y) {
      p.first = R * Eigen::Vector3f(-frame.cx / frame.fx,
                                    (static_cast<float>(y) - frame.cy) / frame.fy, 1);
      signed char* score = score_.data() + frame.index(0, y);
      project(p, frame.depth_m.data() + frame.index(0, y), n, row_.place.data(), row_.z.data(),
              row_.slack.data());
      for (std::size_t x = 0; x < n; ++x) {  // hard to foresee: no branch
        const Place& place = view.places[static_cast<std::size_t>(row_.place[x])];
        const float z = row_.z[x], slack = row_.slack[x];
        const int sure = (place.surface_m > kHole) | (z > kSurelyMeasuredM);
        const int free = (place.free_to_m > z + slack + 0.02f) & sure;
        const int same = (score[x] <= 0) & (std::abs(place.surface_m - z) < slack) & (1 - free);
        score[x] = static_cast<signed char>(score[x] + 2 * free - same);
      }
    }
  }

  std::vector<View> views_;
  std::size_t count_ = 0, next_ = 0, newest_ = 0;
  std::vector<signed char> score_;
  std::vector<float> nearest_;
  FarHoles holes_;
  Row row_;
};

}  // namespace stillpoint
