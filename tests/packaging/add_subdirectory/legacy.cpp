// SPDX-License-Identifier: BSD-2-Clause
#include <opencv2/features2d.hpp>
#include <vector>

#if __cplusplus >= 201703L
#error "the parent's own targets keep the parent's language level"
#endif

std::vector<cv::KeyPoint> legacy_keypoints(const cv::Mat& picture) {
  std::vector<cv::KeyPoint> keypoints;
  cv::FAST(picture, keypoints, 20);
  return keypoints;
}
