// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <utility>

namespace stillpoint::rgbd_slam {

/// A mutex that goes to whoever has waited longest.
///
/// A thread that gives a std::mutex back and wants it again at once mostly gets it, however long
/// another one waits: the map's background work, which is done piece by piece so that tracking can
/// go between, would stop it for as long as all pieces take. For std::lock_guard and
/// std::unique_lock.
class FairMutex {
 public:
  void lock() {
    std::unique_lock<std::mutex> guard(mutex_);
    const std::uint64_t mine = next_++;
    changed_.wait(guard, [&] { return mine == served_; });
  }

  void unlock() {
    {
      const std::lock_guard<std::mutex> guard(mutex_);
      ++served_;
    }
    changed_.notify_all();
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::uint64_t next_ = 0, served_ = 0;
};

/// A thread that works through a queue of numbers in order. What the work throws does not end the
/// thread: it is kept for rethrow(), and the next number follows.
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

  /// Throws what the work has thrown since the last call, once: the first, if it was more than one.
  void rethrow() {
    std::exception_ptr error;
    {
      const std::lock_guard<std::mutex> guard(mutex_);
      std::swap(error, error_);
    }
    if (error) std::rethrow_exception(error);
  }

  /// Waits until everything is done, or has failed; see rethrow().
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
      std::exception_ptr error;
      try {
        work_(item);
      } catch (...) {
        error = std::current_exception();
      }
      guard.lock();
      // The first is the cause; others may only follow from it.
      if (!error_) error_ = error;
      busy_ = false;
      changed_.notify_all();
    }
  }

  std::function<void(int)> work_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<int> queue_;
  std::exception_ptr error_;
  std::atomic<bool> waiting_{false};
  bool busy_ = false, end_ = false;
  std::thread thread_;  // last: starts when the rest is there
};

}  // namespace stillpoint::rgbd_slam
