// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "stillpoint/backends/ros2/synchronizer.hpp"
#include "stillpoint/core/status.hpp"
#include "stillpoint/front_end.hpp"

namespace stillpoint::ros2 {

/// The fields of diagnostic_msgs/DiagnosticStatus.
struct DiagnosticReport {
  enum Level { kOk = 0, kWarn = 1, kError = 2 };
  Level level = kOk;
  std::string message;
  std::vector<std::pair<std::string, std::string>> values;
};

/// Counts what happens between two reports: rates, drops, milliseconds per stage, status bits by
/// name. Times are seconds of a clock that never goes back. Not thread-safe.
class Diagnostics {
 public:
  enum Topic { kColor, kDepth, kSegmentation, kTopics };

  explicit Diagnostics(double now_s) : begin_s_(now_s), start_s_(now_s) {}

  void arrived(Topic topic, double now_s) { last_s_[topic] = now_s; }
  /// A message that is missing or cannot be used.
  void refused() { ++refused_; }
  /// A mask was made; the color image came `latency_s` before.
  void made(const FrameStats& stats, double total_ms, double latency_s) {
    ++frames_;
    total_ms_ += total_ms;
    motion_ms_ += stats.motion_ms;
    compensation_ms_ += stats.compensation_ms;
    depth_ms_ += stats.depth_ms;
    latency_ms_ += 1e3 * latency_s;
    most_latency_ms_ = std::max(most_latency_ms_, 1e3 * latency_s);
    mask_age_s_ = stats.mask_age_s;
    depth_delay_s_ = stats.depth_delay_s;
    depth_readout_s_ = stats.depth_readout_s;
    for (const std::string& name : status_names(stats.status)) ++status_[name];
  }

  /// What happened since the last report. `use_depth`: depth is expected.
  DiagnosticReport report(double now_s, const SynchronizerCounts& counts, bool use_depth,
                          double stalled_after_s) {
    DiagnosticReport out;
    judge(out, now_s, counts, use_depth, stalled_after_s);
    add_values(out, now_s, counts);
    const auto last = last_s_;
    *this = Diagnostics(now_s);
    last_s_ = last, counts_ = counts;
    return out;
  }

 private:
  struct LastTimes {
    double time[kTopics] = {-1, -1, -1};
    double& operator[](Topic t) { return time[t]; }
  };

  static std::string text(double value) {
    char buffer[32];
    std::snprintf(buffer, sizeof buffer, "%.2f", value);
    return buffer;
  }

  void judge(DiagnosticReport& out, double now_s, const SynchronizerCounts& counts, bool use_depth,
             double stalled_after_s) {
    const auto raise = [&](DiagnosticReport::Level level, const std::string& message) {
      out.level = std::max(out.level, level);
      out.message += (out.message.empty() ? "" : "; ") + message;
    };
    const auto silent = [&](Topic topic, const char* name, DiagnosticReport::Level level) {
      const bool never = last_s_[topic] < 0;
      const double for_s = now_s - (never ? begin_s_ : last_s_[topic]);
      if (for_s >= stalled_after_s)
        raise(level,
              std::string("no ") + name + (never ? " so far" : " for " + text(for_s) + " s"));
    };
    silent(kColor, "color image", DiagnosticReport::kError);
    if (use_depth) silent(kDepth, "depth image", DiagnosticReport::kWarn);
    if (last_s_[kSegmentation] >= 0) silent(kSegmentation, "segmentation", DiagnosticReport::kWarn);
    if (refused_ > 0)
      raise(DiagnosticReport::kWarn,
            "something missing or refused " + std::to_string(refused_) + " times, see the log");
    if (counts.dropped > counts_.dropped)
      raise(DiagnosticReport::kWarn,
            std::to_string(counts.dropped - counts_.dropped) + " color images dropped");
    if (out.message.empty()) out.message = "masks are made";
  }

  void add_values(DiagnosticReport& out, double now_s, const SynchronizerCounts& counts) {
    const double span_s = std::max(1e-3, now_s - start_s_);
    const double n = std::max<double>(1, static_cast<double>(frames_));
    const auto add = [&](const char* name, const std::string& value) {
      out.values.emplace_back(name, value);
    };
    const auto total = [&](const char* name, std::uint64_t count) {
      add(name, std::to_string(count));
    };
    add("color rate (Hz)", text(static_cast<double>(counts.color - counts_.color) / span_s));
    add("mask rate (Hz)", text(static_cast<double>(frames_) / span_s));
    add("latency, mean (ms)", text(latency_ms_ / n));
    add("latency, most (ms)", text(most_latency_ms_));
    add("front end (ms)", text(total_ms_ / n));
    add("motion (ms)", text(motion_ms_ / n));
    add("compensation (ms)", text(compensation_ms_ / n));
    add("depth fusion (ms)", text(depth_ms_ / n));
    add("age of the segmentation (s)", text(mask_age_s_));
    add("delay of the depth (ms)", text(1000 * depth_delay_s_));
    add("read-out of the depth (ms)", text(1000 * depth_readout_s_));
    total("color images", counts.color);
    total("frames", counts.frames);
    total("frames without depth", counts.without_depth);
    total("color images dropped", counts.dropped);
    total("color images late", counts.late);
    total("clock jumps", counts.jumps);
    for (const auto& [name, count] : status_)
      add(("status " + name).c_str(), std::to_string(count) + " of " + std::to_string(frames_));
  }

  double begin_s_, start_s_;
  LastTimes last_s_;
  std::uint64_t frames_ = 0, refused_ = 0;
  double total_ms_ = 0, motion_ms_ = 0, compensation_ms_ = 0, depth_ms_ = 0;
  double latency_ms_ = 0, most_latency_ms_ = 0;
  double mask_age_s_ = std::numeric_limits<double>::infinity();
  double depth_delay_s_ = std::numeric_limits<double>::quiet_NaN();
  double depth_readout_s_ = std::numeric_limits<double>::quiet_NaN();
  std::map<std::string, std::uint64_t> status_;
  SynchronizerCounts counts_;
};

}  // namespace stillpoint::ros2
