// SPDX-License-Identifier: BSD-2-Clause
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <diagnostic_msgs/msg/diagnostic_array.hpp>
#include <image_transport/image_transport.hpp>
#include <memory>
#include <nav_msgs/msg/odometry.hpp>
#include <optional>
#include <rclcpp/rclcpp.hpp>
#include <rclcpp_components/register_node_macro.hpp>
#include <sensor_msgs/msg/camera_info.hpp>
#include <sensor_msgs/msg/image.hpp>
#include <stdexcept>
#include <stillpoint/backends/ros2/camera_stream.hpp>
#include <stillpoint/backends/ros2/image_outputs.hpp>
#include <stillpoint/backends/ros2/pose_buffer.hpp>
#include <stillpoint/backends/ros2/read_messages.hpp>
#include <stillpoint/backends/ros2/write_messages.hpp>
#include <stillpoint_ros/msg/object_array.hpp>
#include <string>
#include <thread>
#include <utility>
#include <vector>
#include <vision_msgs/msg/detection2_d_array.hpp>
#include <visualization_msgs/msg/marker_array.hpp>

namespace stillpoint_ros {

namespace core = stillpoint::ros2;
using namespace std::chrono_literals;
using diagnostic_msgs::msg::DiagnosticArray;
using nav_msgs::msg::Odometry;
using sensor_msgs::msg::CameraInfo;
using sensor_msgs::msg::Image;
using vision_msgs::msg::Detection2DArray;
using visualization_msgs::msg::MarkerArray;

/// From a camera's topics to masks, masked images and objects; docs/ros2.md lists topics and
/// parameters. Subscriptions only hand messages over to core::CameraStream; a thread of the node
/// makes masks and publishes them. Messages are published as unique_ptr, so that a subscriber in
/// the same process gets them without a copy.
class MaskNode : public rclcpp::Node {
 public:
  explicit MaskNode(const rclcpp::NodeOptions& options)
      : Node("stillpoint", options), warnings_([this](const std::string& text) {
          RCLCPP_WARN(get_logger(), "%s", text.c_str());
        }) {
    declare_parameters();
    pose_source_ = parameters_.poses, world_frame_ = parameters_.world_frame;
    make_stream();
    on_set_ = add_on_set_parameters_callback(
        [this](const std::vector<rclcpp::Parameter>& changed) { return set_parameters(changed); });
    advertise();
    subscribe();
    if (pose_source_ != "none") subscribe_to_poses();
    timer_ = create_wall_timer(1s, [this] { publish_diagnostics(); });
    worker_ = std::thread([this] { run(); });
  }

  ~MaskNode() override {
    end_ = true;
    worker_.join();
  }

 private:
  static constexpr std::chrono::seconds kTfCache{10};

  template <class Message>
  using Publisher = typename rclcpp::Publisher<Message>::SharedPtr;

  void declare_parameters() {
    for (const core::ParameterDescription& d : core::parameter_descriptions()) {
      rcl_interfaces::msg::ParameterDescriptor descriptor;
      descriptor.description = d.text;
      descriptor.read_only = d.read_only;
      descriptor.dynamic_typing = true;  // 1 for 1.0: the core says what fits
      const auto value =
          std::visit([](const auto& v) { return rclcpp::ParameterValue(v); }, d.value(parameters_));
      declare_parameter(d.name, value, descriptor);
      const std::string problem =
          core::read_parameter(d.name, get_parameter(d.name).get_value_message(), parameters_);
      if (!problem.empty()) throw std::invalid_argument(problem);
    }
  }

  rcl_interfaces::msg::SetParametersResult set_parameters(
      const std::vector<rclcpp::Parameter>& changed) {
    rcl_interfaces::msg::SetParametersResult result;
    core::Parameters parameters = parameters_;
    for (const rclcpp::Parameter& p : changed)  // others: use_sim_time, qos_overrides...
      if (core::is_parameter(p.get_name()) && result.reason.empty())
        result.reason = core::read_parameter(p.get_name(), p.get_value_message(), parameters);
    result.successful = result.reason.empty();
    if (result.successful) parameters_ = parameters, stream_->set_parameters(parameters_);
    return result;
  }

  std::string resolved(const std::string& topic) {
    return get_node_topics_interface()->resolve_topic_name(topic);
  }

  void make_stream() {
    core::TopicNames topics;
    topics.color = resolved("color/image"), topics.depth = resolved("depth/image");
    topics.camera_info = resolved("color/camera_info");
    topics.segmentation = resolved("labels") + " or " + resolved("detections");
    topics.poses = pose_source_ == "tf" ? "/tf" : resolved("odometry");
    core::MaskMaker::PoseAt poses;
    if (pose_source_ != "none")
      poses = [this](core::Nanoseconds stamp, const std::string& camera, Eigen::Isometry3d& T) {
        return pose_at(stamp, camera, T);
      };
    stream_.emplace(parameters_, topics, warnings_, poses);
  }

  // A parameter file may choose another quality of service.
  template <class Options>
  static Options overridable() {
    Options options;
    options.qos_overriding_options = rclcpp::QosOverridingOptions::with_default_policies();
    return options;
  }

  template <class Message>
  Publisher<Message> advertise(const std::string& topic) {
    return create_publisher<Message>(topic, rclcpp::QoS(5),
                                     overridable<rclcpp::PublisherOptions>());
  }

  void advertise() {
    for (const core::ImageOutput& output : core::kImageOutputs)
      images_.push_back(advertise<Image>(output.topic));
    camera_info_ = advertise<CameraInfo>("camera_info");
    objects_ = advertise<msg::ObjectArray>("objects");
    markers_ = advertise<MarkerArray>("markers");
    diagnostics_ = create_publisher<DiagnosticArray>("/diagnostics", 10);
  }

  image_transport::Subscriber subscribe_to_image(
      const std::string& topic, const std::string& transport_parameter,
      const image_transport::Subscriber::Callback& callback) {
    rcl_interfaces::msg::ParameterDescriptor descriptor;
    descriptor.description = "image_transport of " + topic;
    descriptor.read_only = true;
    return image_transport::create_subscription(
        this, resolved(topic), callback, declare_parameter(transport_parameter, "raw", descriptor),
        rmw_qos_profile_sensor_data, overridable<rclcpp::SubscriptionOptions>());
  }

  void subscribe() {
    color_ = subscribe_to_image(
        "color/image", "color_transport",
        [this](const Image::ConstSharedPtr& m) { stream_->add_color(core::read_image(m)); });
    depth_ = subscribe_to_image(
        "depth/image", "depth_transport",
        [this](const Image::ConstSharedPtr& m) { stream_->add_depth(core::read_image(m)); });
    labels_ = create_subscription<Image>(
        "labels", rclcpp::SensorDataQoS(),
        [this](const Image::ConstSharedPtr& m) { stream_->add_segmentation(core::read_labels(m)); },
        overridable<rclcpp::SubscriptionOptions>());
    boxes_ = create_subscription<Detection2DArray>(
        "detections", rclcpp::SensorDataQoS(),
        [this](const Detection2DArray::ConstSharedPtr& m) {
          stream_->add_segmentation(core::read_detections(*m));
        },
        overridable<rclcpp::SubscriptionOptions>());
    info_ = create_subscription<CameraInfo>(
        "color/camera_info", rclcpp::SensorDataQoS(),
        [this](const CameraInfo::ConstSharedPtr& m) {
          stream_->add_camera_info(core::read_camera_info(*m));
          std::atomic_store(&last_info_, m);
        },
        overridable<rclcpp::SubscriptionOptions>());
  }

  void subscribe_to_poses() {
    tf_ = std::make_unique<tf2_ros::Buffer>(get_clock(), kTfCache);
    tf_listener_ = std::make_unique<tf2_ros::TransformListener>(*tf_, this, true);
    if (pose_source_ != "odometry") return;
    odometry_ = create_subscription<Odometry>(
        "odometry", rclcpp::SensorDataQoS(),
        [this](const Odometry::ConstSharedPtr& m) {
          odometry_poses_.add(
              core::stamp_of(m->header), m->header.frame_id, m->child_frame_id,
              core::read_transform(m->pose.pose.position, m->pose.pose.orientation));
        },
        overridable<rclcpp::SubscriptionOptions>());
  }

  std::string transform(const std::string& to, const std::string& from, tf2::TimePoint time,
                        Eigen::Isometry3d& T) const try {
    const auto message = tf_->lookupTransform(to, from, time).transform;
    T = core::read_transform(message.translation, message.rotation);
    return "";
  } catch (const tf2::TransformException& error) {
    return "expected a transform from '" + from + "' to '" + to + "', found: " + error.what();
  }

  std::string pose_at(core::Nanoseconds stamp, const std::string& camera, Eigen::Isometry3d& T) {
    if (pose_source_ == "odometry")
      return odometry_poses_.at(
          stamp, camera,
          [this](const std::string& body, const std::string& frame, Eigen::Isometry3d& T_body) {
            return transform(body, frame, tf2::TimePointZero, T_body);
          },
          T);
    // TF refuses transforms that are older than those that it keeps: a bag that begins anew.
    const tf2::TimePoint time{std::chrono::nanoseconds(stamp)};
    if (newest_time_ - time > kTfCache) tf_->clear(), newest_time_ = time;
    newest_time_ = std::max(newest_time_, time);
    return transform(world_frame_, camera, time, T);
  }

  void run() {
    while (!end_) {
      if (!stream_->wait(100ms)) continue;
      while (const core::StreamFrame* frame = end_ ? nullptr : stream_->next()) publish(*frame);
    }
  }

  // Nothing is computed that nobody subscribes to.
  static bool is_wanted(const rclcpp::PublisherBase& publisher) {
    return publisher.get_subscription_count() > 0;
  }

  void publish(const core::StreamFrame& frame) {
    const stillpoint::FrontEnd& front_end = stream_->front_end();
    for (std::size_t i = 0; i < images_.size(); ++i)
      if (is_wanted(*images_[i])) publish_image(i, frame, front_end.mask().image);
    if (is_wanted(*objects_)) {
      auto message = std::make_unique<msg::ObjectArray>();
      core::write_objects(front_end.objects(), frame.color,
                          pose_source_ == "tf" ? world_frame_ : odometry_poses_.world_frame(),
                          *message);
      objects_->publish(std::move(message));
    }
    if (is_wanted(*markers_)) {
      auto message = std::make_unique<MarkerArray>();
      core::write_markers(front_end.objects(), frame.color, *message);
      markers_->publish(std::move(message));
    }
    if (const auto info = std::atomic_load(&last_info_); info && is_wanted(*camera_info_)) {
      auto message = std::make_unique<CameraInfo>(*info);
      core::write_header(frame.color, message->header);
      camera_info_->publish(std::move(message));
    }
  }

  void publish_image(std::size_t i, const core::StreamFrame& frame, const cv::Mat& mask) {
    const core::OutputImage output = core::kImageOutputs[i].make(frame, mask);
    if (output.image.empty()) return;
    auto message = std::make_unique<Image>();
    core::write_image(*output.like, output.encoding, output.image, *message);
    images_[i]->publish(std::move(message));
  }

  void publish_diagnostics() {
    auto message = std::make_unique<DiagnosticArray>();
    message->header.stamp = now();
    message->status.resize(1);
    core::write_diagnostics(stream_->report(), std::string(get_fully_qualified_name()) + ": masks",
                            message->status[0]);
    diagnostics_->publish(std::move(message));
  }

  core::Parameters parameters_;
  std::string pose_source_, world_frame_;  // read by the worker, so never changed
  core::Warnings warnings_;
  std::optional<core::CameraStream> stream_;
  core::OdometryPoses odometry_poses_;
  std::unique_ptr<tf2_ros::Buffer> tf_;
  std::unique_ptr<tf2_ros::TransformListener> tf_listener_;
  tf2::TimePoint newest_time_{};          // of the poses that the worker asked for
  CameraInfo::ConstSharedPtr last_info_;  // by std::atomic_load, std::atomic_store

  std::vector<Publisher<Image>> images_;
  Publisher<CameraInfo> camera_info_;
  Publisher<msg::ObjectArray> objects_;
  Publisher<MarkerArray> markers_;
  Publisher<DiagnosticArray> diagnostics_;
  image_transport::Subscriber color_, depth_;
  rclcpp::SubscriptionBase::SharedPtr info_, labels_, boxes_, odometry_;
  OnSetParametersCallbackHandle::SharedPtr on_set_;
  rclcpp::TimerBase::SharedPtr timer_;
  std::atomic<bool> end_{false};
  std::thread worker_;
};

}  // namespace stillpoint_ros

RCLCPP_COMPONENTS_REGISTER_NODE(stillpoint_ros::MaskNode)
