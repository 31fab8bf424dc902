// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "stillpoint/core/instance.hpp"
#include "stillpoint/core/mask.hpp"
#include "stillpoint/testing/flat_scene.hpp"

using stillpoint::box_instance;
using stillpoint::Figure;
using stillpoint::FlatScene;

/// The scene of the tests of adapters: 640 x 480, as hosts need many keypoints; and who walks
/// there.
inline FlatScene large_scene() {
  FlatScene scene;
  scene.size = {640, 480};
  return scene;
}
inline Figure walker(int i) { return {{180 + 6 * i, 100, 150, 340}, 2, 7}; }

/// A result of the segmenter.
inline stillpoint::Segmentation result(std::vector<stillpoint::Instance> instances) {
  stillpoint::Segmentation segmentation;
  segmentation.available = true;
  segmentation.instances = std::move(instances);
  return segmentation;
}

/// The instances as one mask of the whole image, 255 where one of them is.
inline cv::Mat mask_of(const std::vector<stillpoint::Instance>& instances, const cv::Size& size) {
  return stillpoint::mask_from_instances(instances, size);
}

/// A mask of the whole image, 255 in the rectangles.
inline cv::Mat mask_of(const std::vector<cv::Rect>& boxes, const cv::Size& size) {
  cv::Mat all = cv::Mat::zeros(size, CV_8UC1);
  for (const cv::Rect& box : boxes) all(box & cv::Rect(cv::Point(), size)).setTo(255);
  return all;
}

inline int pixels(const cv::Mat& mask) { return cv::countNonZero(mask); }

/// Intersection over union of two masks; 1 if both are empty.
inline double iou(const cv::Mat& a, const cv::Mat& b) {
  const int both = pixels(a & b), any = pixels(a | b);
  return any == 0 ? 1 : static_cast<double>(both) / any;
}

/// True if two images have the same size, type and bytes.
inline bool identical(const cv::Mat& a, const cv::Mat& b) {
  if (a.size() != b.size() || a.type() != b.type()) return false;
  for (int y = 0; y < a.rows; ++y)
    if (!std::equal(a.ptr<uchar>(y),
                    a.ptr<uchar>(y) + a.elemSize() * static_cast<std::size_t>(a.cols),
                    b.ptr<uchar>(y)))
      return false;
  return true;
}
