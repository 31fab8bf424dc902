// SPDX-License-Identifier: BSD-2-Clause
#pragma once

// Written from the structure of ORB_SLAM2 (f2e6f51) and ORB_SLAM3 (4452a3c) as far as the adapters
// touch it: the same member names, types and order of calls, C++14. It extracts and filters as they
// do; it tracks nothing: its pose is what `pose_of` says.

#include <cstdio>
#include <functional>
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <utility>
#include <vector>

#include "stillpoint/backends/host.hpp"

namespace orb_slam_stand_in {

/// Mirrors the RGB-D constructor of Frame: ORB_SLAM3 src/Frame.cc:200-285, ORB_SLAM2
/// src/Frame.cc:119-170.
class Frame {
 public:
  Frame() = default;
  Frame(const cv::Mat& imGray, const cv::Mat& imDepth, const double& timeStamp, int nFeatures)
      : mTimeStamp(timeStamp) {
    ExtractORB(imGray, nFeatures);  // v3:222, v2:136

    stillpoint::keep_static(timeStamp, mvKeys, mDescriptors);  // the one line of the adapter

    N = static_cast<int>(mvKeys.size());  // v3:230, v2:138
    if (mvKeys.empty()) return;           // v3:232, v2:140
    mvKeysUn = mvKeys;                    // UndistortKeyPoints, v3:235, v2:143
    ComputeStereoFromRGBD(imDepth);       // v3:237, v2:145
    complete = true;
  }

  double mTimeStamp = 0;
  int N = 0;
  std::vector<cv::KeyPoint> mvKeys, mvKeysUn;
  std::vector<float> mvDepth;
  cv::Mat mDescriptors;
  bool complete = false;  // not of the hosts: the constructor got to its end

 private:
  void ExtractORB(const cv::Mat& im, int nFeatures) {
    cv::ORB::create(nFeatures, 1.2f, 8)->detectAndCompute(im, cv::noArray(), mvKeys, mDescriptors);
  }
  void ComputeStereoFromRGBD(const cv::Mat& imDepth) {
    mvDepth.assign(static_cast<std::size_t>(N), -1.0f);
    for (std::size_t i = 0; i < mvKeys.size(); ++i)
      mvDepth[i] =
          imDepth.at<float>(static_cast<int>(mvKeys[i].pt.y), static_cast<int>(mvKeys[i].pt.x));
  }
};

/// Mirrors System and the part of Tracking that it calls: GrabImageRGBD (grey image, depth in
/// metres, Frame) and the start with more than 500 keypoints (v3 Tracking.cc:2337, v2 :511).
class System {
 public:
  enum eSensor { MONOCULAR = 0, STEREO = 1, RGBD = 2 };
  System(const std::string&, const std::string&, const eSensor, const bool = true) {}
  int GetTrackingState() { return state; }
  void Shutdown() {}
  void SaveTrajectoryTUM(const std::string& filename) {
    if (std::FILE* file = std::fopen(filename.c_str(), "w")) {
      for (const double t : tracked) std::fprintf(file, "%.6f 0 0 0 0 0 0 1\n", t);  // stands still
      std::fclose(file);
    }
  }

  // Not of the hosts.
  std::function<cv::Matx44f(double)> pose_of = [](double) { return cv::Matx44f::eye(); };
  int features = 2000;
  float depth_units_per_m = 5000;
  int state = 0;  // NO_IMAGES_YET
  Frame frame;
  std::vector<double> tracked;

 protected:
  cv::Matx44f Grab(const cv::Mat& im, const cv::Mat& depthmap, double timestamp) {
    cv::Mat gray = im, depth = depthmap;
    if (im.channels() == 3) cv::cvtColor(im, gray, cv::COLOR_RGB2GRAY);
    if (depth.type() != CV_32F) depth.convertTo(depth, CV_32F, 1 / depth_units_per_m);
    frame = Frame(gray, depth, timestamp, features);
    const bool was_started = state >= 2;
    state = was_started ? (frame.N >= 30 ? 2 : 3) : (frame.N > 500 ? 2 : 1);
    if (state == 2) tracked.push_back(timestamp);
    return pose_of(timestamp);
  }
};

}  // namespace orb_slam_stand_in
