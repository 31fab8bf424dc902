// SPDX-License-Identifier: BSD-2-Clause
#include "slam.hpp"

#include <stillpoint/backends/orb_slam3.hpp>

static_assert(__cplusplus < 201703L, "the host's language is C++14");

std::vector<cv::KeyPoint> extract(double timestamp, cv::Mat& descriptors) {
  std::vector<cv::KeyPoint> keypoints;
  for (int y = 0; y < 240; y += 8)
    for (int x = 0; x < 320; x += 8)
      keypoints.emplace_back(static_cast<float>(x), static_cast<float>(y), 31.0f);
  descriptors = cv::Mat::zeros(static_cast<int>(keypoints.size()), 32, CV_8UC1);
  stillpoint::keep_static(timestamp, keypoints, descriptors);
  return keypoints;
}
