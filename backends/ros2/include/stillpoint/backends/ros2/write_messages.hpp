// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <opencv2/core.hpp>
#include <string>
#include <utility>
#include <vector>

#include "stillpoint/backends/ros2/diagnostics.hpp"
#include "stillpoint/backends/ros2/images.hpp"
#include "stillpoint/backends/ros2/messages.hpp"
#include "stillpoint/core/object.hpp"

// From results to ROS 2 messages. Templates, as in read_messages.hpp. `out` is a message that has
// just been made.

namespace stillpoint::ros2 {

/// std_msgs/Header: that of an image.
template <class Header>
void write_header(const ImageMessage& like, Header& out) {
  out.stamp.sec = static_cast<std::int32_t>(like.stamp / 1000000000);
  out.stamp.nanosec = static_cast<std::uint32_t>(like.stamp % 1000000000);
  out.frame_id = like.frame_id;
}

/// sensor_msgs/Image, with the header of `like`. O(pixels).
template <class Image>
void write_image(const ImageMessage& like, const std::string& encoding, const cv::Mat& image,
                 Image& out) {
  write_header(like, out.header);
  out.encoding = encoding;
  out.width = static_cast<std::uint32_t>(image.cols);
  out.height = static_cast<std::uint32_t>(image.rows);
  out.step = out.width * static_cast<std::uint32_t>(image.elemSize());
  out.is_bigendian = detail::host_is_big_endian();
  out.data.resize(static_cast<std::size_t>(out.step) * out.height);
  cv::Mat view(image.size(), image.type(), out.data.data());
  image.copyTo(view);
}

/// geometry_msgs/Point or Vector3.
template <class Vector>
void write_vector(const Eigen::Vector3d& v, Vector& out) {
  out.x = v.x(), out.y = v.y(), out.z = v.z();
}

/// stillpoint_ros/ObjectState.
template <class State>
void write_state(const ObjectState& state, State& out) {
  write_vector(state.centroid_m, out.position);
  write_vector(state.velocity_m_s, out.velocity);
  for (int row = 0; row < 6; ++row)
    for (int column = 0; column < 6; ++column)
      out.covariance[static_cast<std::size_t>(6 * row + column)] = state.covariance(row, column);
}

/// stillpoint_ros/Object.
template <class Object>
void write_object(const DynamicObject& object, Object& out) {
  out.id = object.id;
  out.class_name = object.class_name;
  out.score = object.score;
  out.predicted = object.predicted;
  out.tracked_s = static_cast<float>(object.tracked_s);
  out.unseen_s = static_cast<float>(object.unseen_s);
  out.x = object.box.x, out.y = object.box.y;
  out.width = object.box.width, out.height = object.box.height;
  const auto add = [](const auto& state, auto& list) {
    if (!state) return;
    list.resize(1);
    write_state(*state, list[0]);
  };
  add(object.in_camera, out.in_camera);
  add(object.in_world, out.in_world);
}

/// stillpoint_ros/ObjectArray, with the header of `like`.
template <class ObjectArray>
void write_objects(const std::vector<DynamicObject>& objects, const ImageMessage& like,
                   const std::string& world_frame, ObjectArray& out) {
  write_header(like, out.header);
  out.world_frame = world_frame;
  out.objects.resize(objects.size());
  for (std::size_t i = 0; i < objects.size(); ++i) write_object(objects[i], out.objects[i]);
}

/// visualization_msgs/MarkerArray for RViz, in the camera's frame: a sphere at each centroid, an
/// arrow to where it will be in a second, and id, class and speed as text. Those of earlier frames
/// are deleted.
template <class MarkerArray>
void write_markers(const std::vector<DynamicObject>& objects, const ImageMessage& like,
                   MarkerArray& out) {
  using Marker = typename decltype(out.markers)::value_type;
  const auto add = [&](const char* name, int id, int type, double size) -> Marker& {
    out.markers.emplace_back();
    Marker& m = out.markers.back();
    write_header(like, m.header);
    m.ns = name, m.id = id, m.type = type;
    m.scale.x = m.scale.y = m.scale.z = size;
    m.color.r = 1, m.color.g = 0.3f, m.color.a = 0.8f;
    m.pose.orientation.w = 1;
    return m;
  };
  add("", 0, Marker::SPHERE, 1).action = Marker::DELETEALL;
  for (const DynamicObject& object : objects) {
    if (!object.in_camera) continue;
    const Eigen::Vector3d p = object.in_camera->centroid_m, v = object.in_camera->velocity_m_s;
    write_vector(p, add("place", object.id, Marker::SPHERE, 0.3).pose.position);
    Marker& arrow = add("velocity", object.id, Marker::ARROW, 0);
    arrow.scale.x = 0.05, arrow.scale.y = 0.1;
    arrow.points.resize(2);
    write_vector(p, arrow.points[0]), write_vector(p + v, arrow.points[1]);
    char text[96];
    std::snprintf(text, sizeof text, "%d %.40s %.1f m/s", object.id, object.class_name.c_str(),
                  v.norm());
    Marker& label = add("name", object.id, Marker::TEXT_VIEW_FACING, 0.2);
    write_vector(p - Eigen::Vector3d(0, 0.4, 0), label.pose.position);
    label.text = text;
  }
}

/// diagnostic_msgs/DiagnosticStatus.
template <class DiagnosticStatus>
void write_diagnostics(const DiagnosticReport& report, const std::string& name,
                       DiagnosticStatus& out) {
  out.level = static_cast<decltype(out.level)>(report.level);
  out.name = name;
  out.message = report.message;
  out.hardware_id = "none";
  out.values.resize(report.values.size());
  for (std::size_t i = 0; i < report.values.size(); ++i)
    out.values[i].key = report.values[i].first, out.values[i].value = report.values[i].second;
}

}  // namespace stillpoint::ros2
