// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "stillpoint/backends/ros2/diagnostics.hpp"
#include "stillpoint/backends/ros2/mask_maker.hpp"
#include "stillpoint/backends/ros2/messages.hpp"
#include "stillpoint/backends/ros2/parameters.hpp"
#include "stillpoint/backends/ros2/synchronizer.hpp"
#include "stillpoint/backends/ros2/warnings.hpp"
#include "stillpoint/front_end.hpp"

namespace stillpoint::ros2 {

/// From the messages of one camera to its masks: all of the node but ROS.
///
///     stream.add_color(image);           // in the subscriptions
///     while (running)                    // in a thread of its own
///       if (stream.wait(100ms))
///         while (const StreamFrame* frame = stream.next())
///           publish(*frame, stream.front_end().mask());
///
/// The add_...() functions may be called from any thread and never wait for a mask; wait(), next(),
/// front_end() belong to one thread. Trouble is said through Warnings, and the stream goes on.
class CameraStream {
 public:
  /// `pose_at` is called by next(). `warnings` must outlive this.
  CameraStream(const Parameters& parameters, TopicNames topics, Warnings& warnings,
               MaskMaker::PoseAt pose_at = {})
      : topics_(topics),
        warnings_(warnings),
        diagnostics_(steady_seconds()),
        maker_(
            std::move(topics),
            [this](const std::string& topic, const std::string& what, const std::string& problem) {
              refuse(topic, what, problem);
            },
            std::move(pose_at)) {
    set_parameters(parameters);
  }
  CameraStream(const CameraStream&) = delete;
  CameraStream& operator=(const CameraStream&) = delete;

  /// They hold from the next frame on. Others of the front end than before, and it begins anew.
  void set_parameters(const Parameters& parameters) {
    const std::lock_guard<std::mutex> guard(mutex_);
    parameters_ = parameters;
    parameters_changed_ = true;
    synchronizer_.set_settings(parameters.synchronizer());
    warnings_.set_period(parameters.warn_period_s);
  }

  void add_camera_info(const CameraInfoMessage& message) {
    const std::lock_guard<std::mutex> guard(mutex_);
    if (info_ && *info_ == message) return;
    info_ = message;
    info_changed_ = true;
  }
  void add_color(ImageMessage message) {
    add(std::move(message), topics_.color, Diagnostics::kColor, &Synchronizer::add_color);
  }
  void add_depth(ImageMessage message) {
    add(std::move(message), topics_.depth, Diagnostics::kDepth, &Synchronizer::add_depth);
  }
  void add_segmentation(SegmentationMessage message) {
    add(std::move(message), topics_.segmentation, Diagnostics::kSegmentation,
        &Synchronizer::add_segmentation);
  }

  /// Waits until next() has something to do, at most so long; false if it has not.
  bool wait(std::chrono::milliseconds most) {
    std::unique_lock<std::mutex> guard(mutex_);
    return changed_.wait_for(guard, most, [this] { return synchronizer_.ready(); });
  }

  /// Makes the mask of the next frame that is complete; null if there is none. The result is valid
  /// until the next call. Cost: that of FrontEnd::compute_mask() and of copying the images.
  const StreamFrame* next() {
    while (std::optional<FrameMessages> messages = take()) {
      const Nanoseconds stamp = messages->color.stamp;
      const double start_s = steady_seconds();
      if (!maker_.make(std::move(*messages))) continue;
      const std::lock_guard<std::mutex> guard(mutex_);
      const double now_s = steady_seconds();
      diagnostics_.made(front_end().stats(), 1e3 * (now_s - start_s), now_s - arrival(stamp));
      return &maker_.frame();
    }
    return nullptr;
  }

  /// The front end after next(): mask, objects, statistics.
  const FrontEnd& front_end() const { return maker_.front_end(); }

  /// What happened since the last report.
  DiagnosticReport report() {
    const std::lock_guard<std::mutex> guard(mutex_);
    return diagnostics_.report(steady_seconds(), synchronizer_.counts(), parameters_.use_depth,
                               parameters_.stalled_after_s);
  }

 private:
  struct Arrival {
    Nanoseconds stamp;
    double time_s;
  };

  template <class Message>
  void add(Message message, const std::string& topic, Diagnostics::Topic kind,
           void (Synchronizer::*function)(Message)) {
    const Nanoseconds stamp = message.stamp;
    if (stamp <= 0)
      return refuse(topic, "stamp",
                    "expected the time of the exposure in header.stamp, found " +
                        std::to_string(seconds(stamp)));
    {
      const std::lock_guard<std::mutex> guard(mutex_);
      const double now_s = steady_seconds();
      diagnostics_.arrived(kind, now_s);
      if (kind == Diagnostics::kColor) {
        arrivals_.push_back({stamp, now_s});
        if (arrivals_.size() > 2 * static_cast<std::size_t>(parameters_.queue_size))
          arrivals_.pop_front();
      }
      (synchronizer_.*function)(std::move(message));
    }
    changed_.notify_one();
  }

  void refuse(const std::string& topic, const std::string& what, const std::string& problem) {
    {
      const std::lock_guard<std::mutex> guard(mutex_);
      diagnostics_.refused();
    }
    warnings_.say(topic + " " + what, topic + ": " + what + ": " + problem);
  }

  double arrival(Nanoseconds stamp) const {
    double time_s = steady_seconds();
    for (const Arrival& a : arrivals_)
      if (a.stamp == stamp) time_s = a.time_s;
    return time_s;
  }

  // Takes over what was set in the meantime, too.
  std::optional<FrameMessages> take() {
    const std::lock_guard<std::mutex> guard(mutex_);
    std::optional<FrameMessages> messages = synchronizer_.next();
    if (messages && parameters_changed_) maker_.set_parameters(parameters_);
    if (messages && info_changed_) maker_.set_camera_info(info_);
    if (messages) parameters_changed_ = info_changed_ = false;
    return messages;
  }

  TopicNames topics_;
  Warnings& warnings_;

  std::mutex mutex_;  // of what is below, but maker_
  std::condition_variable changed_;
  Synchronizer synchronizer_;
  Parameters parameters_;
  bool parameters_changed_ = true, info_changed_ = false;
  std::optional<CameraInfoMessage> info_;
  std::deque<Arrival> arrivals_;
  Diagnostics diagnostics_;

  MaskMaker maker_;  // of the thread that calls next()
};

}  // namespace stillpoint::ros2
