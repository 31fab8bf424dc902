// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <chrono>
#include <thread>

namespace stillpoint::cli {

/// The recording's time since its first frame, for runs that keep its pace. It may be stopped while
/// files are read and results judged, which a robot does not do.
class RecordingClock {
 public:
  void start() { start_ = Clock::now(); }
  void stop() { stopped_ = Clock::now(), running_ = false; }
  void go_on() {
    if (!running_) start_ += Clock::now() - stopped_;
    running_ = true;
  }
  bool is_past(double time_s) const { return (running_ ? Clock::now() : stopped_) >= at(time_s); }
  void wait_for(double time_s) const { std::this_thread::sleep_until(at(time_s)); }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point at(double time_s) const {
    return start_ +
           std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(time_s));
  }
  Clock::time_point start_, stopped_;
  bool running_ = true;
};

}  // namespace stillpoint::cli
