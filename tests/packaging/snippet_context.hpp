// SPDX-License-Identifier: BSD-2-Clause
#pragma once

// What the snippets of the pages take for granted: a host with images, keypoints and detections.
#include <stillpoint/stillpoint.hpp>
#include <string>
#include <vector>

struct Detection {
  std::string class_name;
  float score;
  cv::Rect box;
  cv::Mat mask;
};

extern cv::Mat color, depth, gray;
extern double timestamp_s;
extern bool network_has_a_result;
extern std::vector<Detection> detections;
extern std::vector<cv::KeyPoint> keypoints;
extern stillpoint::RgbdFrame frame;
extern stillpoint::DynamicMask mask;
extern stillpoint::FrontEnd front_end;
extern stillpoint::Camera camera;
extern stillpoint::Segmenter& segmenter;
