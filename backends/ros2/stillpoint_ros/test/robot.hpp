// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <class_loader/class_loader.hpp>
#include <cstdint>
#include <cstring>
#include <image_transport/image_transport.hpp>
#include <memory>
#include <opencv2/core.hpp>
#include <rclcpp/rclcpp.hpp>
#include <rclcpp_components/node_factory.hpp>
#include <stillpoint/backends/ros2/read_messages.hpp>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "recording.hpp"
#include "scene.hpp"

namespace stillpoint_ros {

using namespace std::chrono_literals;

// The component as a container loads it, by its name.
inline std::shared_ptr<rclcpp_components::NodeInstanceWrapper> load_node(
    const std::string& space, bool intra_process, std::vector<rclcpp::Parameter> p) {
  static class_loader::ClassLoader loader(MASK_NODE);
  const auto factory = loader.createInstance<rclcpp_components::NodeFactory>(
      "rclcpp_components::NodeFactoryTemplate<stillpoint_ros::MaskNode>");
  p.emplace_back("warn_period_s", 0.0);
  rclcpp::NodeOptions options;
  options.use_intra_process_comms(intra_process).parameter_overrides(p);
  options.arguments({"--ros-args", "-r", "__ns:=/" + space});
  return std::make_shared<rclcpp_components::NodeInstanceWrapper>(
      factory->create_node_instance(options));
}

// A camera, its network and who listens, around one MaskNode.
class Robot {
 public:
  explicit Robot(const std::string& space, bool intra_process = false,
                 std::vector<rclcpp::Parameter> parameters = {rclcpp::Parameter("mask_wait_s",
                                                                                0.1)})
      : compressed(std::any_of(parameters.begin(), parameters.end(),
                               [](const auto& p) { return p.get_name() == "color_transport"; })),
        node(load_node(space, intra_process, std::move(parameters))),
        host(std::make_shared<rclcpp::Node>("host", space, host_options(intra_process))) {
    start_camera();
    masks = host->create_subscription<Image>(
        "mask", 10, [this](Image::UniquePtr m) { got.push_back(std::move(m)); });
    executor.add_node(node->get_node_base_interface());
    executor.add_node(host);
    spin(5s, [&] {
      return (compressed
                  ? packed_color.getNumSubscribers() > 0 && packed_depth.getNumSubscribers() > 0
                  : color->get_subscription_count() > 0 && depth->get_subscription_count() > 0) &&
             labels->get_subscription_count() > 0 && info->get_subscription_count() > 0 &&
             masks->get_publisher_count() > 0;
    });
    info->publish(to_message(camera(), kStart));
    spin(200ms, [] { return false; });
  }

  // PNG loses nothing. Two versions of image_transport's plugins, two names of the parameter.
  static rclcpp::NodeOptions host_options(bool intra_process) {
    rclcpp::NodeOptions options;
    return options.use_intra_process_comms(intra_process)
        .append_parameter_override("color.image.compressed.format", "png")
        .append_parameter_override(".color.image.compressed.format", "png");
  }

  void start_camera() {
    if (compressed) {
      packed_color = image_transport::create_publisher(host.get(), "color/image");
      packed_depth = image_transport::create_publisher(host.get(), "depth/image");
    }
    color = host->create_publisher<Image>("color/image", 10);
    depth = host->create_publisher<Image>("depth/image", 10);
    labels = host->create_publisher<Image>("labels", 10);
    info = host->create_publisher<CameraInfo>("color/camera_info", 10);
  }
  void stop_camera() { color.reset(), depth.reset(), labels.reset(), info.reset(); }

  template <class Until>
  bool spin(std::chrono::milliseconds most, Until until) {
    const auto end = std::chrono::steady_clock::now() + most;
    while (!until() && std::chrono::steady_clock::now() < end) executor.spin_some(5ms);
    return until();
  }

  void send(int i, std::int64_t start = kStart, bool with_depth = true, bool with_labels = true) {
    const std::int64_t stamp = start + i * kStep;
    if (with_labels)
      labels->publish(std::make_unique<Image>(to_message(Scene::labels(i), "mono8", stamp)));
    auto depth_image = std::make_unique<Image>(to_message(Scene::depth(i), "16UC1", stamp));
    auto color_image = std::make_unique<Image>(to_message(scene().color(i), "bgr8", stamp));
    if (compressed) {
      packed_depth.publish(*depth_image);
      packed_color.publish(*color_image);
    } else {
      if (with_depth) depth->publish(std::move(depth_image));
      color->publish(std::move(color_image));
    }
  }
  // Sends the i-th frame and waits for its mask; nothing if none comes.
  Image::UniquePtr mask(int i, std::int64_t start = kStart, bool with_depth = true) {
    const std::size_t before = got.size();
    send(i, start, with_depth);
    if (!spin(3s, [&] { return got.size() > before; })) return nullptr;
    return std::make_unique<Image>(*got.back());
  }

  const bool compressed;
  std::shared_ptr<rclcpp_components::NodeInstanceWrapper> node;
  rclcpp::Node::SharedPtr host;
  rclcpp::executors::SingleThreadedExecutor executor;
  rclcpp::Publisher<Image>::SharedPtr color, depth, labels;
  rclcpp::Publisher<CameraInfo>::SharedPtr info;
  image_transport::Publisher packed_color, packed_depth;
  rclcpp::Subscription<Image>::SharedPtr masks;
  std::vector<Image::UniquePtr> got;
};

inline void expect_mask(const Image::UniquePtr& m, const cv::Mat& wanted, int i) {
  ASSERT_TRUE(m) << "no mask of frame " << i;
  EXPECT_EQ(stillpoint::ros2::stamp_of(m->header), kStart + i * kStep);
  EXPECT_EQ(m->header.frame_id, "camera");
  EXPECT_EQ(m->encoding, "mono8");
  ASSERT_EQ(m->data.size(), wanted.total());
  EXPECT_EQ(std::memcmp(m->data.data(), wanted.data, m->data.size()), 0) << i;
}

}  // namespace stillpoint_ros
