// SPDX-License-Identifier: BSD-2-Clause
#include <opencv2/core.hpp>
#include <stillpoint/keypoints/probabilistic_keypoint_filter.hpp>
#include <vector>

std::vector<cv::KeyPoint> legacy_keypoints(const cv::Mat& picture);

// Keypoints of the parent's OpenCV go into the filter as they are.
std::size_t kept_of_legacy(const cv::Mat& picture, const stillpoint::DynamicMask& mask) {
  stillpoint::ProbabilisticKeypointFilter<> filter;
  return filter.filter(legacy_keypoints(picture), mask).kept.size();
}
