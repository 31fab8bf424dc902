// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <utility>
#include <vector>

#include "stillpoint/backends/ros2/images.hpp"
#include "stillpoint/backends/ros2/messages.hpp"
#include "stillpoint/core/instance.hpp"
#include "stillpoint/io/mask_folder.hpp"

namespace stillpoint::ros2 {

namespace detail {

// Of a class-per-pixel image: CV_8UC1, 255 where the class is among `dynamic`.
inline cv::Mat pick_labels(const cv::Mat& labels, const std::vector<std::int64_t>& dynamic) {
  cv::Mat picked = cv::Mat::zeros(labels.size(), CV_8UC1);
  for (const std::int64_t label : dynamic) picked |= labels == static_cast<double>(label);
  return picked;
}

// Networks often answer at a smaller size; the shape must be the image's to within a pixel.
inline std::string fit(cv::Mat& labels, cv::Size size) {
  if (labels.size() == size) return "";
  const double x = static_cast<double>(size.width) / labels.cols;
  const double y = static_cast<double>(size.height) / labels.rows;
  if (std::abs(labels.rows * x - size.height) > std::max(x, 1.0) ||
      std::abs(labels.cols * y - size.width) > std::max(y, 1.0))
    return "expected the color image's size " + std::to_string(size.width) + "x" +
           std::to_string(size.height) + ", or one of the same shape, found " +
           std::to_string(labels.cols) + "x" + std::to_string(labels.rows);
  cv::resize(labels, labels, size, 0, 0, cv::INTER_NEAREST);
  return "";
}

inline std::string from_labels(const ImageMessage& message,
                               const std::vector<std::int64_t>& dynamic_labels,
                               const std::string& class_name, cv::Size size, Segmentation& out) {
  cv::Mat labels;
  std::string problem = to_labels(message, labels);
  if (!problem.empty()) return problem;
  if (!dynamic_labels.empty()) {
    labels = pick_labels(labels, dynamic_labels);
  } else if (labels.depth() != CV_8U) {
    double least = 0, most = 0;
    cv::minMaxLoc(labels, &least, &most);
    if (least < 0 || most > 255)
      return "expected instances 1 to 255, found labels from " +
             std::to_string(static_cast<int>(least)) + " to " +
             std::to_string(static_cast<int>(most)) +
             "; if they are classes, name those that move in the parameter dynamic_labels";
    labels.convertTo(labels, CV_8U);
  }
  problem = fit(labels, size);
  if (!problem.empty()) return problem;
  try {
    out.instances = instances_from_labels(labels, class_name);
  } catch (const Error& e) {
    problem = e.what();
  }
  return problem;
}

inline void from_detections(const std::vector<Detection>& detections, cv::Size size,
                            Segmentation& out) {
  const cv::Rect image(cv::Point(), size);
  for (const Detection& d : detections) {
    const double x0 = d.center_x - d.width / 2, y0 = d.center_y - d.height / 2;
    if (!std::isfinite(x0 + y0 + d.width + d.height) || !(d.width > 0) || !(d.height > 0)) continue;
    const auto pixel = [](double v) {
      return static_cast<int>(std::lround(std::max(-1e6, std::min(1e6, v))));
    };
    Instance instance;
    instance.box = cv::Rect(cv::Point(pixel(x0), pixel(y0)),
                            cv::Point(pixel(x0 + d.width), pixel(y0 + d.height))) &
                   image;
    if (instance.box.empty()) continue;
    instance.class_name = d.class_name;
    instance.score = static_cast<float>(std::isfinite(d.score) ? d.score : 0);
    out.instances.push_back(std::move(instance));
  }
}

}  // namespace detail

/// What a network's message says of an image of that size. Label images: 0 = background, k =
/// instance k; with only 0 and 255 in it the connected parts; with `dynamic_labels` the parts of
/// these classes (every instance is then of `class_name`). Another size of the same shape is
/// scaled without interpolation. Boxes are cut to the image; those that make no sense are left out.
///
/// Returns an empty text, or what was expected and found; `out` is then "not available". O(pixels).
inline std::string to_segmentation(const SegmentationMessage& message, cv::Size size,
                                   const std::vector<std::int64_t>& dynamic_labels,
                                   const std::string& class_name, Segmentation& out) {
  out = Segmentation();
  out.timestamp = seconds(message.stamp);
  std::string problem;
  if (message.has_labels)
    problem = detail::from_labels(message.labels, dynamic_labels, class_name, size, out);
  else
    detail::from_detections(message.detections, size, out);
  out.available = problem.empty();
  return problem;
}

}  // namespace stillpoint::ros2
