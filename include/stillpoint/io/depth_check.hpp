// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <locale>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "stillpoint/core/frame.hpp"

namespace stillpoint {

/// Median of the measured depth in metres; nothing if there is no measurement. O(pixels).
inline std::optional<double> median_depth_m(const RgbdFrame& frame) {
  if (frame.depth.empty()) return std::nullopt;
  std::vector<float> depths;
  depths.reserve(frame.depth.total());
  for (int y = 0; y < frame.depth.rows; ++y)
    for (int x = 0; x < frame.depth.cols; ++x)
      if (const float z = depth_m_at(frame, x, y); z > 0) depths.push_back(z);
  if (depths.empty()) return std::nullopt;
  const auto middle = depths.begin() + static_cast<std::ptrdiff_t>(depths.size() / 2);
  std::nth_element(depths.begin(), middle, depths.end());
  return *middle;
}

/// Says when a frame's depth makes no sense: a median under 0.1 m or over 50 m is most likely a
/// wrong depth factor. Returns the message, with the factor that would fit, or nothing: all is
/// well, or there is no measurement to judge by. Meant for the first frame of a run. O(pixels).
inline std::optional<std::string> check_depth_scale(const RgbdFrame& frame) {
  const std::optional<double> median_m = median_depth_m(frame);
  if (!median_m || (*median_m >= 0.1 && *median_m <= 50)) return std::nullopt;
  const bool stored_in_units = frame.depth.depth() == CV_16U;
  const double units_per_m = stored_in_units ? frame.depth_units_per_m : 1;
  std::ostringstream message;
  message.imbue(std::locale::classic());
  message << "median depth is " << *median_m << " m, which makes no sense; the depth factor "
          << "(DepthMapFactor, units per metre) of " << units_per_m << " is likely wrong";
  if (stored_in_units) {
    for (const double units : {5000.0, 1000.0, 256.0, 10000.0, 100.0, 1.0}) {
      const double metres = *median_m * units_per_m / units;
      if (metres < 0.5 || metres > 10) continue;
      message << ": " << units << " would give " << metres << " m";
      break;
    }
  } else {
    message << "; 32-bit depth must be in metres";
    if (*median_m / 1000 >= 0.1 && *median_m / 1000 <= 50)
      message << ", and this looks like millimetres";
  }
  return message.str();
}

}  // namespace stillpoint
