// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <opencv2/core.hpp>

#include "stillpoint/motion/depth_shot.hpp"

namespace stillpoint {

/// A depth image of the last seconds in cells, with its pose.
struct DepthKeyView {
  DepthShot shot;
  /// Depth of the static surface in each cell, metres; kNoSurface, or kHole beyond the range of the
  /// sensor.
  cv::Mat_<float> surface_m;
  /// Where the surface did not touch anything dynamic: 1, else 0.
  cv::Mat_<uchar> alone;
  /// Up to which depth a cell and its eight neighbors are free, metres; 0: not known.
  cv::Mat_<float> free_to_m;
  /// Mean brightness of each cell; empty: not known.
  cv::Mat_<uchar> gray;

  static constexpr float kNoSurface = -1e9f, kHole = -2e9f;
};

}  // namespace stillpoint
