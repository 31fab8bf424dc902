// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <opencv2/core.hpp>
#include <vector>

#include "stillpoint/motion/depth_cells.hpp"
#include "stillpoint/motion/depth_holes.hpp"
#include "stillpoint/sensor/sensor_model.hpp"

namespace stillpoint {

/// Holes in the depth through which the camera looks farther than its depth sensor reaches: large
/// ones whose border runs, to a good part, along surfaces at the end of the range. What stands
/// there later, nearer than that, has come, if the hole was one for a while (FreeSpaceMap asks for
/// that): somebody right before the lens looks the same in one frame. Small holes, and those amid
/// near surfaces (black, glossy or too close), say nothing; nor does the margin where depth that is
/// registered to color has never measured anything: the depth camera does not see it.
class FarHoles {
 public:
  explicit FarHoles(const SensorModel& sensor = {})
      : max_range_m_(static_cast<float>(sensor.max_range_m)) {}

  /// Finds the cells of a frame that lie in such holes, not at their rims: one byte each, 1 = in a
  /// hole. `dynamic`: one byte per cell, not 0 = taken for dynamic; a person before the hole is no
  /// border. Valid until the next call. O(cells).
  const std::vector<std::uint8_t>& find(double timestamp, const DepthCells& frame,
                                        const std::vector<std::uint8_t>& dynamic) {
    found_.assign(frame.size(), 0);
    learn_range(timestamp, frame);
    learn_view(frame);
    if (range_m() < kEndReached * max_range_m_) return found_;
    holes_.for_each(frame, view_, [&](const std::vector<cv::Point>& hole) {
      if (looks_far(frame, dynamic, hole)) mark(frame, hole);
    });
    return found_;
  }

  /// The cells that the depth camera sees: those between measured ones of all frames so far,
  /// without the outermost.
  const cv::Rect& view() const { return view_; }

  /// The farthest that was measured in the last seconds, metres.
  float range_m() const { return std::max(recent_m_, earlier_m_); }

 private:
  static constexpr double kMemoryS = 3;
  static constexpr float kEndReached = 0.95f;  // of the sensor's range: the scene goes so far
  static constexpr float kEndOfRange = 0.85f;
  static constexpr std::size_t kSmallestShare = 20;  // of the image: one in 20
  static constexpr int kFewestFar = 10;

  // One far cell alone may be noise; what is not seen again for kMemoryS to twice that was noise,
  // too, or another room.
  void learn_range(double timestamp, const DepthCells& frame) {
    if (!(timestamp >= since_s_ && timestamp - since_s_ < kMemoryS)) {
      earlier_m_ = timestamp >= since_s_ && timestamp - since_s_ < 2 * kMemoryS ? recent_m_ : 0;
      recent_m_ = 0;
      since_s_ = timestamp;
    }
    const std::size_t w = static_cast<std::size_t>(frame.width);
    for (int y = 1; y + 1 < frame.height; ++y) {
      const float* z = frame.depth_m.data() + frame.index(0, y);
      for (std::size_t x = 1; x + 1 < w; ++x)
        if (z[x] > recent_m_)
          recent_m_ =
              std::max(recent_m_, std::min({z[x], z[x - 1], z[x + 1], *(z + x - w), z[x + w]}));
    }
  }

  void learn_view(const DepthCells& frame) {
    const cv::Size size(frame.width, frame.height);
    if (size != size_) measured_ = cv::Rect();
    size_ = size;
    if (measured_.size() == size) return;  // all of the image
    cv::Point first(size), last(-1, -1);
    for (int y = 0; y < frame.height; ++y)
      for (int x = 0; x < frame.width; ++x) {
        if (frame.depth_m[frame.index(x, y)] < 0) continue;
        first = {std::min(first.x, x), std::min(first.y, y)};
        last = {std::max(last.x, x), std::max(last.y, y)};
      }
    if (last.x >= 0) measured_ |= cv::Rect(first, last + cv::Point(1, 1));
    view_ = cv::Rect(measured_.x + 1, measured_.y + 1, std::max(0, measured_.width - 2),
                     std::max(0, measured_.height - 2));
  }

  // Whether a hole is large, and its border lies at the end of the range.
  bool looks_far(const DepthCells& frame, const std::vector<std::uint8_t>& dynamic,
                 const std::vector<cv::Point>& hole) const {
    if (hole.size() * kSmallestShare < frame.size()) return false;
    int far = 0, near = 0;
    for (const cv::Point& cell : hole)
      for (const auto& next : DepthCells::kNext) {
        const int x = cell.x + next[0], y = cell.y + next[1];
        if (!view_.contains({x, y})) continue;
        std::size_t i = frame.index(x, y);
        if (frame.depth_m[i] < 0) continue;
        // The cell beside a hole is often torn: then the one after it tells.
        if (frame.depth_m[i] == 0) i = frame.index(x + next[0], y + next[1]);
        if (!(frame.depth_m[i] > 0) || dynamic[i] != 0) continue;
        ++(frame.depth_m[i] > kEndOfRange * range_m() ? far : near);
      }
    return far >= kFewestFar && 2 * far >= near;
  }

  void mark(const DepthCells& frame, const std::vector<cv::Point>& hole) {
    for (const cv::Point& cell : hole) {
      bool inner = true;
      for (int y = cell.y - 1; y <= cell.y + 1; ++y)
        for (int x = cell.x - 1; x <= cell.x + 1; ++x)
          inner = inner && frame.depth_m[frame.index(x, y)] < 0;
      found_[frame.index(cell.x, cell.y)] = inner;
    }
  }

  float max_range_m_;
  cv::Size size_;             // of the frames, cells
  cv::Rect measured_, view_;  // see learn_view()
  float recent_m_ = 0, earlier_m_ = 0;
  double since_s_ = -std::numeric_limits<double>::infinity();  // of recent_m_
  std::vector<std::uint8_t> found_;
  DepthHoles holes_;
};

}  // namespace stillpoint
