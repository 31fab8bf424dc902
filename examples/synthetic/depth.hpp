// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "stillpoint/core/camera.hpp"
#include "synthetic/math.hpp"

namespace stillpoint {

/// What a structured-light camera measures of exact depth. Lengths in metres, 0 = as exact as the
/// coding lets it.
struct KinectNoise {
  /// Deviation along the axis: axial0 + axial2 * (z - 0.4)^2.
  double axial0_m = 0.0012, axial2_per_m = 0.0019;
  /// Distance of projector and camera, and the steps of the measured disparity.
  double baseline_m = 0.075, disparity_steps_per_px = 8;
  double nearest_m = 0.5, farthest_m = 8;
  /// Share of pixels that get no answer, in patches; more where a surface is `hole_prone` or seen
  /// at a grazing angle.
  double holes = 0.004, holes_in_dark = 0.28;
  /// No value where the projector's light does not reach, left of edges.
  bool shadows = true;
};

namespace synthetic {

/// -1, 0 or 1 pixel; 0 in five of eight.
inline int slip(std::uint64_t bits) {
  const auto v = static_cast<int>(bits & 15);
  return v < 3 ? -1 : v < 6 ? 1 : 0;
}
/// How many deviations under the mean a share of a normal distribution begins; rough.
inline double deviations(double share) {
  return share < 0.5 ? 2.9 * (1 - 2 * share) * (1 - 0.85 * std::sqrt(share)) : 0;
}

}  // namespace synthetic

/// Turns exact depth (CV_32FC1, metres along the axis, 0 = nothing) into what a Kinect-like camera
/// gives: CV_16UC1 in `camera.depth_units_per_m`. `hole_prone` (CV_8UC1, 255 = dark or shiny) may
/// be empty. The same seed gives the same image. O(pixels).
cv::Mat measure_depth(const cv::Mat& exact, const cv::Mat& hole_prone, const Camera& camera,
                      const KinectNoise& noise, std::uint64_t seed);

}  // namespace stillpoint
