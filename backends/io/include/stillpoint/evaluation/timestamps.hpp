// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "stillpoint/core/error.hpp"
#include "stillpoint/core/trajectory.hpp"

namespace stillpoint {
namespace detail {

inline std::vector<double> timestamps_of(const Trajectory& trajectory) {
  std::vector<double> times;
  times.reserve(trajectory.size());
  for (const StampedPose& pose : trajectory) times.push_back(pose.timestamp);
  return times;
}

inline std::string range_text(const Trajectory& trajectory) {
  std::string text = std::to_string(trajectory.size()) + " poses";
  if (trajectory.empty()) return text;
  const std::vector<double> times = timestamps_of(trajectory);
  const auto range = std::minmax_element(times.begin(), times.end());
  return text + " from " + std::to_string(*range.first) + " to " + std::to_string(*range.second) +
         " s";
}

/// Index of the time nearest to `t`; `times` is ascending and not empty. The earlier one of two
/// equally near ones.
inline std::size_t nearest(const std::vector<double>& times, double t) {
  const auto after = std::lower_bound(times.begin(), times.end(), t);
  if (after == times.begin()) return 0;
  const auto index = static_cast<std::size_t>(after - times.begin());
  if (after == times.end()) return index - 1;
  return t - times[index - 1] <= times[index] - t ? index - 1 : index;
}

inline void check_ascending(const std::vector<double>& times, const char* name) {
  for (std::size_t i = 0; i < times.size(); ++i)
    check(std::isfinite(times[i]) && (i == 0 || times[i - 1] < times[i]), [&] {
      return std::string(name) + "[" + std::to_string(i) +
             "].timestamp: expected ascending seconds, found " + std::to_string(times[i]) +
             (i ? " after " + std::to_string(times[i - 1]) : std::string());
    });
}

}  // namespace detail

}  // namespace stillpoint
