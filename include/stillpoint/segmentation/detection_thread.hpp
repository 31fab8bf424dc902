// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <exception>
#include <limits>
#include <mutex>
#include <opencv2/core.hpp>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "stillpoint/core/error.hpp"
#include "stillpoint/core/frame.hpp"
#include "stillpoint/core/instance.hpp"
#include "stillpoint/core/mask_pool.hpp"
#include "stillpoint/segmentation/segmenter.hpp"

namespace stillpoint {

/// Runs a segmenter beside the camera, at its own pace: a Segmenter whose segment() never waits.
///
///     stillpoint::OpenCvDnnSegmenter network("model.onnx");
///     stillpoint::DetectionThread thread(network);
///     stillpoint::FrontEnd front_end({}, camera, &thread);
///
/// segment() hands the frame over and returns the newest result that has finished since the last
/// call, with the timestamp of the frame that it belongs to; the front end predicts it forward. One
/// frame waits at most: the newest takes the place of an older one. Needs threads (link
/// Threads::Threads where the C library wants it).
class DetectionThread : public Segmenter {
 public:
  /// `segmenter` must outlive this, and be used by nobody else.
  explicit DetectionThread(Segmenter& segmenter)
      : segmenter_(segmenter), classes_(segmenter.classes()), thread_([this] { run(); }) {}
  DetectionThread(const DetectionThread&) = delete;
  DetectionThread& operator=(const DetectionThread&) = delete;
  /// Drops what waits; waits for the frame at work, as a thread cannot be ended from outside.
  ~DetectionThread() override {
    {
      const std::lock_guard<std::mutex> guard(mutex_);
      end_ = true;
    }
    changed_.notify_all();
    thread_.join();
  }

  /// Copies the frame, so the caller may reuse it. Returns `available = false` when nothing new has
  /// finished. Throws what the segmenter threw since the last call, once; the thread goes on. An
  /// earlier timestamp than the last one's begins another sequence: results of the old one are
  /// dropped. O(pixels), whatever the segmenter does.
  Segmentation segment(const RgbdFrame& frame) override {
    check_frame(frame);
    Segmentation result;
    std::exception_ptr error;
    {
      const std::lock_guard<std::mutex> guard(mutex_);
      if (waiting_) ++dropped_;
      if (frame.timestamp < last_s_) begin_sequence();
      last_s_ = frame.timestamp;
      // Into the same memory, unless the segmenter kept a reference to it.
      detail::copy_apart(frame.color, next_.color);
      detail::copy_apart(frame.depth, next_.depth);
      detail::copy_apart(frame.gray, next_.gray);
      next_.timestamp = frame.timestamp;
      next_.depth_timestamp = frame.depth_timestamp;
      next_.depth_units_per_m = frame.depth_units_per_m;
      waiting_ = true;
      if (error_)
        std::swap(error, error_);
      else
        std::swap(result, result_);
    }
    changed_.notify_all();
    if (error) std::rethrow_exception(error);
    return result;
  }

  /// Waits until the frame that was handed over first has a result or an error to fetch, at most
  /// `timeout_s`; false if it has not. For the start: a map that begins with people in it keeps
  /// them.
  ///
  ///     thread.segment(first);
  ///     thread.wait_for_result(10);
  ///     front_end.compute_mask(first);
  bool wait_for_result(double timeout_s) {
    // The clock counts nanoseconds in 64 bits: "for ever" must be less than 292 years.
    const double wait_s = timeout_s > 0 ? std::min(timeout_s, 1e9) : 0;
    std::unique_lock<std::mutex> guard(mutex_);
    return finished_.wait_for(guard, std::chrono::duration<double>(wait_s),
                              [this] { return result_.available || error_; });
  }

  std::vector<std::string> classes() const override { return classes_; }

  /// How many frames were replaced by newer ones before the segmenter was free.
  std::size_t dropped() const {
    const std::lock_guard<std::mutex> guard(mutex_);
    return dropped_;
  }

 private:
  void begin_sequence() {
    ++sequence_;
    result_ = Segmentation();
    error_ = nullptr;
  }

  void run() {
    RgbdFrame frame;
    std::unique_lock<std::mutex> guard(mutex_);
    while (true) {
      changed_.wait(guard, [this] { return end_ || waiting_; });
      if (end_) return;
      std::swap(frame, next_);
      waiting_ = false;
      const int sequence = sequence_;
      guard.unlock();
      Segmentation result;
      std::exception_ptr error;
      try {
        result = segmenter_.segment(frame);
        result.timestamp = frame.timestamp;
        check_segmentation(result, frame.color.size());
        // The segmenter may write its next result over this one.
        for (Instance& s : result.instances) s.mask = s.mask.clone();
      } catch (...) {
        error = std::current_exception();
      }
      guard.lock();
      if (sequence != sequence_) continue;
      // A frame without a result takes nothing away from one that waits to be fetched.
      if (error)
        error_ = error;
      else if (result.available)
        std::swap(result_, result);
      finished_.notify_all();
    }
  }

  Segmenter& segmenter_;
  std::vector<std::string> classes_;
  mutable std::mutex mutex_;
  std::condition_variable changed_, finished_;
  RgbdFrame next_;
  Segmentation result_;
  std::exception_ptr error_;
  std::size_t dropped_ = 0;
  double last_s_ = -std::numeric_limits<double>::infinity();
  int sequence_ = 0;  // of frames whose time goes on
  bool waiting_ = false, end_ = false;
  std::thread thread_;  // last: starts when the rest is there
};

}  // namespace stillpoint
