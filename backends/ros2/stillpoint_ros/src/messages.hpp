// SPDX-License-Identifier: BSD-2-Clause
#pragma once

// Between ROS messages and what the core takes and gives. Received images share their bytes.

#include <algorithm>
#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <rclcpp/rclcpp.hpp>
#include <sensor_msgs/msg/camera_info.hpp>
#include <sensor_msgs/msg/image.hpp>
#include <stillpoint/backends/ros2/messages.hpp>
#include <stillpoint/backends/ros2/parameters.hpp>
#include <string>
#include <utility>
#include <vision_msgs/msg/detection2_d_array.hpp>

namespace stillpoint_ros {

namespace core = stillpoint::ros2;
using sensor_msgs::msg::CameraInfo;
using sensor_msgs::msg::Image;

inline core::Nanoseconds stamp_of(const std_msgs::msg::Header& header) {
  return static_cast<core::Nanoseconds>(header.stamp.sec) * 1000000000 + header.stamp.nanosec;
}

inline core::ImageMessage from_ros(const Image::ConstSharedPtr& message) {
  core::ImageMessage m;
  m.stamp = stamp_of(message->header);
  m.frame_id = message->header.frame_id;
  m.encoding = message->encoding;
  m.width = message->width, m.height = message->height, m.step = message->step;
  m.big_endian = message->is_bigendian != 0;
  m.data = message->data.data(), m.bytes = message->data.size();
  m.owner = message;
  return m;
}

inline core::CameraInfoMessage from_ros(const CameraInfo& message) {
  core::CameraInfoMessage m;
  m.width = message.width, m.height = message.height;
  m.distortion_model = message.distortion_model;
  m.d = message.d, m.k = message.k, m.p = message.p;
  m.binning_x = message.binning_x, m.binning_y = message.binning_y;
  m.roi_x = message.roi.x_offset, m.roi_y = message.roi.y_offset;
  m.roi_width = message.roi.width, m.roi_height = message.roi.height;
  return m;
}

inline core::SegmentationMessage from_ros(const vision_msgs::msg::Detection2DArray& message) {
  core::SegmentationMessage m;
  m.stamp = stamp_of(message.header);
  for (const auto& detection : message.detections) {
    core::Detection d;
    d.center_x = detection.bbox.center.position.x, d.center_y = detection.bbox.center.position.y;
    d.width = detection.bbox.size_x, d.height = detection.bbox.size_y;
    d.score = -1;
    for (const auto& result : detection.results)
      if (result.hypothesis.score > d.score)
        d.class_name = result.hypothesis.class_id, d.score = result.hypothesis.score;
    if (!detection.results.empty()) m.detections.push_back(std::move(d));
  }
  return m;
}

/// A header of a color or depth image.
inline std_msgs::msg::Header header_of(const core::ImageMessage& image) {
  std_msgs::msg::Header header;
  header.stamp.sec = static_cast<std::int32_t>(image.stamp / 1000000000);
  header.stamp.nanosec = static_cast<std::uint32_t>(image.stamp % 1000000000);
  header.frame_id = image.frame_id;
  return header;
}

/// A message for an image of that size and type, and a view of its bytes to write them in place.
inline std::pair<std::unique_ptr<Image>, cv::Mat> new_image(const core::ImageMessage& like,
                                                            const std::string& encoding,
                                                            cv::Size size, int type) {
  auto message = std::make_unique<Image>();
  message->header = header_of(like);
  message->encoding = encoding;
  message->width = static_cast<std::uint32_t>(size.width);
  message->height = static_cast<std::uint32_t>(size.height);
  message->step = message->width * static_cast<std::uint32_t>(CV_ELEM_SIZE(type));
  message->is_bigendian = core::detail::host_is_big_endian();
  message->data.resize(static_cast<std::size_t>(message->step) * message->height);
  cv::Mat view(size, type, message->data.data());
  return {std::move(message), view};
}

inline rclcpp::ParameterValue to_ros(const core::ParameterValue& value) {
  return std::visit([](const auto& v) { return rclcpp::ParameterValue(v); }, value);
}

/// Throws rclcpp::ParameterTypeException for a type that no parameter has.
inline core::ParameterValue from_ros(const rclcpp::Parameter& parameter) {
  switch (parameter.get_type()) {
    case rclcpp::PARAMETER_BOOL:
      return parameter.as_bool();
    case rclcpp::PARAMETER_INTEGER:
      return parameter.as_int();
    case rclcpp::PARAMETER_DOUBLE:
      return parameter.as_double();
    case rclcpp::PARAMETER_STRING_ARRAY:
      return parameter.as_string_array();
    case rclcpp::PARAMETER_INTEGER_ARRAY:
      return parameter.as_integer_array();
    default:
      return parameter.as_string();
  }
}

}  // namespace stillpoint_ros
