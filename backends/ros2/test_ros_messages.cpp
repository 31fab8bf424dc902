// SPDX-License-Identifier: BSD-2-Clause
//
// The fields of ROS 2's messages, without ROS.

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <cstring>
#include <memory>
#include <opencv2/core.hpp>
#include <stillpoint/backends/ros2/image_outputs.hpp>
#include <stillpoint/backends/ros2/read_messages.hpp>
#include <stillpoint/backends/ros2/write_messages.hpp>
#include <string>
#include <utility>
#include <vector>

namespace {

using namespace stillpoint;
using namespace stillpoint::ros2;

struct Header {
  struct {
    std::int32_t sec;
    std::uint32_t nanosec;
  } stamp;
  std::string frame_id;
};
struct Vector {
  double x = 0, y = 0, z = 0;
};
struct Quaternion {
  double x = 0, y = 0, z = 0, w = 0;
};
struct Image {
  Header header;
  std::uint32_t height = 0, width = 0;
  std::string encoding;
  std::uint8_t is_bigendian = 0;
  std::uint32_t step = 0;
  std::vector<std::uint8_t> data;
};
struct CameraInfo {
  std::uint32_t height = 480, width = 640;
  std::string distortion_model = "plumb_bob";
  std::vector<double> d{0.1, 0, 0, 0, 0};
  std::array<double, 9> k{500, 0, 320, 0, 501, 240, 0, 0, 1};
  std::array<double, 12> p{};
  std::uint32_t binning_x = 2, binning_y = 3;
  struct {
    std::uint32_t x_offset = 4, y_offset = 5, height = 6, width = 7;
  } roi;
};
struct Detections {
  struct Result {
    struct {
      std::string class_id;
      double score;
    } hypothesis;
  };
  struct Detection2D {
    std::vector<Result> results;
    struct {
      struct {
        Vector position;
      } center;
      double size_x = 0, size_y = 0;
    } bbox;
  };
  Header header;
  std::vector<Detection2D> detections;
};
struct State {
  Vector position, velocity;
  std::array<double, 36> covariance{};
};
struct Object {
  int id = -1;
  std::string class_name;
  float score = 0;
  bool predicted = false;
  float tracked_s = 0, unseen_s = 0;
  int x = 0, y = 0, width = 0, height = 0;
  std::vector<State> in_camera, in_world;
};
struct Objects {
  Header header;
  std::string world_frame;
  std::vector<Object> objects;
};
struct Markers {
  struct Marker {
    enum { ARROW = 0, SPHERE = 2, TEXT_VIEW_FACING = 9, DELETEALL = 3 };
    Header header;
    std::string ns, text;
    int id = 0, type = 0, action = 0;
    struct {
      Vector position;
      Quaternion orientation;
    } pose;
    Vector scale;
    struct {
      float r, g, b, a;
    } color;
    std::vector<Vector> points;
  };
  std::vector<Marker> markers;
};
struct Status {
  unsigned char level = 9;
  std::string name, message, hardware_id;
  struct Pair {
    std::string key, value;
  };
  std::vector<Pair> values;
};
struct Value {
  std::uint8_t type = 0;
  bool bool_value = false;
  std::int64_t integer_value = 0;
  double double_value = 0;
  std::string string_value;
  std::vector<std::int64_t> integer_array_value;
  std::vector<std::string> string_array_value;
};

ImageMessage like(Nanoseconds stamp) {
  ImageMessage m;
  m.stamp = stamp, m.frame_id = "camera";
  return m;
}

TEST(Ros2Messages, ImagesAreReadAsTheyAreWritten) {
  const cv::Mat all(4, 6, CV_16UC1, cv::Scalar(0x1234)), part = all(cv::Rect(1, 1, 3, 2));
  auto message = std::make_shared<Image>();
  write_image(like(1341846313000000042), "16UC1", part, *message);
  EXPECT_EQ(message->header.stamp.sec, 1341846313);
  EXPECT_EQ(message->header.stamp.nanosec, 42u);
  EXPECT_EQ(message->step, 6u);
  EXPECT_EQ(message->data.size(), 12u) << "only what is seen";
  const ImageMessage m = read_image(std::shared_ptr<const Image>(message));
  EXPECT_EQ(m.stamp, 1341846313000000042);
  EXPECT_EQ(m.frame_id, "camera");
  EXPECT_EQ(m.data, message->data.data()) << "shared, not copied";
  EXPECT_EQ(message.use_count(), 2) << "kept alive";
  cv::Mat depth;
  EXPECT_EQ(to_depth(m, depth), "");
  EXPECT_EQ(cv::norm(depth, part, cv::NORM_INF), 0);
  const SegmentationMessage labels = read_labels(std::shared_ptr<const Image>(message));
  EXPECT_TRUE(labels.has_labels);
  EXPECT_EQ(labels.stamp, m.stamp);
  EXPECT_EQ(labels.labels.data, m.data);
}

TEST(Ros2Messages, CalibrationIsRead) {
  const CameraInfo info;
  const CameraInfoMessage m = read_camera_info(info);
  EXPECT_EQ(std::make_pair(m.width, m.height), std::make_pair(640u, 480u));
  EXPECT_EQ(m.distortion_model, "plumb_bob");
  EXPECT_EQ(m.d, info.d);
  EXPECT_EQ(m.k, info.k);
  EXPECT_EQ(std::make_pair(m.binning_x, m.binning_y), std::make_pair(2u, 3u));
  EXPECT_EQ(std::make_pair(m.roi_x, m.roi_y), std::make_pair(4u, 5u));
  EXPECT_EQ(std::make_pair(m.roi_width, m.roi_height), std::make_pair(7u, 6u));
}

TEST(Ros2Messages, ABoxGetsItsMostProbableClass) {
  Detections message;
  message.header.stamp = {3, 500000000};
  message.detections.resize(2);  // the second has no class
  Detections::Detection2D& box = message.detections[0];
  box.results.resize(2);
  box.results[0].hypothesis = {"dog", 0.3};
  box.results[1].hypothesis = {"person", 0.6};
  box.bbox.center.position.x = 10, box.bbox.center.position.y = 20;
  box.bbox.size_x = 4, box.bbox.size_y = 6;
  const SegmentationMessage m = read_detections(message);
  EXPECT_EQ(m.stamp, 3500000000);
  EXPECT_FALSE(m.has_labels);
  ASSERT_EQ(m.detections.size(), 1u);
  EXPECT_EQ(m.detections[0].class_name, "person");
  EXPECT_EQ(m.detections[0].score, 0.6);
  EXPECT_EQ(m.detections[0].center_y, 20);
  EXPECT_EQ(m.detections[0].width, 4);
}

TEST(Ros2Messages, TransformsMapPoints) {
  const Vector p{1, 2, 3};
  const Eigen::Isometry3d T = read_transform(p, Quaternion{0, 0, 2, 2});  // 90 degrees about z
  EXPECT_TRUE((T * Eigen::Vector3d(1, 0, 0)).isApprox(Eigen::Vector3d(1, 3, 3)));
}

TEST(Ros2Messages, ParametersOfEveryTypeAreRead) {
  Parameters p;
  Value value;
  value.bool_value = true, value.integer_value = 7, value.double_value = 0.5;
  value.string_value = "paper";
  value.integer_array_value = {15}, value.string_array_value = {"dog"};
  const auto read = [&](const char* name, std::uint8_t type) {
    value.type = type;
    return read_parameter(name, value, p);
  };
  EXPECT_EQ(read("rectified", 1) + read("queue_size", 2) + read("max_wait_s", 3) +
                read("preset", 4) + read("dynamic_labels", 7) + read("dynamic_classes", 9),
            "");
  EXPECT_TRUE(p.rectified);
  EXPECT_EQ(p.queue_size, 7);
  EXPECT_EQ(p.max_wait_s, 0.5);
  EXPECT_EQ(p.preset, "paper");
  EXPECT_EQ(p.dynamic_labels, std::vector<std::int64_t>{15});
  EXPECT_EQ(p.dynamic_classes, std::vector<std::string>{"dog"});
  EXPECT_NE(read("queue_size", 4).find("found a text"), std::string::npos);
  EXPECT_NE(read("queue_size", 5).find("found the type 5"), std::string::npos);
  EXPECT_EQ(p.queue_size, 7);
  EXPECT_TRUE(is_parameter("queue_size"));
  EXPECT_FALSE(is_parameter("use_sim_time"));
}

DynamicObject walking() {
  DynamicObject object;
  object.id = 4, object.class_name = "person", object.score = 0.5f, object.predicted = true;
  object.tracked_s = 2, object.unseen_s = 0.25, object.box = {1, 2, 3, 4};
  object.in_camera.emplace();
  object.in_camera->centroid_m = {1, 2, 3}, object.in_camera->velocity_m_s = {0.5, 0, 0};
  object.in_camera->covariance(1, 2) = 0.125;
  return object;
}

TEST(Ros2Messages, ObjectsAreWritten) {
  Objects m;
  write_objects({walking()}, like(5000000001), "odom", m);
  EXPECT_EQ(m.header.stamp.nanosec, 1u);
  EXPECT_EQ(m.world_frame, "odom");
  ASSERT_EQ(m.objects.size(), 1u);
  const Object& o = m.objects[0];
  EXPECT_EQ(o.id, 4);
  EXPECT_EQ(o.class_name, "person");
  EXPECT_EQ(o.score, 0.5f);
  EXPECT_TRUE(o.predicted);
  EXPECT_EQ(o.tracked_s, 2);
  EXPECT_EQ(o.unseen_s, 0.25);
  EXPECT_EQ(cv::Rect(o.x, o.y, o.width, o.height), cv::Rect(1, 2, 3, 4));
  EXPECT_TRUE(o.in_world.empty()) << "no pose is known";
  ASSERT_EQ(o.in_camera.size(), 1u);
  EXPECT_EQ(o.in_camera[0].position.y, 2);
  EXPECT_EQ(o.in_camera[0].velocity.x, 0.5);
  EXPECT_EQ(o.in_camera[0].covariance[8], 0.125) << "row by row";
}

TEST(Ros2Messages, MarkersShowObjectsThatHaveAPlace) {
  Markers m;
  DynamicObject without = walking();
  without.in_camera.reset();
  write_markers({without, walking()}, like(1), m);
  ASSERT_EQ(m.markers.size(), 4u);
  EXPECT_EQ(m.markers[0].action, Markers::Marker::DELETEALL);
  EXPECT_EQ(m.markers[1].pose.position.z, 3);
  ASSERT_EQ(m.markers[2].points.size(), 2u);
  EXPECT_EQ(m.markers[2].points[1].x, 1.5) << "in a second";
  EXPECT_EQ(m.markers[3].text, "4 person 0.5 m/s");
  for (const auto& marker : m.markers) EXPECT_EQ(marker.header.frame_id, "camera");
}

TEST(Ros2Messages, DiagnosticsAreWritten) {
  DiagnosticReport report;
  report.level = DiagnosticReport::kWarn, report.message = "no depth";
  report.values = {{"frames", "3"}};
  Status m;
  write_diagnostics(report, "node: masks", m);
  EXPECT_EQ(m.level, 1);
  EXPECT_EQ(m.name, "node: masks");
  EXPECT_EQ(m.message, "no depth");
  ASSERT_EQ(m.values.size(), 1u);
  EXPECT_EQ(m.values[0].key + m.values[0].value, "frames3");
}

TEST(Ros2Messages, ImagesToPublishAreMaskedAndHaveTheirHeaders) {
  StreamFrame frame;
  frame.color = like(1000), frame.depth = like(1001);
  frame.frame.color = cv::Mat(2, 2, CV_8UC3, cv::Scalar(10, 20, 30));
  frame.frame.depth = cv::Mat(2, 2, CV_16UC1, cv::Scalar(700));
  cv::Mat mask = cv::Mat::zeros(2, 2, CV_8UC1);
  mask.at<uchar>(0, 1) = 255;
  const auto make = [&](const std::string& topic) {
    for (const ImageOutput& output : kImageOutputs)
      if (output.topic == topic) return output.make(frame, mask);
    ADD_FAILURE() << topic;
    return OutputImage();
  };
  EXPECT_EQ(make("mask").image.data, mask.data);
  EXPECT_EQ(make("static_mask").image.at<uchar>(0, 1), 0);
  EXPECT_EQ(make("static_mask").image.at<uchar>(0, 0), 255);
  const OutputImage depth = make("depth_static");
  EXPECT_EQ(depth.encoding, "16UC1");
  EXPECT_EQ(depth.like->stamp, 1001) << "the depth image's";
  EXPECT_EQ(depth.image.at<std::uint16_t>(0, 1), 0);
  EXPECT_EQ(depth.image.at<std::uint16_t>(1, 1), 700);
  const OutputImage color = make("color_static");
  EXPECT_EQ(color.encoding, "bgr8");
  EXPECT_EQ(color.image.at<cv::Vec3b>(0, 1), cv::Vec3b(0, 0, 0));
  EXPECT_EQ(color.image.at<cv::Vec3b>(0, 0), cv::Vec3b(10, 20, 30));
  EXPECT_EQ(make("overlay").image.at<cv::Vec3b>(0, 0), cv::Vec3b(10, 20, 30));
  EXPECT_GT(make("overlay").image.at<cv::Vec3b>(0, 1)[2], 100) << "red";
  EXPECT_EQ(frame.frame.color.at<cv::Vec3b>(0, 1), cv::Vec3b(10, 20, 30)) << "not in place";
  frame.depth.reset(), frame.frame.depth = cv::Mat();
  EXPECT_TRUE(make("depth_static").image.empty());
  frame.frame.color = cv::Mat(2, 2, CV_8UC1, cv::Scalar(9));
  EXPECT_EQ(make("color_static").encoding, "mono8");
  EXPECT_EQ(make("overlay").encoding, "bgr8");
}

}  // namespace
