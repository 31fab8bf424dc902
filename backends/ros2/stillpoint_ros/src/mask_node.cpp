// SPDX-License-Identifier: BSD-2-Clause
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>

#include <Eigen/Geometry>
#include <atomic>
#include <chrono>
#include <diagnostic_msgs/msg/diagnostic_array.hpp>
#include <image_transport/image_transport.hpp>
#include <memory>
#include <mutex>
#include <nav_msgs/msg/odometry.hpp>
#include <optional>
#include <rclcpp_components/register_node_macro.hpp>
#include <stillpoint/backends/ros2/camera_stream.hpp>
#include <stillpoint/backends/ros2/pose_buffer.hpp>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "messages.hpp"
#include "publishers.hpp"

namespace stillpoint_ros {

using namespace std::chrono_literals;

/// From a camera's topics to masks, masked images and objects; docs/ros2.md lists topics and
/// parameters. Subscriptions only hand messages over to core::CameraStream; a thread of the node
/// makes masks and publishes them.
class MaskNode : public rclcpp::Node {
 public:
  explicit MaskNode(const rclcpp::NodeOptions& options)
      : Node("stillpoint", options), warnings_([this](const std::string& text) {
          RCLCPP_WARN(get_logger(), "%s", text.c_str());
        }) {
    declare_parameters();
    pose_source_ = parameters_.poses, world_frame_ = parameters_.world_frame;
    stream_.emplace(parameters_, topic_names(), warnings_,
                    [this](core::Nanoseconds stamp, const std::string& frame_id) {
                      return pose_at(stamp, frame_id);
                    });
    on_set_ = add_on_set_parameters_callback(
        [this](const std::vector<rclcpp::Parameter>& changed) { return set_parameters(changed); });
    publishers_.emplace(*this);
    diagnostics_ = create_publisher<diagnostic_msgs::msg::DiagnosticArray>("/diagnostics", 10);
    subscribe();
    timer_ = create_wall_timer(1s, [this] { publish_diagnostics(); });
    worker_ = std::thread([this] { run(); });
  }

  ~MaskNode() override {
    end_ = true;
    worker_.join();
  }

 private:
  void declare_parameters() {
    for (const core::ParameterDescription& d : core::parameter_descriptions()) {
      rcl_interfaces::msg::ParameterDescriptor descriptor;
      descriptor.description = d.text;
      descriptor.read_only = d.read_only;
      descriptor.dynamic_typing = true;  // 1 for 1.0: the core says what fits
      declare_parameter(d.name, to_ros(d.value(parameters_)), descriptor);
      set(parameters_, get_parameter(d.name));
    }
  }

  static void set(core::Parameters& parameters, const rclcpp::Parameter& parameter) {
    const std::string problem =
        core::set_parameter(parameters, parameter.get_name(), from_ros(parameter));
    if (!problem.empty()) throw std::invalid_argument(problem);
  }

  rcl_interfaces::msg::SetParametersResult set_parameters(
      const std::vector<rclcpp::Parameter>& changed) {
    rcl_interfaces::msg::SetParametersResult result;
    core::Parameters parameters = parameters_;
    try {
      for (const rclcpp::Parameter& parameter : changed)
        if (is_ours(parameter.get_name())) set(parameters, parameter);
      parameters_ = parameters;
      stream_->set_parameters(parameters_);
      result.successful = true;
    } catch (const std::exception& error) {
      result.successful = false;
      result.reason = error.what();
    }
    return result;
  }

  static bool is_ours(const std::string& name) {
    for (const core::ParameterDescription& d : core::parameter_descriptions())
      if (name == d.name) return true;
    return false;  // use_sim_time, qos_overrides...
  }

  std::string resolved(const std::string& topic) {
    return get_node_topics_interface()->resolve_topic_name(topic);
  }

  core::TopicNames topic_names() {
    return {resolved("color/image"), resolved("depth/image"), resolved("color/camera_info"),
            resolved("labels") + " or " + resolved("detections")};
  }

  void subscribe() {
    const std::string color_transport = declare_parameter("color_transport", "raw");
    const std::string depth_transport = declare_parameter("depth_transport", "raw");
    rclcpp::SubscriptionOptions options;  // a parameter file may choose reliable
    options.qos_overriding_options = rclcpp::QosOverridingOptions::with_default_policies();
    color_ = image_transport::create_subscription(
        this, resolved("color/image"),
        [this](const Image::ConstSharedPtr& m) { stream_->add_color(from_ros(m)); },
        color_transport, rmw_qos_profile_sensor_data, options);
    depth_ = image_transport::create_subscription(
        this, resolved("depth/image"),
        [this](const Image::ConstSharedPtr& m) { stream_->add_depth(from_ros(m)); },
        depth_transport, rmw_qos_profile_sensor_data, options);
    const rclcpp::SensorDataQoS qos;
    info_ = create_subscription<CameraInfo>("color/camera_info", qos,
                                            [this](const CameraInfo::ConstSharedPtr& m) {
                                              stream_->add_camera_info(from_ros(*m));
                                              const std::lock_guard<std::mutex> guard(mutex_);
                                              last_info_ = m;
                                            });
    labels_ = create_subscription<Image>(
        "labels", qos,
        [this](const Image::ConstSharedPtr& m) {
          core::SegmentationMessage labels;
          labels.stamp = stamp_of(m->header);
          labels.has_labels = true;
          labels.labels = from_ros(m);
          stream_->add_segmentation(std::move(labels));
        },
        options);
    using vision_msgs::msg::Detection2DArray;
    boxes_ = create_subscription<Detection2DArray>(
        "detections", qos, [this](const Detection2DArray::ConstSharedPtr& m) {
          stream_->add_segmentation(from_ros(*m));
        });
    if (pose_source_ == "none") return;
    tf_ = std::make_unique<tf2_ros::Buffer>(get_clock());
    tf_listener_ = std::make_unique<tf2_ros::TransformListener>(*tf_, this, true);
    if (pose_source_ == "odometry")
      odometry_ = create_subscription<nav_msgs::msg::Odometry>(
          "odometry", qos, [this](const nav_msgs::msg::Odometry::ConstSharedPtr& m) {
            const auto& p = m->pose.pose.position;
            const auto& q = m->pose.pose.orientation;
            const std::lock_guard<std::mutex> guard(mutex_);
            body_frame_ = m->child_frame_id, odometry_frame_ = m->header.frame_id;
            poses_.add(stamp_of(m->header), isometry(p.x, p.y, p.z, q.w, q.x, q.y, q.z));
          });
  }

  static Eigen::Isometry3d isometry(double x, double y, double z, double qw, double qx, double qy,
                                    double qz) {
    return Eigen::Translation3d(x, y, z) * Eigen::Quaterniond(qw, qx, qy, qz).normalized();
  }

  // Nothing where the transform is not known: the front end does without.
  std::optional<Eigen::Isometry3d> transform(const std::string& to, const std::string& from,
                                             tf2::TimePoint time) const try {
    const auto message = tf_->lookupTransform(to, from, time).transform;
    const auto& p = message.translation;
    const auto& q = message.rotation;
    return isometry(p.x, p.y, p.z, q.w, q.x, q.y, q.z);
  } catch (const tf2::TransformException&) {
    return std::nullopt;
  }

  std::optional<Eigen::Isometry3d> pose_at(core::Nanoseconds stamp, const std::string& camera) {
    if (!tf_) return std::nullopt;
    if (pose_source_ == "tf")
      return transform(world_frame_, camera, tf2::TimePoint(std::chrono::nanoseconds(stamp)));
    std::optional<Eigen::Isometry3d> T_world_body;
    std::string body;
    {
      const std::lock_guard<std::mutex> guard(mutex_);
      T_world_body = poses_.at(stamp);
      body = body_frame_;
    }
    if (!T_world_body || body.empty() || body == camera) return T_world_body;
    const auto T_body_camera = transform(body, camera, tf2::TimePointZero);
    if (!T_body_camera) return std::nullopt;
    return *T_world_body * *T_body_camera;
  }

  void run() {
    while (!end_) {
      if (!stream_->wait(100ms)) continue;
      while (const core::StreamFrame* frame = end_ ? nullptr : stream_->next()) publish(*frame);
    }
  }

  void publish(const core::StreamFrame& frame) {
    CameraInfo::ConstSharedPtr info;
    std::string world_frame;
    {
      const std::lock_guard<std::mutex> guard(mutex_);
      info = last_info_;
      if (pose_source_ != "none")
        world_frame = pose_source_ == "tf" ? world_frame_ : odometry_frame_;
    }
    publishers_->publish(frame, stream_->front_end(), info, world_frame);
  }

  void publish_diagnostics() {
    const core::DiagnosticReport report = stream_->report();
    auto message = std::make_unique<diagnostic_msgs::msg::DiagnosticArray>();
    message->header.stamp = now();
    diagnostic_msgs::msg::DiagnosticStatus status;
    status.level = static_cast<unsigned char>(report.level);
    status.name = std::string(get_fully_qualified_name()) + ": masks";
    status.message = report.message;
    status.hardware_id = "none";
    for (const auto& [name, value] : report.values) {
      status.values.emplace_back();
      status.values.back().key = name, status.values.back().value = value;
    }
    message->status.push_back(std::move(status));
    diagnostics_->publish(std::move(message));
  }

  core::Parameters parameters_;
  std::string pose_source_, world_frame_;  // read by the worker, so never changed
  core::Warnings warnings_;
  std::optional<core::CameraStream> stream_;
  std::mutex mutex_;  // of what is below, up to the next empty line
  core::PoseBuffer poses_;
  std::string body_frame_, odometry_frame_;
  CameraInfo::ConstSharedPtr last_info_;

  std::unique_ptr<tf2_ros::Buffer> tf_;
  std::unique_ptr<tf2_ros::TransformListener> tf_listener_;
  std::optional<Publishers> publishers_;
  rclcpp::Publisher<diagnostic_msgs::msg::DiagnosticArray>::SharedPtr diagnostics_;
  image_transport::Subscriber color_, depth_;
  rclcpp::SubscriptionBase::SharedPtr info_, labels_, boxes_, odometry_;
  OnSetParametersCallbackHandle::SharedPtr on_set_;
  rclcpp::TimerBase::SharedPtr timer_;
  std::atomic<bool> end_{false};
  std::thread worker_;
};

}  // namespace stillpoint_ros

RCLCPP_COMPONENTS_REGISTER_NODE(stillpoint_ros::MaskNode)
