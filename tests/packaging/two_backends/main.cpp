// SPDX-License-Identifier: BSD-2-Clause
#include <stillpoint/backends/flann_neighbor_search.hpp>
#include <stillpoint/backends/nanoflann_neighbor_search.hpp>
#include <stillpoint/keypoints/probabilistic_keypoint_filter.hpp>
#include <vector>

int main() {
  stillpoint::DynamicMask mask;
  mask.image = cv::Mat::zeros(480, 640, CV_8UC1);
  mask.image(cv::Rect(100, 100, 200, 200)).setTo(255);
  std::vector<cv::KeyPoint> keypoints;
  for (int i = 0; i < 2000; ++i)
    keypoints.emplace_back(static_cast<float>(i * 37 % 640), static_cast<float>(i * 53 % 480), 31);
  stillpoint::ProbabilisticKeypointFilter<stillpoint::FlannNeighborSearch> flann;
  stillpoint::ProbabilisticKeypointFilter<stillpoint::NanoflannNeighborSearch> nanoflann;
  stillpoint::ProbabilisticKeypointFilter<> grid;
  const auto& expected = grid.filter(keypoints, mask).kept;
  const bool same = flann.filter(keypoints, mask).kept == expected &&
                    nanoflann.filter(keypoints, mask).kept == expected;
  return same && !expected.empty() ? 0 : 1;
}
