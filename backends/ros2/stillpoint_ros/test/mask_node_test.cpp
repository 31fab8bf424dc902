// SPDX-License-Identifier: BSD-2-Clause
//
// The node in earnest: over the middleware and inside one process, with a publisher as camera.

#include <gtest/gtest.h>

#include <chrono>
#include <cstdint>
#include <cstring>
#include <diagnostic_msgs/msg/diagnostic_array.hpp>
#include <functional>
#include <map>
#include <memory>
#include <nav_msgs/msg/odometry.hpp>
#include <opencv2/core.hpp>
#include <rclcpp/rclcpp.hpp>
#include <stillpoint_ros/msg/object_array.hpp>
#include <string>
#include <thread>
#include <vector>
#include <vision_msgs/msg/detection2_d_array.hpp>
#include <visualization_msgs/msg/marker_array.hpp>

#include "robot.hpp"

namespace stillpoint_ros {
namespace {

TEST(MaskNode, MasksAreTheFrontEndsByteForByteAlsoWhenABagLoops) {
  const std::vector<cv::Mat> wanted = expected(20);
  ASSERT_GT(cv::countNonZero(wanted[10]), 10000);
  for (const bool intra_process : {false, true}) {
    Robot robot(intra_process ? "inside" : "outside", intra_process);
    for (int round = 0; round < 3; ++round)
      for (int i = 0; i < 20; ++i)
        expect_mask(robot.mask(i), wanted[static_cast<std::size_t>(i)], i);
  }
}

TEST(MaskNode, InsideAProcessMessagesAreHandedOver) {
  Robot robot("handed_over", true);
  const void* sent = nullptr;
  const auto seen = robot.host->create_subscription<Image>(
      "color/image", 10, [&](Image::ConstSharedPtr m) { sent = m->data.data(); });
  robot.spin(500ms, [] { return false; });
  auto message = std::make_unique<Image>(to_message(scene().color(0), "bgr8", kStart));
  const void* const bytes = message->data.data();
  robot.color->publish(std::move(message));
  robot.spin(2s, [&] { return sent != nullptr; });
  EXPECT_EQ(sent, bytes) << "two who only read share one image";
}

TEST(MaskNode, TwoCamerasInOneProcess) {
  const std::vector<cv::Mat> wanted = expected(10);
  Robot left("left"), right("right");
  for (int i = 0; i < 10; ++i) {
    expect_mask(left.mask(i), wanted[static_cast<std::size_t>(i)], i);
    if (i % 2 == 0) expect_mask(right.mask(i / 2), wanted[static_cast<std::size_t>(i / 2)], i / 2);
  }
  EXPECT_EQ(left.got.size(), 10u);
  EXPECT_EQ(right.got.size(), 5u);
}

TEST(MaskNode, TheCameraStopsAndStartsAgain) {
  Robot robot("restart");
  for (int i = 0; i < 5; ++i) ASSERT_TRUE(robot.mask(i));
  robot.stop_camera();
  robot.spin(300ms, [] { return false; });
  robot.start_camera();
  ASSERT_TRUE(robot.spin(5s, [&] {
    return robot.color->get_subscription_count() > 0 && robot.depth->get_subscription_count() > 0 &&
           robot.labels->get_subscription_count() > 0;
  }));
  for (int i = 5; i < 10; ++i) {
    const auto mask = robot.mask(i, kStart + 5000000000);
    ASSERT_TRUE(mask) << i;
    EXPECT_EQ(stillpoint::ros2::stamp_of(mask->header), kStart + 5000000000 + i * kStep);
  }
}

TEST(MaskNode, DepthStopsAndComesBack) {
  Robot robot("depth_stops", false,
              {rclcpp::Parameter("mask_wait_s", 0.1), rclcpp::Parameter("stalled_after_s", 0.2)});
  for (int i = 0; i < 5; ++i) ASSERT_TRUE(robot.mask(i));
  for (int i = 5; i < 30; ++i) robot.send(i, kStart, false), robot.spin(20ms, [] { return false; });
  EXPECT_TRUE(robot.spin(3s, [&] { return robot.got.size() == 30; })) << robot.got.size();
  ASSERT_TRUE(robot.mask(30));
  EXPECT_EQ(stillpoint::ros2::stamp_of(robot.got.back()->header), kStart + 30 * kStep);
}

TEST(MaskNode, OutputsBelongTogether) {
  Robot robot("outputs");
  std::map<std::string, Image> got;
  std::vector<rclcpp::SubscriptionBase::SharedPtr> kept;
  for (const char* const topic : {"static_mask", "depth_static", "color_static", "overlay"})
    kept.push_back(robot.host->create_subscription<Image>(
        topic, 10, [&got, topic](Image::ConstSharedPtr m) { got[topic] = *m; }));
  CameraInfo calibration;
  kept.push_back(robot.host->create_subscription<CameraInfo>(
      "camera_info", 10, [&](CameraInfo::ConstSharedPtr m) { calibration = *m; }));
  robot.spin(1s, [] { return false; });
  const auto mask = robot.mask(0);
  ASSERT_TRUE(mask);
  ASSERT_TRUE(robot.spin(3s, [&] { return got.size() == 4 && calibration.width > 0; }));
  const auto mat = [](Image& m, int type) { return cv::Mat(240, 320, type, m.data.data()); };
  const cv::Mat dynamic = mat(*mask, CV_8UC1).clone();
  EXPECT_EQ(cv::norm(mat(got["static_mask"], CV_8UC1), dynamic == 0, cv::NORM_INF), 0);
  cv::Mat depth = Scene::depth(0), color = scene().color(0);
  depth.setTo(0, dynamic), color.setTo(0, dynamic);
  EXPECT_EQ(got["depth_static"].encoding, "16UC1");
  EXPECT_EQ(cv::norm(mat(got["depth_static"], CV_16UC1), depth, cv::NORM_INF), 0);
  EXPECT_EQ(got["color_static"].encoding, "bgr8");
  EXPECT_EQ(cv::norm(mat(got["color_static"], CV_8UC3), color, cv::NORM_INF), 0);
  EXPECT_EQ(cv::norm(mat(got["overlay"], CV_8UC3), scene().color(0), cv::NORM_INF, dynamic == 0),
            0);
  for (auto& [topic, m] : got) EXPECT_EQ(m.header, mask->header) << topic;
  EXPECT_EQ(calibration.header, mask->header);
  EXPECT_EQ(calibration.k[0], 262.5);
}

TEST(MaskNode, ParametersAreCheckedAndChangeWhileItRuns) {
  Robot robot("parameters");
  const auto client = std::make_shared<rclcpp::AsyncParametersClient>(robot.host, "stillpoint");
  ASSERT_TRUE(client->wait_for_service(5s));
  const auto set = [&](const rclcpp::Parameter& parameter) {
    auto future = client->set_parameters({parameter});
    robot.spin(5s, [&] { return future.wait_for(0s) == std::future_status::ready; });
    return future.get().at(0);
  };
  const auto count = [&](int i) {
    const auto mask = robot.mask(i);
    if (!mask) return -1;
    return cv::countNonZero(cv::Mat(240, 320, CV_8UC1, mask->data.data()));
  };
  const int before = count(0);
  EXPECT_GT(before, 10000);
  EXPECT_TRUE(set(rclcpp::Parameter("dilation_px", 30)).successful) << "a whole number will do";
  EXPECT_GT(count(1), before + 2000);
  for (const auto& [wrong, part] : std::vector<std::pair<rclcpp::Parameter, std::string>>{
           {{"dilation_px", 1000.0}, "expected -1"},
           {{"preset", "best"}, "default, network_only, paper"},
           {{"queue_size", "five"}, "expected a whole number, found a text"}}) {
    const auto result = set(wrong);
    EXPECT_FALSE(result.successful);
    EXPECT_NE(result.reason.find(part), std::string::npos) << result.reason;
  }
  EXPECT_FALSE(set(rclcpp::Parameter("poses", "tf")).successful) << "at the start only";
  EXPECT_GT(count(2), before + 2000) << "nothing wrong has come through";
  EXPECT_TRUE(
      set(rclcpp::Parameter("dynamic_classes", std::vector<std::string>{"dog"})).successful);
  EXPECT_GE(count(3), 0);
  EXPECT_THROW(load_node("wrong", false, {rclcpp::Parameter("preset", "best")}), std::exception);
}

TEST(MaskNode, BoxesOfADetectorWillDo) {
  Robot robot("boxes");
  const auto boxes =
      robot.host->create_publisher<vision_msgs::msg::Detection2DArray>("detections", 10);
  robot.spin(5s, [&] { return boxes->get_subscription_count() > 0; });
  for (int i = 0; i < 3; ++i) {
    vision_msgs::msg::Detection2DArray m;
    m.header = to_message(Scene::labels(0), "mono8", kStart + i * kStep).header;
    m.detections.resize(1);
    m.detections[0].bbox.center.position.x = Scene::place(i).x + 40;
    m.detections[0].bbox.center.position.y = 140;
    m.detections[0].bbox.size_x = 80, m.detections[0].bbox.size_y = 160;
    m.detections[0].results.resize(1);
    m.detections[0].results[0].hypothesis.class_id = "person";
    m.detections[0].results[0].hypothesis.score = 0.9;
    boxes->publish(m);
    robot.send(i, kStart, true, false);
    ASSERT_TRUE(
        robot.spin(3s, [&] { return robot.got.size() == static_cast<std::size_t>(i) + 1; }));
  }
  cv::Mat mask(240, 320, CV_8UC1, robot.got.back()->data.data());
  EXPECT_GT(cv::countNonZero(mask(Scene::place(2))), 12000);
}

TEST(MaskNode, ObjectsHaveIdsPlacesAndVelocities) {
  Robot robot("objects", false,
              {rclcpp::Parameter("mask_wait_s", 0.1), rclcpp::Parameter("poses", "odometry")});
  const auto poses = robot.host->create_publisher<nav_msgs::msg::Odometry>("odometry", 10);
  msg::ObjectArray objects;
  visualization_msgs::msg::MarkerArray markers;
  const auto kept = robot.host->create_subscription<msg::ObjectArray>(
      "objects", 10, [&](msg::ObjectArray::ConstSharedPtr m) { objects = *m; });
  const auto kept_too = robot.host->create_subscription<visualization_msgs::msg::MarkerArray>(
      "markers", 10, [&](visualization_msgs::msg::MarkerArray::ConstSharedPtr m) { markers = *m; });
  robot.spin(5s, [&] { return poses->get_subscription_count() > 0; });
  robot.spin(500ms, [] { return false; });
  for (int i = 0; i < 30; ++i) {
    nav_msgs::msg::Odometry pose;  // the camera stands still at x = 5 m
    pose.header.stamp = to_message(Scene::labels(0), "mono8", kStart + i * kStep).header.stamp;
    pose.header.frame_id = "odom", pose.child_frame_id = "camera";
    pose.pose.pose.position.x = 5;
    poses->publish(pose);
    robot.spin(10ms, [] { return false; });
    ASSERT_TRUE(robot.mask(i)) << i;
  }
  const auto last = robot.got.back()->header;
  ASSERT_TRUE(robot.spin(3s, [&] { return objects.header == last && !markers.markers.empty(); }));
  ASSERT_EQ(objects.objects.size(), 1u);
  EXPECT_EQ(objects.world_frame, "odom");
  const msg::Object& person = objects.objects[0];
  EXPECT_EQ(person.class_name, "person");
  EXPECT_NEAR(person.width, 80, 20) << "the depth fusion works in cells";
  EXPECT_NEAR(person.x, Scene::place(29).x, 10);
  EXPECT_GT(person.tracked_s, 0.8);
  ASSERT_EQ(person.in_camera.size(), 1u);
  ASSERT_EQ(person.in_world.size(), 1u);
  const double x = 2.0 * (Scene::place(29).x + 40 - 159.5) / 262.5;
  EXPECT_NEAR(person.in_camera[0].position.z, 2, 0.1);
  EXPECT_NEAR(person.in_camera[0].position.x, x, 0.1);
  EXPECT_NEAR(person.in_world[0].position.x, 5 + x, 0.1);
  EXPECT_NEAR(person.in_camera[0].velocity.x, 3 * 2.0 / 262.5 * 30, 0.2);
  EXPECT_GT(person.in_camera[0].covariance[0], 0);
  EXPECT_EQ(markers.markers.size(), 4u) << "all gone, place, velocity, name";
}

TEST(MaskNode, DiagnosticsSayWhatIsWrong) {
  Robot robot("diagnostics", false, {rclcpp::Parameter("stalled_after_s", 0.5)});
  std::string said;
  const auto kept = robot.host->create_subscription<diagnostic_msgs::msg::DiagnosticArray>(
      "/diagnostics", 10, [&](diagnostic_msgs::msg::DiagnosticArray::ConstSharedPtr m) {
        if (m->status.at(0).name.find("/diagnostics/stillpoint") != std::string::npos)
          said = std::to_string(m->status[0].level) + " " + m->status[0].message;
      });
  EXPECT_TRUE(robot.spin(5s, [&] { return said.find("2 no color image") == 0; })) << said;
  for (int i = 0; i < 600 && said != "0 masks are made"; ++i)
    ASSERT_TRUE(robot.mask(i % 60, kStart + i / 60 * 60 * kStep)) << i;
  EXPECT_EQ(said, "0 masks are made");
}

// A subscriber of the masks that never reads must not hold camera and node.
TEST(MaskNode, ASlowSubscriberHoldsNobody) {
  Robot robot("slow");
  const auto slow = std::make_shared<rclcpp::Node>("slow_one", "slow");
  const auto never_spun =
      slow->create_subscription<Image>("mask", rclcpp::QoS(100), [](Image::ConstSharedPtr) {});
  robot.spin(500ms, [] { return false; });
  for (int i = 0; i < 40; ++i) ASSERT_TRUE(robot.mask(i)) << i;
}

}  // namespace
}  // namespace stillpoint_ros

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  rclcpp::init(argc, argv);
  const int status = RUN_ALL_TESTS();
  rclcpp::shutdown();
  return status;
}
