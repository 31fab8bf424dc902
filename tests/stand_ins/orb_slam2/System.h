// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "../orb_slam.hpp"

namespace ORB_SLAM2 {
class System : public orb_slam_stand_in::System {
 public:
  using orb_slam_stand_in::System::System;
  /// include/System.h:73 and src/System.cc:167: Tcw as CV_32F, empty as long as it has none.
  cv::Mat TrackRGBD(const cv::Mat& im, const cv::Mat& depthmap, const double& timestamp) {
    const cv::Matx44f pose = Grab(im, depthmap, timestamp);
    return state < 2 ? cv::Mat() : cv::Mat(pose);
  }
};
}  // namespace ORB_SLAM2
