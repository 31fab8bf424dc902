// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <condition_variable>
#include <cstdint>
#include <mutex>

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

}  // namespace stillpoint::rgbd_slam
