// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <utility>

namespace stillpoint::rgbd_slam {

/// A thread that works through a queue of numbers in order.
class Worker {
 public:
  explicit Worker(std::function<void(int)> work)
      : work_(std::move(work)), thread_([this] { run(); }) {}
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;
  /// Drops what is queued, waits for the one at work.
  ~Worker() {
    {
      const std::lock_guard<std::mutex> guard(mutex_);
      queue_.clear();
      end_ = true;
    }
    changed_.notify_all();
    thread_.join();
  }

  void push(int item) {
    {
      const std::lock_guard<std::mutex> guard(mutex_);
      queue_.push_back(item);
      waiting_ = true;
    }
    changed_.notify_all();
  }

  /// Waits until everything is done.
  void drain() {
    std::unique_lock<std::mutex> guard(mutex_);
    changed_.wait(guard, [this] { return queue_.empty() && !busy_; });
  }

  bool idle() {
    const std::lock_guard<std::mutex> guard(mutex_);
    return queue_.empty() && !busy_;
  }

  /// True while something waits in the queue: the one at work should hurry.
  const std::atomic<bool>& waiting() const { return waiting_; }

 private:
  void run() {
    std::unique_lock<std::mutex> guard(mutex_);
    while (true) {
      changed_.wait(guard, [this] { return end_ || !queue_.empty(); });
      if (end_) return;
      const int item = queue_.front();
      queue_.pop_front();
      waiting_ = !queue_.empty();
      busy_ = true;
      guard.unlock();
      work_(item);
      guard.lock();
      busy_ = false;
      changed_.notify_all();
    }
  }

  std::function<void(int)> work_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<int> queue_;
  std::atomic<bool> waiting_{false};
  bool busy_ = false, end_ = false;
  std::thread thread_;  // last: starts when the rest is there
};

}  // namespace stillpoint::rgbd_slam
