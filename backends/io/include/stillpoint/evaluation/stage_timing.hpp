// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <utility>
#include <vector>

namespace stillpoint {

/// How long a stage took, milliseconds; NaN without a sample.
struct TimingSummary {
  std::size_t count = 0;
  double mean_ms = std::numeric_limits<double>::quiet_NaN();
  double median_ms = mean_ms, p95_ms = mean_ms, max_ms = mean_ms;
};

/// Collects the times of named stages over a run. Keeps every sample (8 bytes each). One thread at
/// a time.
class StageTiming {
 public:
  /// Adds a sample in milliseconds. Stages are listed in the order in which they first come.
  void add(const std::string& stage, double ms) {
    const auto it = std::find_if(stages_.begin(), stages_.end(),
                                 [&](const auto& s) { return s.first == stage; });
    auto& samples = it != stages_.end() ? it->second
                                        : stages_.emplace_back(stage, std::vector<double>()).second;
    samples.push_back(ms);
  }

  std::vector<std::string> stages() const {
    std::vector<std::string> names;
    for (const auto& s : stages_) names.push_back(s.first);
    return names;
  }

  /// Summary of one stage; count 0 for an unknown one. The 95th percentile is the smallest sample
  /// that at least 95 % of the samples do not exceed. O(n log n).
  TimingSummary summary(const std::string& stage) const {
    TimingSummary result;
    for (const auto& s : stages_) {
      if (s.first != stage || s.second.empty()) continue;
      std::vector<double> sorted = s.second;
      std::sort(sorted.begin(), sorted.end());
      const std::size_t n = sorted.size();
      double sum = 0;
      for (double ms : sorted) sum += ms;
      result.count = n;
      result.mean_ms = sum / static_cast<double>(n);
      result.median_ms = n % 2 ? sorted[n / 2] : (sorted[n / 2 - 1] + sorted[n / 2]) / 2;
      result.p95_ms = sorted[(n * 95 + 99) / 100 - 1];
      result.max_ms = sorted.back();
    }
    return result;
  }

 private:
  std::vector<std::pair<std::string, std::vector<double>>> stages_;
};

}  // namespace stillpoint
