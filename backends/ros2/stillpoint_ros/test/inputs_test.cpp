// SPDX-License-Identifier: BSD-2-Clause
//
// Poses by TF, and images by other transports.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <image_transport/image_transport.hpp>
#include <nav_msgs/msg/odometry.hpp>
#include <opencv2/core.hpp>
#include <rclcpp/rclcpp.hpp>
#include <rosgraph_msgs/msg/clock.hpp>
#include <stillpoint_ros/msg/object_array.hpp>
#include <string>
#include <tf2_msgs/msg/tf_message.hpp>
#include <vector>

#include "robot.hpp"

namespace stillpoint_ros {
namespace {

using tf2_msgs::msg::TFMessage;

// TF of a camera that stands still in `odom`, although the body drives and its arm moves back.
class Tf {
 public:
  explicit Tf(rclcpp::Node& node)
      : moving_(node.create_publisher<TFMessage>("/tf", 100)),
        fixed_(node.create_publisher<TFMessage>("/tf_static", rclcpp::QoS(1).transient_local())) {
    TFMessage m;
    m.transforms = {transform_message(camera_on_body(), "arm", "camera", 1)};
    fixed_->publish(m);
  }
  static Eigen::Isometry3d T_odom_camera(double x) {
    return Eigen::Translation3d(x, 0, 0) * camera_on_body();
  }
  void send(int i, double x, std::int64_t start = kStart) {
    const Eigen::Isometry3d drive(Eigen::Translation3d(0.01 * i, 0, 0));
    TFMessage m;
    m.transforms = {
        transform_message(Eigen::Translation3d(x, 0, 0) * drive, "odom", "base", start + i * kStep),
        transform_message(drive.inverse(), "base", "arm", start + i * kStep)};
    moving_->publish(m);
  }

 private:
  rclcpp::Publisher<TFMessage>::SharedPtr moving_, fixed_;
};

// The objects of the newest frame.
struct Objects {
  explicit Objects(Robot& robot)
      : robot_(robot),
        kept_(robot.host->create_subscription<msg::ObjectArray>(
            "objects", 10, [this](msg::ObjectArray::ConstSharedPtr m) { got = *m; })) {
    robot.spin(5s, [&] { return kept_->get_publisher_count() > 0; });
    robot.spin(300ms, [] { return false; });
  }
  // Of the i-th frame, whose mask is made; nothing if there is no answer.
  const msg::Object* of(int i, std::int64_t start = kStart) {
    if (!robot_.mask(i, start)) return nullptr;
    robot_.spin(3s, [&] { return got.header == robot_.got.back()->header; });
    return got.header == robot_.got.back()->header && got.objects.size() == 1 ? &got.objects[0]
                                                                              : nullptr;
  }
  msg::ObjectArray got;

 private:
  Robot& robot_;
  rclcpp::SubscriptionBase::SharedPtr kept_;
};

std::vector<rclcpp::Parameter> with_poses(const std::string& source) {
  return {rclcpp::Parameter("mask_wait_s", 0.1), rclcpp::Parameter("poses", source)};
}

TEST(MaskNode, PosesByTfAreThoseOfOdometry) {
  Robot by_tf("by_tf", false, with_poses("tf"));
  Robot by_odometry("by_odometry", false, with_poses("odometry"));
  const auto odometry = by_odometry.host->create_publisher<nav_msgs::msg::Odometry>("odometry", 10);
  Tf tf(*by_tf.host);
  Objects found(by_tf), wanted(by_odometry);
  by_odometry.spin(5s, [&] { return odometry->get_subscription_count() > 0; });
  for (int i = 0; i < 20; ++i) {
    nav_msgs::msg::Odometry pose = odometry_message(Tf::T_odom_camera(5), kStart + i * kStep);
    pose.child_frame_id = "camera";
    odometry->publish(pose);
    tf.send(i, 5);
    by_odometry.spin(20ms, [] { return false; });
    const msg::Object *a = found.of(i), *b = wanted.of(i);
    ASSERT_TRUE(a && b) << i;
    EXPECT_EQ(by_tf.got.back()->data, by_odometry.got.back()->data) << i;
    ASSERT_EQ(a->in_world.size(), 1u) << i;
    ASSERT_EQ(b->in_world.size(), 1u) << i;
    EXPECT_NEAR(a->in_world[0].position.x, b->in_world[0].position.x, 1e-9);
    EXPECT_NEAR(a->in_world[0].position.y, b->in_world[0].position.y, 1e-9);
    EXPECT_NEAR(a->in_world[0].velocity.y, b->in_world[0].velocity.y, 1e-9);
    EXPECT_NEAR(a->in_world[0].position.x, 5.1 + 2, 0.1) << "2 m before the camera";
  }
  EXPECT_EQ(found.got.world_frame, "odom");
}

TEST(MaskNode, TfMayBeMissingLateJumpAndBeginAnew) {
  Robot robot("tf_trouble", false, with_poses("tf"));
  Tf tf(*robot.host);
  Objects objects(robot);
  const auto wait = [&] { robot.spin(20ms, [] { return false; }); };
  for (int i = 0; i < 5; ++i) {
    const msg::Object* const object = objects.of(i);
    ASSERT_TRUE(object) << "masks and objects without TF, " << i;
    EXPECT_TRUE(object->in_world.empty());
  }
  const auto x = [&](int i, std::int64_t start = kStart) {
    const msg::Object* const object = objects.of(i, start);
    return object && !object->in_world.empty() ? object->in_world[0].position.x : -1;
  };
  for (int i = 5; i < 10; ++i) {
    if (i > 5)
      EXPECT_NEAR(x(i), 7.1, 0.1) << "late TF tells where the frame before was";
    else
      EXPECT_EQ(x(i), -1);
    tf.send(i, 5), wait();
  }
  for (int i = 10; i < 20; ++i) {
    tf.send(i, 50), wait();
    EXPECT_NEAR(x(i), 52.1, 0.1) << "a jump of the world, " << i;
    ASSERT_EQ(objects.got.objects.size(), 1u);
    EXPECT_LT(std::abs(objects.got.objects[0].in_camera[0].velocity.x), 2) << "of the world only";
  }
  const std::int64_t again = kStart - 60000000000;  // more than TF keeps
  for (int i = 0; i < 10; ++i) {
    tf.send(i, 5, again), wait();
    const double found = x(i, again);
    if (i > 1) EXPECT_NEAR(found, 7.1, 0.1) << "a bag that loops, " << i;
  }
}

// As Gazebo does it: time comes by /clock, begins near 0, and again when the simulation restarts.
TEST(MaskNode, ASimulationRestarts) {
  const std::vector<cv::Mat> wanted = expected(10);
  auto parameters = with_poses("tf");
  parameters.emplace_back("use_sim_time", true);
  Robot robot("simulation", false, parameters);
  const auto clock = robot.host->create_publisher<rosgraph_msgs::msg::Clock>("/clock", 10);
  Tf tf(*robot.host);
  Objects objects(robot);
  for (const std::int64_t start : {INT64_C(100000000000), INT64_C(2000000000), INT64_C(1000000000)})
    for (int i = 0; i < 10; ++i) {
      rosgraph_msgs::msg::Clock now;
      now.clock = to_message(scene().wall, "bgr8", start + i * kStep).header.stamp;
      clock->publish(now);
      robot.spin(10ms, [] { return false; });
      tf.send(i, 5, start);
      robot.spin(20ms, [] { return false; });
      const msg::Object* const object = objects.of(i, start);
      ASSERT_TRUE(object) << i << " from " << start;
      EXPECT_EQ(std::memcmp(robot.got.back()->data.data(), wanted[static_cast<std::size_t>(i)].data,
                            wanted[0].total()),
                0)
          << i << " from " << start;
      if (i < 2) continue;  // TF may have been cleared with the jump
      ASSERT_EQ(object->in_world.size(), 1u) << i << " from " << start;
      EXPECT_NEAR(object->in_world[0].position.x, 7.1, 0.1);
    }
}

TEST(MaskNode, CompressedImagesGiveTheSameMasks) {
  const std::vector<std::string> loadable = image_transport::getLoadableTransports();
  for (const char* const transport :
       {"image_transport/compressed", "image_transport/compressedDepth"})
    if (std::find(loadable.begin(), loadable.end(), transport) == loadable.end())
      GTEST_SKIP() << transport << " is not installed (image_transport_plugins)";
  const std::vector<cv::Mat> wanted = expected(10);
  Robot robot(
      "packed", false,
      {rclcpp::Parameter("mask_wait_s", 0.1), rclcpp::Parameter("color_transport", "compressed"),
       rclcpp::Parameter("depth_transport", "compressedDepth")});
  for (int i = 0; i < 10; ++i) expect_mask(robot.mask(i), wanted[static_cast<std::size_t>(i)], i);
}

}  // namespace
}  // namespace stillpoint_ros
