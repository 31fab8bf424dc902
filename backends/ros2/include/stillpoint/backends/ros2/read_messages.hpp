// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <string>
#include <utility>

#include "stillpoint/backends/ros2/messages.hpp"
#include "stillpoint/backends/ros2/parameters.hpp"

// From ROS 2 messages to the structs of messages.hpp. Templates, so that no header of ROS is needed
// here: each takes any type with the fields of the message that its comment names.

namespace stillpoint::ros2 {

/// std_msgs/Header.
template <class Header>
Nanoseconds stamp_of(const Header& header) {
  return static_cast<Nanoseconds>(header.stamp.sec) * 1000000000 +
         static_cast<Nanoseconds>(header.stamp.nanosec);
}

/// sensor_msgs/Image. The result shares its bytes and keeps it alive.
template <class Image>
ImageMessage read_image(const std::shared_ptr<const Image>& message) {
  ImageMessage m;
  m.stamp = stamp_of(message->header);
  m.frame_id = message->header.frame_id;
  m.encoding = message->encoding;
  m.width = message->width, m.height = message->height, m.step = message->step;
  m.big_endian = message->is_bigendian != 0;
  m.data = message->data.data(), m.bytes = message->data.size();
  m.owner = message;
  return m;
}

/// sensor_msgs/CameraInfo.
template <class CameraInfo>
CameraInfoMessage read_camera_info(const CameraInfo& message) {
  CameraInfoMessage m;
  m.width = message.width, m.height = message.height;
  m.distortion_model = message.distortion_model;
  m.d = message.d, m.k = message.k, m.p = message.p;
  m.binning_x = message.binning_x, m.binning_y = message.binning_y;
  m.roi_x = message.roi.x_offset, m.roi_y = message.roi.y_offset;
  m.roi_width = message.roi.width, m.roi_height = message.roi.height;
  return m;
}

/// sensor_msgs/Image: a label image.
template <class Image>
SegmentationMessage read_labels(const std::shared_ptr<const Image>& message) {
  SegmentationMessage m;
  m.stamp = stamp_of(message->header);
  m.has_labels = true;
  m.labels = read_image(message);
  return m;
}

/// vision_msgs/Detection2DArray. Each box gets its most probable class; boxes without one are left
/// out.
template <class Detection2DArray>
SegmentationMessage read_detections(const Detection2DArray& message) {
  SegmentationMessage m;
  m.stamp = stamp_of(message.header);
  for (const auto& detection : message.detections) {
    if (detection.results.empty()) continue;
    Detection d;
    d.center_x = detection.bbox.center.position.x, d.center_y = detection.bbox.center.position.y;
    d.width = detection.bbox.size_x, d.height = detection.bbox.size_y;
    d.score = -1;
    for (const auto& result : detection.results)
      if (result.hypothesis.score > d.score)
        d.class_name = result.hypothesis.class_id, d.score = result.hypothesis.score;
    m.detections.push_back(std::move(d));
  }
  return m;
}

/// geometry_msgs/Vector3 or Point, and Quaternion.
template <class Vector, class Quaternion>
Eigen::Isometry3d read_transform(const Vector& p, const Quaternion& q) {
  return Eigen::Translation3d(p.x, p.y, p.z) * Eigen::Quaterniond(q.w, q.x, q.y, q.z).normalized();
}

/// rcl_interfaces/ParameterValue: sets the parameter `name`, as set_parameter() does.
template <class Value>
std::string read_parameter(const std::string& name, const Value& value, Parameters& parameters) {
  switch (value.type) {  // rcl_interfaces/ParameterType
    case 1:
      return set_parameter(parameters, name, value.bool_value);
    case 2:
      return set_parameter(parameters, name, value.integer_value);
    case 3:
      return set_parameter(parameters, name, value.double_value);
    case 4:
      return set_parameter(parameters, name, value.string_value);
    case 7:
      return set_parameter(parameters, name, value.integer_array_value);
    case 9:
      return set_parameter(parameters, name, value.string_array_value);
    default:
      return "parameter " + name +
             ": expected true or false, a number, a text, or a list of texts "
             "or of whole numbers, found the type " +
             std::to_string(value.type);
  }
}

}  // namespace stillpoint::ros2
