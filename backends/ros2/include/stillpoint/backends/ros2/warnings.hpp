// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <utility>

namespace stillpoint::ros2 {

/// Seconds of a clock that never goes back, whatever the stamps do.
inline double steady_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// Warnings, each kind at most once per period. Thread-safe.
class Warnings {
 public:
  using Print = std::function<void(const std::string&)>;
  using Clock = std::function<double()>;

  /// `print` gets the text; `clock` gives seconds.
  explicit Warnings(Print print, Clock clock = steady_seconds)
      : print_(std::move(print)), clock_(std::move(clock)) {}

  void set_period(double period_s) {
    const std::lock_guard<std::mutex> guard(mutex_);
    period_s_ = period_s;
  }

  /// Says `text`, unless something of that `kind` ("/camera/depth encoding") was said within the
  /// last period; then it is counted, and the next one says how many there were.
  void say(const std::string& kind, const std::string& text) {
    std::string said = text;
    {
      const std::lock_guard<std::mutex> guard(mutex_);
      const double now_s = clock_();
      const auto [it, first] = last_.insert({kind, {now_s, 0}});
      if (!first) {
        if (now_s - it->second.time_s < period_s_) {
          ++it->second.silent;
          return;
        }
        if (it->second.silent > 0)
          said += " (and " + std::to_string(it->second.silent) + " times since this was last said)";
        it->second = {now_s, 0};
      }
    }
    print_(said);
  }

 private:
  struct Last {
    double time_s;
    std::uint64_t silent;
  };
  Print print_;
  Clock clock_;
  mutable std::mutex mutex_;
  double period_s_ = 10;
  std::map<std::string, Last> last_;
};

}  // namespace stillpoint::ros2
