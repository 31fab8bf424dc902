// SPDX-License-Identifier: BSD-2-Clause
// The runner: the hook in the other library finds the mask that is computed here, and an error of
// the compiled library is caught as what it is.
#include <cstdio>
#include <stillpoint/backends/orb_slam2.hpp>
#include <stillpoint/backends/orb_slam3.hpp>

#include "slam.hpp"

static_assert(__cplusplus < 201703L, "the host's language is C++14");

int main() {
  cv::Mat descriptors;
  const int all = static_cast<int>(extract(1.0, descriptors).size());
  stillpoint::HostSettings settings;
  settings.min_keypoints = settings.min_keypoints_at_start = 0;
  stillpoint::HostFrontEnd front_end(stillpoint::Camera(), settings);
  stillpoint::RgbdFrame frame;
  frame.color = cv::Mat::zeros(240, 320, CV_8UC3);
  frame.timestamp = 1.0;
  stillpoint::Segmentation people;
  people.available = true;
  people.instances.emplace_back();
  people.instances.back().box = cv::Rect(0, 0, 160, 240);
  people.instances.back().mask = cv::Mat(240, 160, CV_8UC1, cv::Scalar(255));
  front_end.compute_mask(frame, people);
  front_end.correct_pose(1.0, cv::Matx44d::eye());
  const int kept = static_cast<int>(extract(1.0, descriptors).size());
  const int untouched = static_cast<int>(extract(2.0, descriptors).size());
  bool caught = false;
  try {
    front_end.compute_mask(stillpoint::RgbdFrame(), people);
  } catch (const stillpoint::Error&) {
    caught = true;
  }
  std::printf("%d keypoints, %d static, %d without a mask, error %s\n", all, kept, untouched,
              caught ? "caught" : "missed");
  return all == 1200 && kept > 400 && kept < 620 && untouched == all && caught ? 0 : 1;
}
