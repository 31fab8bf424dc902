// SPDX-License-Identifier: BSD-2-Clause
#pragma once

// A folder in TUM layout, with masks, as messages.

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <geometry_msgs/msg/transform_stamped.hpp>
#include <memory>
#include <nav_msgs/msg/odometry.hpp>
#include <opencv2/core.hpp>
#include <optional>
#include <sensor_msgs/msg/camera_info.hpp>
#include <sensor_msgs/msg/image.hpp>
#include <stillpoint/backends/mask_files.hpp>
#include <stillpoint/backends/ros2/messages.hpp>
#include <stillpoint/backends/ros2/parameters.hpp>
#include <stillpoint/front_end.hpp>
#include <stillpoint/io/tum_sequence.hpp>
#include <string>
#include <vector>

namespace stillpoint_ros {

using sensor_msgs::msg::CameraInfo;
using sensor_msgs::msg::Image;

inline Image to_message(const cv::Mat& image, const std::string& encoding, std::int64_t stamp) {
  Image m;
  m.header.stamp.sec = static_cast<std::int32_t>(stamp / 1000000000);
  m.header.stamp.nanosec = static_cast<std::uint32_t>(stamp % 1000000000);
  m.header.frame_id = "camera";
  m.encoding = encoding;
  m.width = static_cast<std::uint32_t>(image.cols);
  m.height = static_cast<std::uint32_t>(image.rows);
  m.step = static_cast<std::uint32_t>(image.step);
  const std::uint8_t* const bytes = image.data;  // whole images have no gaps
  m.data.assign(bytes, bytes + image.total() * image.elemSize());
  return m;
}

inline CameraInfo to_message(const stillpoint::Camera& camera, std::int64_t stamp) {
  CameraInfo m;
  m.header = to_message(cv::Mat(1, 1, CV_8UC1), "mono8", stamp).header;
  m.width = static_cast<std::uint32_t>(camera.width);
  m.height = static_cast<std::uint32_t>(camera.height);
  m.distortion_model = "plumb_bob";
  m.d = {camera.k1, camera.k2, camera.p1, camera.p2, camera.k3};
  m.k = {camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1};
  return m;
}

/// How the body's poses are told: the camera is mounted on it, somewhere and turned.
inline Eigen::Isometry3d camera_on_body() {
  return Eigen::Translation3d(0.1, -0.2, 1) * Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5);
}

/// geometry_msgs/Transform, or Pose.
template <class Vector, class Quaternion>
void write_transform(const Eigen::Isometry3d& T, Vector& p, Quaternion& q) {
  const Eigen::Quaterniond rotation(T.linear());
  p.x = T.translation().x(), p.y = T.translation().y(), p.z = T.translation().z();
  q.x = rotation.x(), q.y = rotation.y(), q.z = rotation.z(), q.w = rotation.w();
}

inline geometry_msgs::msg::TransformStamped transform_message(const Eigen::Isometry3d& T,
                                                              const std::string& parent,
                                                              const std::string& child,
                                                              std::int64_t stamp) {
  geometry_msgs::msg::TransformStamped m;
  m.header = to_message(cv::Mat(1, 1, CV_8UC1), "mono8", stamp).header;
  m.header.frame_id = parent, m.child_frame_id = child;
  write_transform(T, m.transform.translation, m.transform.rotation);
  return m;
}

inline nav_msgs::msg::Odometry odometry_message(const Eigen::Isometry3d& T_odom_base,
                                                std::int64_t stamp) {
  nav_msgs::msg::Odometry m;
  m.header = to_message(cv::Mat(1, 1, CV_8UC1), "mono8", stamp).header;
  m.header.frame_id = "odom", m.child_frame_id = "base";
  write_transform(T_odom_base, m.pose.pose.position, m.pose.pose.orientation);
  return m;
}

/// The frames of a folder, held in memory, and what the front end makes of them without ROS.
class Recording {
 public:
  struct Frame {
    std::int64_t stamp;
    stillpoint::RgbdFrame images;
    std::optional<cv::Mat> labels;  ///< Nothing: the network has no result.
    /// Of groundtruth.txt; nothing: it has none of that time.
    std::optional<Eigen::Isometry3d> T_world_camera;
  };

  Recording(const std::filesystem::path& folder, const std::filesystem::path& masks,
            std::size_t most)
      : sequence_(folder), camera_(sequence_.camera().value_or(stillpoint::Camera::tum_fr3())) {
    const stillpoint::Trajectory truth =
        sequence_.has_groundtruth() ? sequence_.groundtruth() : stillpoint::Trajectory();
    for (std::size_t i = 0; i < std::min(most, sequence_.size()); ++i) {
      Frame frame;
      frame.images = sequence_.load(i);
      frame.stamp = stillpoint::ros2::nanoseconds(frame.images.timestamp);
      const auto file = stillpoint::mask_path(masks, sequence_.entry(i).stem);
      if (std::filesystem::exists(file))
        frame.labels = stillpoint::read_labels(file, frame.images.color.size());
      for (const stillpoint::StampedPose& pose : truth)
        if (std::abs(pose.timestamp - frame.images.timestamp) < 1e-3)
          frame.T_world_camera = pose.T_world_camera;
      frames_.push_back(std::move(frame));
      stems_.push_back(sequence_.entry(i).stem);
    }
  }

  const stillpoint::Camera& camera() const { return camera_; }
  const std::vector<Frame>& frames() const { return frames_; }

  /// The masks that `stillpoint mask` wrote.
  std::vector<cv::Mat> masks(const std::filesystem::path& folder) const {
    std::vector<cv::Mat> out;
    for (std::size_t i = 0; i < frames_.size(); ++i)
      out.push_back(stillpoint::read_mask(stillpoint::mask_path(folder, stems_[i]),
                                          frames_[i].images.color.size()));
    return out;
  }

  /// The masks of one pass, by the front end without ROS. `poses`: it is told those of the frames.
  std::vector<cv::Mat> masks(const stillpoint::ros2::Parameters& parameters, bool poses) const {
    stillpoint::FrontEnd front_end(parameters.front_end(), camera_);
    std::vector<cv::Mat> out;
    std::optional<Eigen::Isometry3d> T_now, T_last, T_current_last;
    for (const Frame& frame : frames_) {
      stillpoint::Segmentation segmentation;
      segmentation.available = frame.labels.has_value();
      if (frame.labels) segmentation.instances = stillpoint::instances_from_labels(*frame.labels);
      T_last = T_now, T_current_last.reset();
      T_now = poses ? frame.T_world_camera : std::nullopt;
      if (T_now && T_last) T_current_last = T_now->inverse() * *T_last;
      out.push_back(
          front_end.compute_mask(frame.images, segmentation, T_current_last).image.clone());
      if (T_now) front_end.correct_pose(*T_now);
    }
    return out;
  }

 private:
  stillpoint::TumSequence sequence_;
  stillpoint::Camera camera_;
  std::vector<Frame> frames_;
  std::vector<std::string> stems_;
};

}  // namespace stillpoint_ros
