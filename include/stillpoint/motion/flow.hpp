// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>

namespace stillpoint::detail {

/// A corner that was followed from the last frame into the new one.
struct Flow {
  Eigen::Vector3f from;     ///< in space, in the last frame's camera, metres
  int x, y;                 ///< in the last frame, pixels of its fine image
  float u, v;               ///< in the new frame, raw pixels
  float flat_u, flat_v;     ///< the same, undistorted
  float depth_m;            ///< in the new frame; 0: not measured
  float depth_tolerance_m;  ///< a greater difference from it is not noise
  float area;               ///< that it stands for in space; 0: it has no say
  float even_area;          ///< the same, shared among the corners of its part of the image
  /// Information of the patch, scaled so that its greater eigenvalue is 1: e^T information e is the
  /// square of an error without its part along an edge, which the patch cannot tell.
  Eigen::Matrix2f information;

  /// In the new frame.
  cv::Point nearest_pixel() const {
    return {static_cast<int>(u + 0.5f), static_cast<int>(v + 0.5f)};
  }
};

}  // namespace stillpoint::detail
