// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <chrono>

namespace stillpoint {

/// Measures the time of one stage after the other.
class Stopwatch {
 public:
  /// Milliseconds since it was made, or since the last call.
  double lap_ms() {
    const Clock::time_point now = Clock::now(), last = start_;
    start_ = now;
    return std::chrono::duration<double, std::milli>(now - last).count();
  }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point start_ = Clock::now();
};

}  // namespace stillpoint
