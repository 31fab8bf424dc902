// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstdio>
#include <geometry_msgs/msg/point.hpp>
#include <stillpoint/core/object.hpp>
#include <stillpoint_ros/msg/object_array.hpp>
#include <string>
#include <vector>
#include <visualization_msgs/msg/marker_array.hpp>

namespace stillpoint_ros {

using visualization_msgs::msg::Marker;
using visualization_msgs::msg::MarkerArray;

inline geometry_msgs::msg::Point to_point(const Eigen::Vector3d &p) {
  geometry_msgs::msg::Point out;
  out.x = p.x(), out.y = p.y(), out.z = p.z();
  return out;
}

inline msg::ObjectState to_message(const stillpoint::ObjectState &state) {
  msg::ObjectState m;
  m.position = to_point(state.centroid_m);
  m.velocity.x = state.velocity_m_s.x();
  m.velocity.y = state.velocity_m_s.y();
  m.velocity.z = state.velocity_m_s.z();
  for (int row = 0; row < 6; ++row)
    for (int column = 0; column < 6; ++column)
      m.covariance[static_cast<std::size_t>(6 * row + column)] = state.covariance(row, column);
  return m;
}

inline msg::Object to_message(const stillpoint::DynamicObject &object) {
  msg::Object m;
  m.id = object.id;
  m.class_name = object.class_name;
  m.score = object.score;
  m.predicted = object.predicted;
  m.tracked_s = static_cast<float>(object.tracked_s);
  m.unseen_s = static_cast<float>(object.unseen_s);
  m.x = object.box.x, m.y = object.box.y;
  m.width = object.box.width, m.height = object.box.height;
  if (object.in_camera) m.in_camera.push_back(to_message(*object.in_camera));
  if (object.in_world) m.in_world.push_back(to_message(*object.in_world));
  return m;
}

inline msg::ObjectArray to_message(const std::vector<stillpoint::DynamicObject> &objects,
                                   const std_msgs::msg::Header &header,
                                   const std::string &world_frame) {
  msg::ObjectArray m;
  m.header = header;
  m.world_frame = world_frame;
  for (const stillpoint::DynamicObject &object : objects) m.objects.push_back(to_message(object));
  return m;
}

/// For RViz, in the camera's frame: a sphere at each centroid, an arrow to
/// where it will be in a second, and id, class and speed as text.
inline MarkerArray to_markers(const std::vector<stillpoint::DynamicObject> &objects,
                              const std_msgs::msg::Header &header) {
  MarkerArray all;
  const auto add = [&](const char *name, int id, int type, double size) -> Marker & {
    all.markers.emplace_back();
    Marker &m = all.markers.back();
    m.header = header;
    m.ns = name, m.id = id, m.type = type;
    m.scale.x = m.scale.y = m.scale.z = size;
    m.color.r = 1, m.color.g = 0.3f, m.color.a = 0.8f;
    m.pose.orientation.w = 1;
    return m;
  };
  add("", 0, Marker::SPHERE, 1).action = Marker::DELETEALL;
  for (const stillpoint::DynamicObject &object : objects) {
    if (!object.in_camera) continue;
    const Eigen::Vector3d p = object.in_camera->centroid_m, v = object.in_camera->velocity_m_s;
    add("place", object.id, Marker::SPHERE, 0.3).pose.position = to_point(p);
    Marker &arrow = add("velocity", object.id, Marker::ARROW, 0);
    arrow.scale.x = 0.05, arrow.scale.y = 0.1;
    arrow.points = {to_point(p), to_point(p + v)};
    char text[96];
    std::snprintf(text, sizeof text, "%d %.40s %.1f m/s", object.id, object.class_name.c_str(),
                  v.norm());
    Marker &label = add("name", object.id, Marker::TEXT_VIEW_FACING, 0.2);
    label.pose.position = to_point(p - Eigen::Vector3d(0, 0.4, 0));
    label.text = text;
  }
  return all;
}

}  // namespace stillpoint_ros
