// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <memory>
#include <opencv2/imgproc.hpp>
#include <rclcpp/rclcpp.hpp>
#include <stillpoint/backends/ros2/camera_stream.hpp>
#include <stillpoint/core/mask_functions.hpp>
#include <string>
#include <utility>

#include "messages.hpp"
#include "objects.hpp"

namespace stillpoint_ros {

/// What is published of each frame, with the header of its color image (depth: of its depth image).
/// But for the mask, only what somebody subscribes to. Messages are handed over, so that a
/// subscriber in the same process gets them without a copy.
class Publishers {
 public:
  explicit Publishers(rclcpp::Node& node)
      : mask_(advertise<Image>(node, "mask")),
        static_mask_(advertise<Image>(node, "static_mask")),
        depth_static_(advertise<Image>(node, "depth_static")),
        color_static_(advertise<Image>(node, "color_static")),
        overlay_(advertise<Image>(node, "overlay")),
        camera_info_(advertise<CameraInfo>(node, "camera_info")),
        objects_(advertise<msg::ObjectArray>(node, "objects")),
        markers_(advertise<MarkerArray>(node, "markers")) {}

  /// `info`: the camera's, if it came. `world_frame`: of the poses.
  void publish(const core::StreamFrame& frame, const stillpoint::FrontEnd& front_end,
               const CameraInfo::ConstSharedPtr& info, const std::string& world_frame) {
    const cv::Mat& mask = front_end.mask().image;
    const cv::Mat& color = frame.frame.color;
    send(mask_, frame.color, "mono8", mask);
    if (is_wanted(static_mask_))
      send(static_mask_, frame.color, "mono8", stillpoint::static_image(mask));
    if (frame.depth && is_wanted(depth_static_))
      send(depth_static_, *frame.depth, frame.frame.depth.depth() == CV_16U ? "16UC1" : "32FC1",
           stillpoint::masked_depth(frame.frame.depth, mask));
    if (is_wanted(color_static_)) {
      cv::Mat masked = color.clone();
      masked.setTo(0, mask);
      send(color_static_, frame.color, color.channels() == 3 ? "bgr8" : "mono8", masked);
    }
    if (is_wanted(overlay_)) send(overlay_, frame.color, "bgr8", overlay(color, mask));
    const auto header = header_of(frame.color);
    if (is_wanted(objects_))
      objects_->publish(to_message(front_end.objects(), header, world_frame));
    if (is_wanted(markers_)) markers_->publish(to_markers(front_end.objects(), header));
    if (info && is_wanted(camera_info_)) {
      auto message = std::make_unique<CameraInfo>(*info);
      message->header = header;
      camera_info_->publish(std::move(message));
    }
  }

 private:
  template <class Message>
  using Publisher = typename rclcpp::Publisher<Message>::SharedPtr;

  template <class Message>
  static Publisher<Message> advertise(rclcpp::Node& node, const std::string& topic) {
    rclcpp::PublisherOptions options;  // a parameter file may choose best_effort
    options.qos_overriding_options = rclcpp::QosOverridingOptions::with_default_policies();
    return node.create_publisher<Message>(topic, rclcpp::QoS(5), options);
  }

  template <class P>
  static bool is_wanted(const P& publisher) {
    return publisher->get_subscription_count() > 0;
  }

  static void send(const Publisher<Image>& publisher, const core::ImageMessage& like,
                   const std::string& encoding, const cv::Mat& image) {
    auto [message, view] = new_image(like, encoding, image.size(), image.type());
    image.copyTo(view);
    publisher->publish(std::move(message));
  }

  static cv::Mat overlay(const cv::Mat& color, const cv::Mat& mask) {
    cv::Mat out, red;
    if (color.channels() == 3)
      color.copyTo(out);
    else
      cv::cvtColor(color, out, cv::COLOR_GRAY2BGR);
    cv::addWeighted(out, 0.5, cv::Mat(out.size(), CV_8UC3, cv::Scalar(0, 0, 255)), 0.5, 0, red);
    red.copyTo(out, mask);
    return out;
  }

  Publisher<Image> mask_, static_mask_, depth_static_, color_static_, overlay_;
  Publisher<CameraInfo> camera_info_;
  Publisher<msg::ObjectArray> objects_;
  Publisher<MarkerArray> markers_;
};

}  // namespace stillpoint_ros
