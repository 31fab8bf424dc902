// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <array>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <string>

#include "stillpoint/backends/ros2/mask_maker.hpp"
#include "stillpoint/backends/ros2/messages.hpp"
#include "stillpoint/core/mask_functions.hpp"

namespace stillpoint::ros2 {

/// An image to publish; `image` is empty where there is none (no depth).
struct OutputImage {
  std::string encoding;
  cv::Mat image;
  /// The message whose header it gets; lives as long as the frame.
  const ImageMessage* like;
};

/// One of the images that a node can publish of each frame.
struct ImageOutput {
  const char* topic;
  /// `mask`: CV_8UC1, 255 = dynamic. The result may share the mask's data. O(pixels).
  OutputImage (*make)(const StreamFrame& frame, const cv::Mat& mask);
};

namespace detail {

inline OutputImage mask_output(const StreamFrame& frame, const cv::Mat& mask) {
  return {"mono8", mask, &frame.color};
}

inline OutputImage static_mask_output(const StreamFrame& frame, const cv::Mat& mask) {
  return {"mono8", static_image(mask), &frame.color};
}

inline OutputImage depth_static_output(const StreamFrame& frame, const cv::Mat& mask) {
  if (!frame.depth) return {"", cv::Mat(), &frame.color};
  const cv::Mat& depth = frame.frame.depth;
  return {depth.depth() == CV_16U ? "16UC1" : "32FC1", masked_depth(depth, mask), &*frame.depth};
}

inline OutputImage color_static_output(const StreamFrame& frame, const cv::Mat& mask) {
  cv::Mat masked = frame.frame.color.clone();
  masked.setTo(0, mask);
  return {masked.channels() == 3 ? "bgr8" : "mono8", masked, &frame.color};
}

inline OutputImage overlay_output(const StreamFrame& frame, const cv::Mat& mask) {
  const cv::Mat& color = frame.frame.color;
  cv::Mat out, red;
  if (color.channels() == 3)
    color.copyTo(out);
  else
    cv::cvtColor(color, out, cv::COLOR_GRAY2BGR);
  cv::addWeighted(out, 0.5, cv::Mat(out.size(), CV_8UC3, cv::Scalar(0, 0, 255)), 0.5, 0, red);
  red.copyTo(out, mask);
  return {"bgr8", out, &frame.color};
}

}  // namespace detail

/// All of them. docs/ros2.md has them in a table.
inline constexpr std::array<ImageOutput, 5> kImageOutputs = {{
    {"mask", detail::mask_output},
    {"static_mask", detail::static_mask_output},
    {"depth_static", detail::depth_static_output},
    {"color_static", detail::color_static_output},
    {"overlay", detail::overlay_output},
}};

}  // namespace stillpoint::ros2
