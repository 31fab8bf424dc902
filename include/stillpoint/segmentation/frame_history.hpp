// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <iterator>
#include <opencv2/core.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "stillpoint/core/frame.hpp"
#include "stillpoint/segmentation/remembered_object.hpp"

namespace stillpoint {

/// The last frames, oldest first: depth image, camera motion, where each object was. Frames that
/// are forgotten leave their memory to later ones.
class FrameHistory {
 public:
  struct Track {
    int id;
    cv::Rect box;
    cv::Point2d center;
    float z;  ///< metres; 0: not known
  };
  struct Frame {
    double timestamp = 0, units_per_m = 0;
    /// Points of the frame before into this one's camera.
    std::optional<Eigen::Isometry3d> T_this_last;
    cv::Mat depth;
    std::vector<Track> tracks;
  };

  /// Keeps frames of the last `max_age_s`, at most 128.
  explicit FrameHistory(double max_age_s) : max_age_s_(max_age_s) {}

  bool empty() const { return frames_.empty(); }
  std::size_t size() const { return frames_.size(); }
  const Frame& operator[](std::size_t i) const { return frames_[i]; }
  const Frame& newest() const { return frames_.back(); }

  /// Keeps a frame: copies its depth, O(pixels). An earlier timestamp than the newest one's, or
  /// another size of the image, starts the history anew. A motion that is not finite is none.
  void add(const RgbdFrame& frame, const std::optional<Eigen::Isometry3d>& T_current_last) {
    if (frame.color.size() != size_) keep(0);
    size_ = frame.color.size();
    if (!frames_.empty() && frame.timestamp <= frames_.back().timestamp) keep(0);
    while (!frames_.empty() &&
           frame.timestamp - frames_.front().timestamp > max_age_s_ + kSameTimeS)
      keep(frames_.size() - 1);
    keep(kMostFrames - 1);
    Frame entry;
    if (!spare_.empty()) {
      entry = std::move(spare_.back());
      spare_.pop_back();
    }
    entry.timestamp = frame.timestamp;
    entry.units_per_m = frame.depth_units_per_m;
    entry.T_this_last.reset();
    if (T_current_last && T_current_last->matrix().allFinite()) entry.T_this_last = T_current_last;
    frame.depth.copyTo(entry.depth);
    entry.tracks.clear();
    frames_.push_back(std::move(entry));
  }

  /// Forgets all but the last `n`.
  void keep(std::size_t n) {
    if (frames_.size() <= n) return;
    const auto end = frames_.end() - static_cast<std::ptrdiff_t>(n);
    std::move(frames_.begin(), end, std::back_inserter(spare_));
    frames_.erase(frames_.begin(), end);
  }

  /// Takes note of where the compensator's objects are in the newest frame.
  void remember(const std::vector<RememberedObject>& objects) {
    if (frames_.empty()) return;
    for (const RememberedObject& object : objects)
      frames_.back().tracks.push_back({object.id, object.box(), object.center(), object.depth_m()});
  }

  /// Tells the motion to the newest frame, once it is known better.
  void set_newest_motion(const std::optional<Eigen::Isometry3d>& T_current_last) {
    if (!frames_.empty()) frames_.back().T_this_last = T_current_last;
  }

  /// The frame of that time or, if the host left it out, the one before it; size() if there is
  /// none.
  std::size_t index_of(double timestamp) const {
    for (std::size_t i = frames_.size(); i-- > 0;)
      if (frames_[i].timestamp <= timestamp + kSameTimeS) return i;
    return frames_.size();
  }

  /// Points of frame `first` into the camera of frame `last`; nothing where a motion is not known.
  std::optional<Eigen::Isometry3d> motion(std::size_t first, std::size_t last) const {
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    for (std::size_t i = first + 1; i <= last; ++i) {
      if (!frames_[i].T_this_last) return std::nullopt;
      T = *frames_[i].T_this_last * T;
    }
    return T;
  }
  /// The same, into the newest frame's.
  std::optional<Eigen::Isometry3d> motion_since(std::size_t first) const {
    return motion(first, frames_.size() - 1);
  }

 private:
  static constexpr std::size_t kMostFrames = 128;

  double max_age_s_;
  cv::Size size_;
  std::vector<Frame> frames_, spare_;
};

}  // namespace stillpoint
