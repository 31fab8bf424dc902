// SPDX-License-Identifier: BSD-2-Clause
// A user's program of two translation units, both of which include the library.
#include <cstdio>

#include "other.hpp"

int main() {
  stillpoint::DynamicMask mask;
  mask.image = cv::Mat::zeros(480, 640, CV_8UC1);
  mask.image(cv::Rect(100, 100, 200, 200)).setTo(255);
  const std::vector<cv::Point2f> keypoints{{150, 150}, {500, 400}};
  const int kept = count_kept(keypoints, mask);
  std::printf("stillpoint %s: %d of %zu keypoints kept\n", STILLPOINT_VERSION, kept,
              keypoints.size());
  return kept == 1 ? 0 : 1;
}
