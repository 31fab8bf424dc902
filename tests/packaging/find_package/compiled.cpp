// SPDX-License-Identifier: BSD-2-Clause
#include <cstdio>
#include <stillpoint/front_end.hpp>
#include <utility>
#include <vector>

int main() {
  const cv::Mat color = cv::Mat::zeros(480, 640, CV_8UC3);
  stillpoint::Segmentation people;
  people.available = true;
  people.instances.push_back({"person", 0.9f, cv::Rect(100, 100, 200, 200), cv::Mat()});
  stillpoint::FrontEnd made;
  stillpoint::FrontEnd front_end = std::move(made);
  front_end.compute_mask({color, cv::Mat(), 0}, people);
  const std::vector<cv::Point2f> keypoints{{150, 150}, {500, 400}};
  const std::size_t kept = front_end.select(keypoints).kept.size();
  const int in_mask = front_end.mask().dynamic_at(150, 150);
  std::printf("compiled: %zu keypoints kept, in the mask: %d\n", kept, in_mask);
  return kept == 2 && in_mask ? 0 : 1;  // both: fewer than the floor of kept keypoints
}
