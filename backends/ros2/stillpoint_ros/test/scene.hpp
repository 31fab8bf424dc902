// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <stillpoint/backends/ros2/messages.hpp>
#include <stillpoint/backends/ros2/parameters.hpp>
#include <stillpoint/front_end.hpp>
#include <stillpoint/io/mask_folder.hpp>
#include <vector>

namespace stillpoint_ros {

constexpr std::int64_t kStart = 1341846313000000000, kStep = 33333333;

inline stillpoint::Camera camera() {
  stillpoint::Camera c;
  c.fx = c.fy = 262.5, c.cx = 159.5, c.cy = 119.5, c.width = 320, c.height = 240;
  return c;
}

// A textured figure that walks before a textured wall.
struct Scene {
  cv::Mat wall, figure;
  Scene() : wall(240, 320, CV_8UC3), figure(160, 80, CV_8UC3) {
    cv::RNG random(5);
    random.fill(wall, cv::RNG::UNIFORM, 0, 255);
    random.fill(figure, cv::RNG::UNIFORM, 0, 255);
  }
  static cv::Rect place(int i) { return {40 + 3 * i, 60, 80, 160}; }
  cv::Mat color(int i) const {
    cv::Mat out = wall.clone();
    figure.copyTo(out(place(i)));
    return out;
  }
  static cv::Mat depth(int i) {
    cv::Mat out(240, 320, CV_16UC1, cv::Scalar(4000));
    out(place(i)).setTo(2000);
    return out;
  }
  static cv::Mat labels(int i) {
    cv::Mat out = cv::Mat::zeros(240, 320, CV_8UC1);
    out(place(i)).setTo(1);
    return out;
  }
};
inline const Scene& scene() {
  static const Scene one;
  return one;
}

// What the front end makes of the scene without ROS.
inline std::vector<cv::Mat> expected(int count) {
  stillpoint::FrontEnd front_end(stillpoint::ros2::Parameters().front_end(), camera());
  std::vector<cv::Mat> out;
  for (int i = 0; i < count; ++i) {
    stillpoint::RgbdFrame frame{scene().color(i), Scene::depth(i),
                                stillpoint::ros2::seconds(kStart + i * kStep), 1000};
    stillpoint::Segmentation segmentation;
    segmentation.available = true;
    segmentation.instances = stillpoint::instances_from_labels(Scene::labels(i));
    out.push_back(front_end.compute_mask(frame, segmentation).image.clone());
  }
  return out;
}

}  // namespace stillpoint_ros
