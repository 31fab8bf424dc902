// SPDX-License-Identifier: BSD-2-Clause
//
// A camera with its network as a component, which also reads the masks: for container_test.

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <opencv2/core.hpp>
#include <rclcpp/rclcpp.hpp>
#include <rclcpp_components/register_node_macro.hpp>
#include <std_msgs/msg/string.hpp>
#include <string>
#include <utility>
#include <vector>

#include "recording.hpp"
#include "scene.hpp"

namespace stillpoint_ros {

using namespace std::chrono_literals;

/// Sends a frame when the mask of the last one has come. When it has all, it says again and again
/// on `verdict` how many there were, how many were wrong, and how many readers of its color images
/// got them without a copy.
class Camera : public rclcpp::Node {
 public:
  explicit Camera(const rclcpp::NodeOptions& options)
      : Node("camera", options),
        wanted_(expected(20)),
        color_(create_publisher<Image>("color/image", 10)),
        depth_(create_publisher<Image>("depth/image", 10)),
        labels_(create_publisher<Image>("labels", 10)),
        info_(create_publisher<CameraInfo>("color/camera_info", 10)),
        verdict_(create_publisher<std_msgs::msg::String>("/verdict", 10)) {
    reader_ = create_subscription<Image>("color/image", 10, [this](Image::ConstSharedPtr m) {
      ++read_;
      if (m->data.data() == bytes_) ++same_;
    });
    masks_ =
        create_subscription<Image>("mask", 10, [this](Image::UniquePtr m) { check(std::move(m)); });
    timer_ = create_wall_timer(20ms, [this] { tick(); });
  }

 private:
  void tick() {
    if (answered_ == wanted_.size() && read_ == sent_) {
      std_msgs::msg::String text;
      text.data = std::to_string(answered_) + " masks, " + std::to_string(wrong_) +
                  " wrong, readers without a copy: " +
                  std::to_string(color_->get_intra_process_subscription_count()) +
                  ", same bytes: " + std::to_string(same_);
      verdict_->publish(text);
    } else if (color_->get_subscription_count() > 1 && depth_->get_subscription_count() > 0 &&
               labels_->get_subscription_count() > 0 && info_->get_subscription_count() > 0 &&
               masks_->get_publisher_count() > 0 && answered_ == sent_ && read_ == sent_) {
      if (++settled_ < 25) return info_->publish(to_message(camera(), kStart));
      send(static_cast<int>(sent_++));
    }
  }

  void send(int i) {
    const std::int64_t stamp = kStart + i * kStep;
    labels_->publish(std::make_unique<Image>(to_message(Scene::labels(i), "mono8", stamp)));
    depth_->publish(std::make_unique<Image>(to_message(Scene::depth(i), "16UC1", stamp)));
    auto color = std::make_unique<Image>(to_message(scene().color(i), "bgr8", stamp));
    bytes_ = color->data.data();
    color_->publish(std::move(color));
  }

  void check(Image::UniquePtr m) {
    const cv::Mat& wanted = wanted_.at(answered_++);
    if (m->data.size() != wanted.total() ||
        std::memcmp(m->data.data(), wanted.data, wanted.total()) != 0)
      ++wrong_;
  }

  std::vector<cv::Mat> wanted_;
  std::size_t sent_ = 0, answered_ = 0, read_ = 0, wrong_ = 0, same_ = 0;
  int settled_ = 0;
  const void* bytes_ = nullptr;
  rclcpp::Publisher<Image>::SharedPtr color_, depth_, labels_;
  rclcpp::Publisher<CameraInfo>::SharedPtr info_;
  rclcpp::Publisher<std_msgs::msg::String>::SharedPtr verdict_;
  rclcpp::Subscription<Image>::SharedPtr reader_, masks_;
  rclcpp::TimerBase::SharedPtr timer_;
};

}  // namespace stillpoint_ros

RCLCPP_COMPONENTS_REGISTER_NODE(stillpoint_ros::Camera)
