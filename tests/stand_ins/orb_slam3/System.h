// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "../orb_slam.hpp"

namespace Sophus {
/// As much of Sophus::SE3f as the adapter reads.
class SE3f {
 public:
  SE3f() : matrix_(cv::Matx44f::eye()) {}
  explicit SE3f(const cv::Matx44f& matrix) : matrix_(matrix) {}
  cv::Matx44f matrix() const { return matrix_; }

 private:
  cv::Matx44f matrix_;
};
}  // namespace Sophus

namespace ORB_SLAM3 {
class System : public orb_slam_stand_in::System {
 public:
  using orb_slam_stand_in::System::System;
  /// include/System.h:116 and src/System.cc:328: Tcw, whatever the state.
  Sophus::SE3f TrackRGBD(const cv::Mat& im, const cv::Mat& depthmap, const double& timestamp) {
    return Sophus::SE3f(Grab(im, depthmap, timestamp));
  }
};
}  // namespace ORB_SLAM3
