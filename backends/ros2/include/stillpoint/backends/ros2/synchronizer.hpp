// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <deque>
#include <optional>
#include <utility>

#include "stillpoint/backends/ros2/messages.hpp"

namespace stillpoint::ros2 {

/// Settings of Synchronizer.
struct SynchronizerSettings {
  /// Color images that wait at most; the oldest makes room for a new one.
  std::size_t queue_size = 5;
  /// False: depth is not waited for.
  bool depth = true;
  /// Color and depth belong together when at most this far apart.
  Nanoseconds max_difference = 20000000;
  /// A color image waits for its depth until the newest color image is so much later.
  Nanoseconds max_wait = 100000000;
  /// The same for the segmentation of its own stamp. 0: none is waited for, late ones are taken as
  /// they come.
  Nanoseconds mask_wait = 0;
  /// Depth (or segmentation) that is so much older than the color has stopped, and is not waited
  /// for.
  Nanoseconds stalled_after = 1000000000;
  /// A stamp so much before the last one is a jump of the clock (a bag that begins anew), not a
  /// message that comes late.
  Nanoseconds jump_back = 500000000;
};

/// What belongs to one frame.
struct FrameMessages {
  ImageMessage color;
  std::optional<ImageMessage> depth;
  /// The newest segmentation that came since the last frame; of this frame or of an earlier one.
  std::optional<SegmentationMessage> segmentation;
  /// Time went back: this frame has nothing to do with those before.
  bool clock_jumped = false;
  /// Without depth: how far away the nearest depth was, if there was one.
  std::optional<Nanoseconds> nearest_depth;
};

/// What became of messages since the beginning.
struct SynchronizerCounts {
  /// Color images that came, were handed on, were handed on without depth.
  std::uint64_t color = 0, frames = 0, without_depth = 0;
  /// Color images that did not fit into the queue; that came late or twice.
  std::uint64_t dropped = 0, late = 0;
  std::uint64_t depth = 0, segmentations = 0;
  std::uint64_t jumps = 0;
};

/// Puts color, depth and segmentations together by their stamps.
///
/// Everything is decided by stamps, so a bag gives the same frames at any speed; the only clock is
/// the newest color image. A color image gets the depth image nearest to it, which serves no other.
/// All queues are bounded. Not thread-safe.
class Synchronizer {
 public:
  explicit Synchronizer(const SynchronizerSettings& settings = {}) : settings_(settings) {}

  /// Takes effect at once; what waits stays.
  void set_settings(const SynchronizerSettings& settings) { settings_ = settings; }

  /// Adds a color image. One that is not newer than the last is left out, unless time went back:
  /// then all that waits is dropped. O(queue).
  void add_color(ImageMessage message) {
    ++counts_.color;
    const Nanoseconds stamp = message.stamp;
    if (newest_color_ && stamp <= *newest_color_) {
      const bool jump = *newest_color_ - stamp >= settings_.jump_back;
      if (!jump && ++older_in_a_row_ <= settings_.queue_size) {
        ++counts_.late;
        return;
      }
      begin_anew(stamp);
    }
    older_in_a_row_ = 0;
    newest_color_ = stamp;
    if (!first_color_) first_color_ = stamp;
    colors_.push_back(std::move(message));
    if (colors_.size() > settings_.queue_size) {
      colors_.pop_front();
      ++counts_.dropped;
    }
  }

  /// Adds a depth image. O(queue).
  void add_depth(ImageMessage message) {
    ++counts_.depth;
    if (newest_depth_ && message.stamp <= *newest_depth_) {
      if (*newest_depth_ - message.stamp < settings_.jump_back) return;  // late, or twice
      depths_.clear();
      depth_period_ = 0;
    } else if (newest_depth_) {
      // The shortest of late: a lost image makes a step longer, and only a slower camera all of
      // them.
      const Nanoseconds step = message.stamp - *newest_depth_;
      depth_period_ = depth_period_ == 0 ? step : std::min(step, depth_period_ + depth_period_ / 8);
    }
    newest_depth_ = message.stamp;
    depths_.push_back(std::move(message));
    if (depths_.size() > 2 * settings_.queue_size) depths_.pop_front();
  }

  /// Adds a segmentation. O(queue).
  void add_segmentation(SegmentationMessage message) {
    ++counts_.segmentations;
    newest_segmentation_ = message.stamp;
    segmentations_.push_back(std::move(message));
    if (segmentations_.size() > 2 * settings_.queue_size) segmentations_.pop_front();
  }

  /// Whether next() has a frame.
  bool ready() const {
    return !colors_.empty() && (colors_.size() >= settings_.queue_size ||
                                (depth_is_decided() && segmentation_is_decided()));
  }

  /// The next frame that is complete, or has waited long enough; nothing if there is none.
  std::optional<FrameMessages> next() {
    if (!ready()) return std::nullopt;
    FrameMessages frame;
    take_depth(frame);
    take_segmentation(frame);
    frame.color = std::move(colors_.front());
    colors_.pop_front();
    frame.clock_jumped = jumped_;
    jumped_ = false;
    ++counts_.frames;
    if (settings_.depth && !frame.depth) ++counts_.without_depth;
    return frame;
  }

  const SynchronizerCounts& counts() const { return counts_; }

 private:
  void begin_anew(Nanoseconds now) {
    ++counts_.jumps;
    counts_.dropped += colors_.size();
    colors_.clear();
    // What is of the time after the jump stays: depth may be ahead of the color.
    const auto of_before = [&](const auto& message) {
      return message.stamp >= now + settings_.jump_back;
    };
    depths_.erase(std::remove_if(depths_.begin(), depths_.end(), of_before), depths_.end());
    segmentations_.erase(std::remove_if(segmentations_.begin(), segmentations_.end(), of_before),
                         segmentations_.end());
    newest_depth_ = depths_.empty() ? std::nullopt : std::optional(depths_.back().stamp);
    newest_segmentation_ =
        segmentations_.empty() ? std::nullopt : std::optional(segmentations_.back().stamp);
    first_color_.reset();
    jumped_ = true;
  }

  // Nothing more to wait for, where `newest` is the newest message of the other kind.
  bool is_decided(const std::optional<Nanoseconds>& newest, Nanoseconds wait) const {
    const Nanoseconds now = colors_.front().stamp;
    if (newest && *newest >= now) return true;
    const Nanoseconds last = newest ? *newest : *first_color_;
    return *newest_color_ - last >= settings_.stalled_after || *newest_color_ - now >= wait;
  }

  bool depth_is_decided() const {
    if (!settings_.depth || is_decided(newest_depth_, settings_.max_wait)) return true;
    // Depth that was taken a little before its color image: the next cannot be nearer.
    const Nanoseconds before = colors_.front().stamp - newest_depth_.value_or(0);
    return !depths_.empty() && before <= settings_.max_difference &&
           before <= depth_period_ / 5 * 2;
  }
  bool segmentation_is_decided() const {
    return settings_.mask_wait <= 0 || is_decided(newest_segmentation_, settings_.mask_wait);
  }

  void take_depth(FrameMessages& frame) {
    if (!settings_.depth) return depths_.clear();
    const Nanoseconds now = colors_.front().stamp;
    const auto apart = [](const ImageMessage& m, Nanoseconds t) { return std::abs(m.stamp - t); };
    auto best = depths_.end();
    for (auto it = depths_.begin(); it != depths_.end(); ++it)
      if (best == depths_.end() || apart(*it, now) < apart(*best, now)) best = it;
    if (best == depths_.end()) return;
    const Nanoseconds difference = apart(*best, now);
    if (difference <= settings_.max_difference) {
      frame.depth = std::move(*best);
      depths_.erase(depths_.begin(), best + 1);
    } else {
      frame.nearest_depth = difference;
    }
    while (!depths_.empty() && depths_.front().stamp < now - settings_.max_difference)
      depths_.pop_front();
  }

  void take_segmentation(FrameMessages& frame) {
    const Nanoseconds now = colors_.front().stamp;
    // Those of frames to come wait, and so do those that come in another order.
    std::deque<SegmentationMessage> later;
    for (SegmentationMessage& m : segmentations_) {
      if (m.stamp > now)
        later.push_back(std::move(m));
      else if (!frame.segmentation || m.stamp >= frame.segmentation->stamp)
        frame.segmentation = std::move(m);
    }
    segmentations_.swap(later);
  }

  SynchronizerSettings settings_;
  std::deque<ImageMessage> colors_, depths_;
  std::deque<SegmentationMessage> segmentations_;
  std::optional<Nanoseconds> first_color_, newest_color_, newest_depth_, newest_segmentation_;
  Nanoseconds depth_period_ = 0;  // 0: not known
  std::size_t older_in_a_row_ = 0;
  bool jumped_ = false;
  SynchronizerCounts counts_;
};

}  // namespace stillpoint::ros2
