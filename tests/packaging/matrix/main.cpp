// SPDX-License-Identifier: BSD-2-Clause
// A user's program as the quick start has it, compiled with all the warnings that he may have on.
#include <stillpoint/stillpoint.hpp>

int main() {
  const cv::Mat color = cv::Mat::zeros(480, 640, CV_8UC3);
  const cv::Mat depth = cv::Mat::zeros(480, 640, CV_16UC1);
  const double timestamp_s = 0.1;
  const stillpoint::RgbdFrame frame{color, depth, timestamp_s};
  stillpoint::Segmentation people;
  people.available = true;
  people.timestamp = timestamp_s;
  people.instances.push_back({"person", 0.9f, cv::Rect(10, 20, 30, 40), cv::Mat()});
  people.instances.push_back({"person", 0.9f, cv::Rect(90, 20, 30, 40)});
  std::vector<cv::Point2f> keypoints;
  stillpoint::FrontEnd front_end;
  front_end.compute_mask(frame, people);
  stillpoint::compact(keypoints, front_end.select(keypoints));
  front_end.compute_mask({color, depth, timestamp_s + 0.1}, {true, timestamp_s + 0.1});
  front_end.correct_pose(Eigen::Isometry3d::Identity());
  stillpoint::SegmentationCompensator compensator;
  stillpoint::DepthMaskFuser fuser({}, {});
  const stillpoint::DynamicMask& mask = fuser.fuse(frame, compensator.compensate(frame, people));
  stillpoint::ProbabilisticKeypointFilter<> filter;
  stillpoint::compact(keypoints, filter.filter(keypoints, mask));
}
