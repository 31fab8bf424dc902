// SPDX-License-Identifier: BSD-2-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <memory>
#include <random>
#include <stillpoint/backends/ros2/camera_info.hpp>
#include <stillpoint/backends/ros2/images.hpp>
#include <stillpoint/backends/ros2/parameters.hpp>
#include <stillpoint/backends/ros2/pose_buffer.hpp>
#include <stillpoint/backends/ros2/segmentations.hpp>
#include <stillpoint/backends/ros2/synchronizer.hpp>
#include <stillpoint/backends/ros2/warnings.hpp>
#include <stillpoint/core/distortion.hpp>
#include <stillpoint/front_end.hpp>
#include <string>
#include <vector>

#include "test_messages.hpp"

namespace {

using namespace stillpoint;
using namespace stillpoint::ros2;

void expect_has(const std::string& text, const std::string& part) {
  EXPECT_NE(text.find(part), std::string::npos) << text;
}

// ---- images

TEST(Ros2Images, ColorComesAsBgrOrGrey) {
  cv::Mat bgr(3, 5, CV_8UC3);
  cv::randu(bgr, 0, 256);
  cv::Mat rgb, bgra, rgba, grey, out;
  cv::cvtColor(bgr, rgb, cv::COLOR_BGR2RGB);
  cv::cvtColor(bgr, bgra, cv::COLOR_BGR2BGRA);
  cv::cvtColor(bgr, rgba, cv::COLOR_BGR2RGBA);
  cv::cvtColor(bgr, grey, cv::COLOR_BGR2GRAY);
  const std::vector<std::pair<std::string, cv::Mat>> given = {
      {"rgb8", rgb}, {"bgr8", bgr}, {"bgra8", bgra}, {"rgba8", rgba}, {"8UC3", bgr}};
  for (const auto& [encoding, image] : given)
    for (const int padding : {0, 7}) {
      ASSERT_EQ(to_color(image_message(image, encoding, 1, padding), out), "") << encoding;
      EXPECT_TRUE(same(out, bgr)) << encoding << " padding " << padding;
    }
  ASSERT_EQ(to_color(image_message(grey, "mono8", 1, 3), out), "");
  EXPECT_TRUE(same(out, grey));
}

TEST(Ros2Images, DepthIsReadAtAnyStepAndByteOrder) {
  cv::Mat depth(4, 5, CV_16UC1), metres(4, 5, CV_32FC1), out;
  cv::randu(depth, 0, 65536);
  cv::randu(metres, 0, 10);
  metres.at<float>(1, 1) = std::numeric_limits<float>::quiet_NaN();
  for (const bool big : {false, true})
    for (const int padding : {0, 1, 6}) {  // 1: no multiple of the element's size
      ASSERT_EQ(to_depth(image_message(depth, "16UC1", 1, padding, big), out), "");
      EXPECT_TRUE(same(out, depth)) << padding << big;
      ASSERT_EQ(to_depth(image_message(metres, "32FC1", 1, padding, big), out), "");
      EXPECT_TRUE(same(out, metres)) << padding << big;
    }
}

TEST(Ros2Images, WhatCannotBeReadIsNamed) {
  const cv::Mat image(4, 5, CV_8UC3, cv::Scalar::all(7)), depth(4, 5, CV_16UC1, cv::Scalar(9));
  cv::Mat out = image.clone();
  const std::string encoding = to_color(image_message(image, "yuv422_yuy2", 1), out);
  expect_has(encoding, "rgb8, bgr8, mono8");
  expect_has(encoding, "found 'yuv422_yuy2'");
  EXPECT_TRUE(same(out, image)) << "left alone";
  expect_has(to_depth(image_message(image, "rgb8", 1), out), "16UC1, 32FC1");
  expect_has(to_labels(image_message(image, "rgb8", 1), out), "mono8");

  ImageMessage cut = image_message(depth, "16UC1", 1);
  --cut.bytes;
  expect_has(to_depth(cut, out), "expected at least 40 bytes of data, found 39");
  cut.step = 9;
  expect_has(to_depth(cut, out), "step of at least 10 bytes");
  cut.width = 0;
  expect_has(to_depth(cut, out), "found 0x4");
  ImageMessage huge = image_message(depth, "16UC1", 1);
  huge.height = huge.width = 0xffffffff;
  expect_has(to_depth(huge, out), "expected an image");
  EXPECT_TRUE(same(out, image));
}

// ---- camera_info

CameraInfoMessage info(const std::string& model, std::vector<double> d) {
  CameraInfoMessage m;
  m.width = 640, m.height = 480;
  m.distortion_model = model;
  m.d = std::move(d);
  m.k = {525, 0, 319.5, 0, 520, 239.5, 0, 0, 1};
  m.p = {500, 0, 320, 0, 0, 500, 240, 0, 0, 0, 1, 0};
  return m;
}
const cv::Size kVga(640, 480);

TEST(Ros2CameraInfo, PlumbBobIsOurLens) {
  Camera c;
  ASSERT_EQ(to_camera(info("plumb_bob", {0.1, -0.2, 0.001, 0.002, 0.3}), kVga, false, 1000, c), "");
  EXPECT_EQ(c.fx, 525);
  EXPECT_EQ(c.fy, 520);
  EXPECT_EQ(c.cx, 319.5);
  EXPECT_EQ(c.cy, 239.5);
  EXPECT_EQ(c.distortion(), (cv::Vec<double, 5>(0.1, -0.2, 0.001, 0.002, 0.3)));
  EXPECT_EQ(c.width, 640);
  EXPECT_EQ(c.depth_units_per_m, 1000);
  ASSERT_EQ(to_camera(info("", {}), kVga, false, 1000, c), "");
  EXPECT_FALSE(c.distorted());
}

TEST(Ros2CameraInfo, WhatIsNotKnownIsNoChange) {
  CameraInfoMessage m = info("plumb_bob", {});
  m.p[0] = std::nan("");
  const CameraInfoMessage same = m;
  EXPECT_TRUE(m == same);
  m.p[0] = 500;
  EXPECT_FALSE(m == same);
}

TEST(Ros2CameraInfo, RectifiedImagesHaveTheProjectionsCamera) {
  Camera c;
  ASSERT_EQ(to_camera(info("equidistant", {1, 2, 3, 4}), kVga, true, 1000, c), "");
  EXPECT_EQ(c.fx, 500);
  EXPECT_EQ(c.cy, 240);
  EXPECT_FALSE(c.distorted());
}

TEST(Ros2CameraInfo, BinningAndRegionShiftAndScale) {
  Camera c;
  CameraInfoMessage m = info("plumb_bob", {});
  m.binning_x = m.binning_y = 2;
  ASSERT_EQ(to_camera(m, {320, 240}, false, 1000, c), "");
  EXPECT_EQ(c.fx, 262.5);
  m.roi_x = 100, m.roi_y = 60, m.roi_width = 400, m.roi_height = 300;
  ASSERT_EQ(to_camera(m, {200, 150}, false, 1000, c), "");
  EXPECT_EQ(c.cx, (319.5 - 100) / 2);
  EXPECT_EQ(c.cy, (239.5 - 60) / 2);
}

// A rational lens, as Kinects with time of flight have it: where its pixels lie.
TEST(Ros2CameraInfo, RationalLensIsFittedToHalfAPixel) {
  const std::vector<double> d = {0.57, -2.6, 0.0008, -0.0003, 1.5, 0.45, -2.43, 1.43};
  Camera c;
  ASSERT_EQ(to_camera(info("rational_polynomial", d), kVga, false, 1000, c), "");
  ASSERT_TRUE(c.distorted());
  for (double x = -0.6; x <= 0.6; x += 0.1)
    for (double y = -0.45; y <= 0.45; y += 0.1) {
      const double r2 = x * x + y * y;
      const double radial =
          (1 + r2 * (d[0] + r2 * (d[1] + r2 * d[4]))) / (1 + r2 * (d[5] + r2 * (d[6] + r2 * d[7])));
      const Eigen::Vector2d exact(x * radial + 2 * d[2] * x * y + d[3] * (r2 + 2 * x * x),
                                  y * radial + d[2] * (r2 + 2 * y * y) + 2 * d[3] * x * y);
      EXPECT_LT(525 * (distort_normalized(c, {x, y}) - exact).norm(), 0.6) << x << " " << y;
    }
  ASSERT_EQ(
      to_camera(info("rational_polynomial", {0.1, 0.2, 0, 0, 0.3, 0, 0, 0}), kVga, false, 1000, c),
      "");
  EXPECT_EQ(c.k3, 0.3);
}

TEST(Ros2CameraInfo, WhatDoesNotFitIsRefused) {
  Camera c;
  const auto refused = [&](const CameraInfoMessage& m, const std::string& part) {
    c.fx = c.fy = 1;
    expect_has(to_camera(m, kVga, false, 1000, c), part);
    EXPECT_FALSE(c.valid()) << part;
  };
  refused(info("equidistant", {0, 0, 0, 0}), "found 'equidistant' with 4");
  refused(info("plumb_bob", {1, 2, 3}), "found 'plumb_bob' with 3");
  refused(info("plumb_bob", {1, 2, 3, NAN, 5}), "finite");
  refused(info("rational_polynomial", {0, 0, 0, 0, 0, 0, 0, 50}), "0.5 px");
  refused(info("rational_polynomial", {-2, 0, 0, 0, 0, 1, 0, 0}), "folds back");
  CameraInfoMessage m = info("plumb_bob", {});
  m.k = {};
  refused(m, "calibrate");
  m = info("plumb_bob", {});
  m.width = 1280, m.height = 720;
  refused(m, "expected the calibration of an image of 640x480, found one of 1280x720");
}

// ---- segmentations

TEST(Ros2Segmentations, LabelImagesOfInstancesMasksAndClasses) {
  cv::Mat labels = cv::Mat::zeros(kVga, CV_8UC1);
  labels(cv::Rect(10, 10, 40, 60)) = 1;
  labels(cv::Rect(200, 10, 40, 60)) = 3;
  Segmentation out;
  const std::int64_t stamp = 1341846313592026000;
  ASSERT_EQ(to_segmentation(label_message(labels, "mono8", stamp), kVga, {}, "cat", out), "");
  EXPECT_TRUE(out.available);
  EXPECT_EQ(out.timestamp, 1341846313.592026);
  ASSERT_EQ(out.instances.size(), 2u);
  EXPECT_EQ(out.instances[1].box, cv::Rect(200, 10, 40, 60));
  EXPECT_EQ(out.instances[1].class_name, "cat");

  ASSERT_EQ(to_segmentation(label_message(labels > 0, "mono8", stamp), kVga, {}, "cat", out), "");
  EXPECT_EQ(out.instances.size(), 2u) << "connected parts";

  cv::Mat wide;
  labels.convertTo(wide, CV_16U);
  wide(cv::Rect(400, 300, 100, 100)) = 700;  // a class that does not move
  wide(cv::Rect(300, 100, 50, 50)) = 1015;
  expect_has(to_segmentation(label_message(wide, "16UC1", stamp), kVga, {}, "person", out),
             "dynamic_labels");
  EXPECT_FALSE(out.available);
  ASSERT_EQ(to_segmentation(label_message(wide, "16UC1", stamp), kVga, {1015, 3}, "person", out),
            "");
  ASSERT_EQ(out.instances.size(), 2u);
  EXPECT_EQ(out.instances[0].box, cv::Rect(200, 10, 40, 60));
  EXPECT_EQ(out.instances[1].box, cv::Rect(300, 100, 50, 50));
}

TEST(Ros2Segmentations, SmallerLabelImagesAreScaled) {
  cv::Mat labels = cv::Mat::zeros(120, 160, CV_8UC1);
  labels(cv::Rect(10, 20, 30, 40)) = 1;
  Segmentation out;
  ASSERT_EQ(to_segmentation(label_message(labels, "mono8", 1), kVga, {}, "person", out), "");
  EXPECT_EQ(out.instances.at(0).box, cv::Rect(40, 80, 120, 160));
  const cv::Mat square = cv::Mat::zeros(160, 160, CV_8UC1);
  expect_has(to_segmentation(label_message(square, "mono8", 1), kVga, {}, "person", out),
             "found 160x160");
}

TEST(Ros2Segmentations, BoxesAreCutToTheImage) {
  SegmentationMessage m;
  m.stamp = 1;
  m.detections = {{"person", 0.75, 100, 100, 50, 80}, {"chair", 0.5, 0, 0, 40, 20},
                  {"person", 1, -500, 0, 40, 20},     {"person", 1, NAN, 0, 40, 20},
                  {"person", 1, 1e300, 0, 1e300, 20}, {"person", 1, 5, 5, -3, 20}};
  Segmentation out;
  ASSERT_EQ(to_segmentation(m, kVga, {}, "", out), "");
  ASSERT_EQ(out.instances.size(), 2u);
  EXPECT_EQ(out.instances[0].box, cv::Rect(75, 60, 50, 80));
  EXPECT_EQ(out.instances[0].score, 0.75f);
  EXPECT_TRUE(out.instances[0].mask.empty());
  EXPECT_EQ(out.instances[1].class_name, "chair");
  EXPECT_EQ(out.instances[1].box, cv::Rect(0, 0, 20, 10));
}

// ---- stamps, poses, parameters, warnings

TEST(Ros2Stamps, SecondsAreThoseOfTheDecimalText) {
  std::mt19937_64 random(1);
  for (int i = 0; i < 1000; ++i) {
    const std::int64_t micros =
        std::uniform_int_distribution<std::int64_t>(0, 1900000000000000)(random);
    const std::string digits = std::to_string(micros % 1000000);
    const std::string text =
        std::to_string(micros / 1000000) + "." + std::string(6 - digits.size(), '0') + digits;
    EXPECT_EQ(seconds(micros * 1000), std::stod(text)) << text;
    EXPECT_EQ(seconds(nanoseconds(std::stod(text))), std::stod(text)) << text;
  }
}

TEST(Ros2PoseBuffer, InterpolatesBetweenNeighborsOnly) {
  PoseBuffer buffer(100, 3);
  const auto pose = [](double angle, double x) {
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.linear() = Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    T.translation().x() = x;
    return T;
  };
  EXPECT_FALSE(buffer.at(1));
  buffer.add(1000, pose(0, 0));
  buffer.add(1100, pose(0.4, 2));
  EXPECT_FALSE(buffer.at(999));
  EXPECT_FALSE(buffer.at(1101));
  EXPECT_TRUE(buffer.at(1100)->isApprox(pose(0.4, 2)));
  EXPECT_TRUE(buffer.at(1025)->isApprox(pose(0.1, 0.5)));
  buffer.add(1300, pose(1, 3));
  EXPECT_FALSE(buffer.at(1200)) << "a gap is not bridged";
  buffer.add(1250, pose(0, 0));
  EXPECT_TRUE(buffer.at(1300)) << "late poses are left out";
  buffer.add(1400, pose(0, 0));
  EXPECT_FALSE(buffer.at(1000)) << "bounded";
  buffer.add(10, pose(0, 7));
  EXPECT_FALSE(buffer.at(1300)) << "time went back";
  EXPECT_TRUE(buffer.at(10)->isApprox(pose(0, 7)));
  buffer.add(20, Eigen::Isometry3d(Eigen::Matrix4d::Constant(NAN)));
  EXPECT_FALSE(buffer.at(20));
}

TEST(Ros2OdometryPoses, PutsTheCameraOnItsBody) {
  OdometryPoses poses;
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  std::string asked;
  const auto mount = [&](const std::string& body, const std::string& camera,
                         Eigen::Isometry3d& on) {
    asked += body + "<" + camera + " ";
    on.translation().z() = 1.5;
    return std::string(camera == "lost" ? "expected a transform" : "");
  };
  EXPECT_EQ(poses.at(1000000000, "camera", mount, T),
            "expected poses before and after the stamp 1.000, at most 0.2 s apart, found none");
  const Eigen::Isometry3d body(Eigen::Translation3d(2, 0, 0));
  poses.add(1000000000, "odom", "base", body);
  poses.add(1100000000, "odom", "base", body);
  EXPECT_EQ(poses.world_frame(), "odom");
  EXPECT_EQ(poses.at(1050000000, "camera", mount, T), "");
  EXPECT_EQ(asked, "base<camera ");
  EXPECT_TRUE(T.translation().isApprox(Eigen::Vector3d(2, 0, 1.5)));
  EXPECT_EQ(poses.at(1050000000, "lost", mount, T), "expected a transform");
  EXPECT_EQ(poses.at(1050000000, "base", mount, T), "");
  EXPECT_TRUE(T.translation().isApprox(Eigen::Vector3d(2, 0, 0))) << "odometry of the camera";
  EXPECT_NE(poses.at(1200000000, "base", mount, T).find("found them from 1.000 to 1.100"),
            std::string::npos);
  poses.add(1100000000, "odom", "", body);
  EXPECT_NE(poses.at(1050000000, "camera", mount, T).find("child_frame_id"), std::string::npos)
      << "of the wheels or of the camera: nobody knows";
}

TEST(Ros2Parameters, EveryDefaultIsAllowedAndSettable) {
  const Parameters defaults;
  for (const ParameterDescription& d : parameter_descriptions()) {
    Parameters p;
    EXPECT_EQ(set_parameter(p, d.name, d.value(defaults)), "") << d.name;
    EXPECT_GT(std::string(d.text).size(), 5u) << d.name;
    if (!d.choices.empty())
      for (const std::string& choice : d.choices) {
        EXPECT_EQ(set_parameter(p, d.name, choice), "");
        EXPECT_NO_THROW(FrontEnd{p.front_end()}) << d.name << " " << choice;
      }
    if (d.most > d.least) {
      expect_has(set_parameter(p, d.name, d.most + 1), std::string("parameter ") + d.name);
    }
  }
}

TEST(Ros2Parameters, WrongOnesAreRefusedAndChangeNothing) {
  Parameters p;
  EXPECT_EQ(set_parameter(p, "max_mask_age_s", std::int64_t(3)), "");
  EXPECT_EQ(p.front_end().late.max_age_s, 3) << "a whole number is a number";
  expect_has(set_parameter(p, "max_mask_age_s", std::string("3")),
             "expected a number, found a text");
  expect_has(set_parameter(p, "max_mask_age_s", std::nan("")), "expected 0");
  expect_has(set_parameter(p, "queue_size", 2.5), "expected a whole number");
  expect_has(set_parameter(p, "queue_size", std::int64_t(0)), "found 0");
  expect_has(set_parameter(p, "preset", std::string("best")),
             "expected one of default, network_only, paper, found 'best'");
  expect_has(set_parameter(p, "dynamic_classes", std::vector<std::string>{}), "at least one");
  expect_has(set_parameter(p, "dilation", 3.0), "there is none of that name");
  EXPECT_EQ(p.max_mask_age_s, 3);
  EXPECT_EQ(p.queue_size, 5);
  EXPECT_EQ(p.preset, "default");
  EXPECT_EQ(set_parameter(p, "preset", std::string("network_only")), "");
  EXPECT_FALSE(p.front_end().use_motion);
  EXPECT_EQ(set_parameter(p, "dilation_px", 12.0), "");
  EXPECT_EQ(p.front_end().depth.dilation_px, 12);
}

TEST(Ros2Warnings, EachKindOncePerPeriod) {
  std::vector<std::string> said;
  double now_s = 100;
  Warnings warnings([&](const std::string& text) { said.push_back(text); }, [&] { return now_s; });
  warnings.set_period(10);
  warnings.say("a", "first");
  warnings.say("a", "second");
  warnings.say("b", "other");
  now_s = 109;
  warnings.say("a", "third");
  EXPECT_EQ(said, (std::vector<std::string>{"first", "other"}));
  now_s = 111;
  warnings.say("a", "fourth");
  EXPECT_EQ(said.back(), "fourth (and 2 times since this was last said)");
  now_s = 130;
  warnings.say("a", "fifth");
  EXPECT_EQ(said.back(), "fifth");
}

}  // namespace
