// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <opencv2/core.hpp>

namespace stillpoint {

/// A point of a dense map.
struct ColoredPoint {
  /// World coordinates, metres.
  Eigen::Vector3f position;
  /// Blue, green, red.
  cv::Vec3b bgr;
  /// Number of frames that saw it.
  std::uint32_t count = 0;
};

}  // namespace stillpoint
