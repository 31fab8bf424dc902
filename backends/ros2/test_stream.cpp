// SPDX-License-Identifier: BSD-2-Clause
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <mutex>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <stillpoint/backends/ros2/camera_stream.hpp>
#include <stillpoint/front_end.hpp>
#include <stillpoint/io/mask_folder.hpp>
#include <stillpoint/motion/ego_motion.hpp>
#include <string>
#include <thread>
#include <vector>

#include "../../tests/flat_scene.hpp"
#include "test_messages.hpp"

namespace {

using namespace stillpoint;
using namespace stillpoint::ros2;

const FlatScene kScene;
constexpr Nanoseconds kStart = 1341846313000000000;
constexpr Nanoseconds kStep = 33333333;

Figure person(int i) { return {{60 + 3 * i, 60, 80, 160}, 2, 7}; }

RgbdFrame frame_of(int i) { return kScene.frame(seconds(kStart + i * kStep), {person(i)}); }

cv::Mat labels_of(int i) {
  cv::Mat labels = cv::Mat::zeros(kScene.size, CV_8UC1);
  labels(person(i).box & cv::Rect(cv::Point(), kScene.size)) = 1;
  return labels;
}

CameraInfoMessage info_of(const Camera& camera) {
  CameraInfoMessage m;
  m.width = static_cast<std::uint32_t>(camera.width);
  m.height = static_cast<std::uint32_t>(camera.height);
  m.distortion_model = "plumb_bob";
  m.d.assign(5, 0);
  m.k = {camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1};
  return m;
}

Parameters parameters() {
  Parameters p;
  p.depth_units_per_m = 5000;  // the scene's
  return p;
}

// A stream whose warnings are kept.
struct Node {
  std::vector<std::string> said;
  std::mutex mutex;
  Warnings warnings{[this](const std::string& text) {
    const std::lock_guard<std::mutex> guard(mutex);
    said.push_back(text);
  }};
  CameraStream stream;

  explicit Node(const Parameters& p = parameters(), MaskMaker::PoseAt pose_at = {},
                bool calibrated = true)
      : stream(p, {"/color", "/depth", "/info", "/labels"}, warnings, std::move(pose_at)) {
    if (calibrated) stream.add_camera_info(info_of(kScene.camera()));
  }

  void color(int i, Nanoseconds t) {
    stream.add_color(image_message(frame_of(i).color, "bgr8", t));
  }
  void depth(int i, Nanoseconds t) {
    stream.add_depth(image_message(frame_of(i).depth, "16UC1", t));
  }
  void labels(int i, Nanoseconds t) {
    stream.add_segmentation(label_message(labels_of(i), "mono8", t));
  }
  // The i-th frame, whole.
  void frame(int i, Nanoseconds start = kStart) {
    labels(i, start + i * kStep), depth(i, start + i * kStep), color(i, start + i * kStep);
  }
  // The mask of the next frame; empty: there is none.
  cv::Mat mask() { return stream.next() ? stream.front_end().mask().image.clone() : cv::Mat(); }
  std::uint32_t status() const { return stream.front_end().stats().status; }
  bool has_said(const std::string& part) const {
    for (const std::string& text : said)
      if (text.find(part) != std::string::npos) return true;
    return false;
  }
};

TEST(Ros2Stream, MasksAreTheFrontEndsByteForByte) {
  Node node;
  FrontEnd front_end(parameters().front_end(), kScene.camera());
  for (int i = 0; i < 20; ++i) {
    node.frame(i);
    Segmentation segmentation;
    segmentation.available = true;
    segmentation.instances = instances_from_labels(labels_of(i));
    const DynamicMask& expected = front_end.compute_mask(frame_of(i), segmentation);
    const StreamFrame* frame = node.stream.next();
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->color.stamp, kStart + i * kStep);
    EXPECT_EQ(frame->color.frame_id, "camera");
    EXPECT_EQ(node.stream.front_end().mask().timestamp, expected.timestamp);
    EXPECT_TRUE(same(node.stream.front_end().mask().image, expected.image)) << i;
    EXPECT_GT(cv::countNonZero(expected.image), 5000);
  }
  EXPECT_FALSE(node.stream.next());
  EXPECT_TRUE(node.said.empty()) << node.said.front();
}

TEST(Ros2Stream, EncodingsOfOneImageGiveOneMask) {
  Node node, other;
  for (int i = 0; i < 5; ++i) {
    node.frame(i);
    const RgbdFrame frame = frame_of(i);
    const Nanoseconds t = kStart + i * kStep;
    cv::Mat rgb;
    cv::cvtColor(frame.color, rgb, cv::COLOR_BGR2RGB);
    other.stream.add_segmentation(label_message(labels_of(i), "mono8", t));
    other.stream.add_depth(image_message(frame.depth, "16UC1", t, 3, true));
    other.stream.add_color(image_message(rgb, "rgb8", t, 5));
    EXPECT_TRUE(same(node.mask(), other.mask())) << i;
  }
}

TEST(Ros2Stream, ABagThatLoopsGivesTheSameMasksAgain) {
  Node node;
  std::vector<cv::Mat> first;
  for (int round = 0; round < 3; ++round)
    for (int i = 0; i < 25; ++i) {
      node.frame(i);
      const cv::Mat mask = node.mask();
      ASSERT_FALSE(mask.empty()) << round << " " << i;
      if (round == 0)
        first.push_back(mask);
      else
        EXPECT_TRUE(same(mask, first[static_cast<std::size_t>(i)])) << round << " " << i;
    }
}

TEST(Ros2Stream, DepthThatStopsIsToldAndDoneWithout) {
  Node node;
  for (int i = 0; i < 10; ++i) node.frame(i), node.mask();
  EXPECT_FALSE(node.status() & kNoDepth);
  int made = 0;
  for (int i = 10; i < 60; ++i) {
    node.labels(i, kStart + i * kStep), node.color(i, kStart + i * kStep);
    while (!node.mask().empty()) {
      ++made;
      EXPECT_TRUE(node.status() & kNoDepth);
      EXPECT_FALSE(node.stream.front_end().mask().image.empty());
    }
  }
  EXPECT_EQ(made, 50) << "in the end nothing waits";
  EXPECT_TRUE(node.has_said("/depth: stamp: expected a depth image at most 0.02")) << made;
  EXPECT_EQ(node.said.size(), 1u) << "throttled";
  node.frame(60);
  EXPECT_FALSE(node.mask().empty());
  EXPECT_FALSE(node.status() & kNoDepth) << "it is back";
}

TEST(Ros2Stream, DepthThatIsNotRegisteredIsNamedAndLeftOut) {
  Node node;
  const auto give = [&](int i, ImageMessage depth) {
    depth.stamp = kStart + i * kStep;
    node.stream.add_depth(std::move(depth));
    node.color(i, kStart + i * kStep);
    EXPECT_FALSE(node.mask().empty()) << i;
  };
  cv::Mat small;
  cv::resize(frame_of(0).depth, small, {160, 120}, 0, 0, cv::INTER_NEAREST);
  give(0, image_message(small, "16UC1", 0));
  EXPECT_TRUE(node.status() & kNoDepth);
  EXPECT_TRUE(
      node.has_said("/depth: image: expected depth registered to color, 320x240, found 160x120"));
  node.said.clear();

  Parameters p = parameters();
  p.warn_period_s = 0;
  node.stream.set_parameters(p);
  ImageMessage other = image_message(frame_of(1).depth, "16UC1", 0);
  other.frame_id = "depth_camera";
  give(1, other);
  EXPECT_TRUE(node.status() & kNoDepth);
  EXPECT_TRUE(node.has_said("frame_id 'camera', found 'depth_camera'"));
  p.any_depth_frame = true;
  node.stream.set_parameters(p);
  give(2, other);
  EXPECT_FALSE(node.status() & kNoDepth);
  give(3, image_message(frame_of(3).color, "bgr8", 0));
  EXPECT_TRUE(node.status() & kNoDepth);
  EXPECT_TRUE(node.has_said("/depth: image: expected an encoding among 16UC1"));
}

TEST(Ros2Stream, WhatCannotBeUsedIsToldOnceAndTheNodeGoesOn) {
  Node node(parameters(), {}, false);
  for (int i = 0; i < 6; ++i) {
    const Nanoseconds t = kStart + i * kStep;
    node.depth(i, t);
    node.stream.add_color(image_message(frame_of(i).color, "bayer_rggb8", t));
  }
  EXPECT_TRUE(node.mask().empty());
  EXPECT_TRUE(node.has_said("/color: image: expected an encoding among rgb8"));
  EXPECT_TRUE(node.has_said("found 'bayer_rggb8'"));
  node.color(6, 0);
  EXPECT_TRUE(node.has_said("/color: stamp: expected the time of the exposure"));
  CameraInfoMessage fisheye = info_of(kScene.camera());
  fisheye.distortion_model = "equidistant";
  node.frame(7);
  EXPECT_FALSE(node.mask().empty());
  EXPECT_TRUE(node.has_said("/info: calibration: expected one, found no message so far"));
  node.said.clear();
  Parameters p = parameters();
  p.warn_period_s = 0;
  node.stream.set_parameters(p);
  node.stream.add_camera_info(fisheye);
  node.frame(8);
  EXPECT_FALSE(node.mask().empty());
  EXPECT_TRUE(node.has_said("/info: calibration: expected the distortion_model plumb_bob"));
  const cv::Mat square(100, 100, CV_8UC1, cv::Scalar(0));
  node.stream.add_segmentation(label_message(square, "mono8", kStart + 9 * kStep));
  node.depth(9, kStart + 9 * kStep), node.color(9, kStart + 9 * kStep);
  EXPECT_FALSE(node.mask().empty());
  EXPECT_TRUE(node.has_said("/labels: labels: expected the color image's size 320x240"));
  EXPECT_TRUE(node.status() & kNoSegmentation);
  const DiagnosticReport report = node.stream.report();
  EXPECT_EQ(report.level, DiagnosticReport::kWarn) << report.message;
}

// Labels of every third frame, five frames late: carried to where the person is now.
TEST(Ros2Stream, LateLabelsArePredictedForward) {
  Parameters p = parameters();
  p.preset = "network_only";
  Node node(p);
  double sum = 0;
  int judged = 0;
  for (int i = 0; i < 40; ++i) {
    node.depth(i, kStart + i * kStep), node.color(i, kStart + i * kStep);
    const cv::Mat mask = node.mask();
    ASSERT_FALSE(mask.empty());
    if (i >= 5 && i % 3 == 2) node.labels(i - 5, kStart + (i - 5) * kStep);
    if (i < 20) continue;
    sum += iou(mask, labels_of(i) > 0), ++judged;
  }
  EXPECT_GT(sum / judged, 0.8);
  // Left where they were they would lie beside: that shows that the test can tell.
  EXPECT_LT(iou(labels_of(15), labels_of(20)), 0.75);
  EXPECT_TRUE(node.said.empty()) << node.said.front();
}

TEST(Ros2Stream, LabelsOfAFrameThatNobodySawAreTold) {
  Node node;
  for (int i = 0; i < 10; ++i) {
    node.depth(i, kStart + i * kStep), node.color(i, kStart + i * kStep);
    node.mask();
    if (i == 8) node.labels(3, kStart + 3 * kStep + 1000000);  // a millisecond off: that frame
    if (i == 8) {
      EXPECT_TRUE(node.said.empty());
    }
  }
  EXPECT_GT(cv::countNonZero(node.stream.front_end().mask().image), 5000);
  Parameters p = parameters();
  p.max_time_difference_s = 0.001;
  node.stream.set_parameters(p);
  node.labels(9, kStart + 9 * kStep + 10000000);
  node.depth(11, kStart + 11 * kStep), node.color(11, kStart + 11 * kStep);
  node.mask();
  EXPECT_TRUE(node.has_said("/labels: stamp: expected the stamp of the color image"));
}

TEST(Ros2Stream, PosesOfTheHostReachTheFrontEnd) {
  std::vector<Nanoseconds> asked;
  Node node(parameters(), [&](Nanoseconds t, const std::string& frame_id, Eigen::Isometry3d& T) {
    EXPECT_EQ(frame_id, "camera");
    asked.push_back(t);
    T.translation().x() = 0.001 * static_cast<double>((t - kStart) / kStep);
    return std::string();
  });
  Parameters p = parameters();
  p.preset = "network_only";  // which measures no motion of its own
  node.stream.set_parameters(p);
  node.frame(0), node.mask();
  EXPECT_FALSE(node.stream.front_end().ego_motion().motion());
  node.frame(1), node.mask();
  ASSERT_TRUE(node.stream.front_end().ego_motion().motion());
  EXPECT_NEAR(node.stream.front_end().ego_motion().motion()->translation().x(), -0.001, 1e-9);
  EXPECT_EQ(asked, (std::vector<Nanoseconds>{kStart, kStart + kStep, kStart}));
}

// By the next frame a pose has come, or it is missing.
TEST(Ros2Stream, PosesThatAreMissingAreToldAndLateOnesTaken) {
  Nanoseconds newest = 0;
  Node node(parameters(), [&](Nanoseconds t, const std::string&, Eigen::Isometry3d& T) {
    T.translation().y() = 7;
    return std::string(t <= newest ? "" : "expected a pose, found none");
  });
  newest = kStart;
  node.frame(0), node.mask();
  node.frame(1), node.mask();
  EXPECT_TRUE(node.said.empty()) << "that of frame 1 may still come";
  newest = kStart + kStep;
  node.frame(2), node.mask();
  EXPECT_TRUE(node.said.empty());
  ASSERT_TRUE(node.stream.front_end().ego_motion().T_host_world());
  EXPECT_NEAR(node.stream.front_end().ego_motion().T_host_world()->translation().y(), 7, 0.01);
  node.frame(3);
  ASSERT_FALSE(node.mask().empty());
  ASSERT_EQ(node.said.size(), 1u);
  EXPECT_EQ(
      node.said[0],
      "odometry: pose: the images alone tell the camera's motion; expected a pose, found none");
}

TEST(Ros2Stream, ParametersChangeWhileItRuns) {
  Node node;
  for (int i = 0; i < 5; ++i) node.frame(i), node.mask();
  const int before = cv::countNonZero(node.stream.front_end().mask().image);
  Parameters p = parameters();
  ASSERT_EQ(set_parameter(p, "dilation_px", 20.0), "");
  node.stream.set_parameters(p);
  node.frame(5);
  EXPECT_GT(cv::countNonZero(node.mask()), before + 1000);
  EXPECT_EQ(node.stream.front_end().settings().depth.dilation_px, 20);
  ASSERT_EQ(set_parameter(p, "dynamic_classes", std::vector<std::string>{"cat"}), "");
  node.stream.set_parameters(p);
  node.frame(6);
  EXPECT_FALSE(node.mask().empty());
  // Of the synchronization alone: what the front end has learned stays.
  const FrontEnd* same_one = &node.stream.front_end();
  const double time = node.stream.front_end().stats().timestamp;
  ASSERT_EQ(set_parameter(p, "max_wait_s", 0.2), "");
  node.stream.set_parameters(p);
  EXPECT_EQ(&node.stream.front_end(), same_one);
  EXPECT_EQ(same_one->stats().timestamp, time);
}

TEST(Ros2Stream, AnotherImageSizeBeginsAnew) {
  Node node(parameters(), {}, false);
  node.frame(0), node.mask();
  const RgbdFrame frame = frame_of(1);
  cv::Mat color, depth;
  cv::resize(frame.color, color, {160, 120});
  cv::resize(frame.depth, depth, {160, 120}, 0, 0, cv::INTER_NEAREST);
  node.stream.add_depth(image_message(depth, "16UC1", kStart + kStep));
  node.stream.add_color(image_message(color, "bgr8", kStart + kStep));
  EXPECT_EQ(node.mask().size(), cv::Size(160, 120));
}

// The camera's thread must not wait for masks, and nothing piles up.
TEST(Ros2Stream, ASlowFrontEndDropsFramesAndDoesNotHoldTheCamera) {
  Node node;
  std::atomic<bool> end{false};
  std::atomic<int> made{0};
  std::vector<std::weak_ptr<const void>> bytes;
  std::thread worker([&] {
    while (!end || node.stream.wait(std::chrono::milliseconds(0)))
      if (node.stream.wait(std::chrono::milliseconds(20)))
        while (node.stream.next()) {
          ++made;
          std::this_thread::sleep_for(std::chrono::milliseconds(5));
        }
  });
  const RgbdFrame frame = frame_of(0);
  for (int i = 0; i < 300; ++i) {
    const ImageMessage color = image_message(frame.color, "bgr8", kStart + i * kStep);
    bytes.push_back(color.owner);
    node.stream.add_depth(image_message(frame.depth, "16UC1", kStart + i * kStep));
    node.stream.add_color(color);
    std::size_t held = 0;
    for (const auto& b : bytes) held += !b.expired();
    ASSERT_LE(held, 8u) << "the queue, the frame at work, the one published, this one";
  }
  end = true;
  worker.join();
  EXPECT_GT(made, 0);
  EXPECT_LT(made, 300);
  const DiagnosticReport report = node.stream.report();
  EXPECT_EQ(report.level, DiagnosticReport::kWarn);
  EXPECT_NE(report.message.find("color images dropped"), std::string::npos) << report.message;
}

TEST(Ros2Stream, DiagnosticsTellRatesStagesAndStatus) {
  Parameters p = parameters();
  p.stalled_after_s = 0.05;
  Node node(p);
  for (int i = 0; i < 10; ++i) node.frame(i), node.mask();
  DiagnosticReport report = node.stream.report();
  const auto value = [&](const std::string& name) {
    for (const auto& [key, text] : report.values)
      if (key == name) return text;
    return std::string("none");
  };
  EXPECT_EQ(value("frames"), "10");
  EXPECT_GT(std::stod(value("mask rate (Hz)")), 0);
  EXPECT_GT(std::stod(value("front end (ms)")), 0);
  EXPECT_GE(std::stod(value("latency, most (ms)")), std::stod(value("latency, mean (ms)")));
  EXPECT_EQ(value("status no_segmentation"), "none");
  node.depth(10, kStart + 10 * kStep), node.color(10, kStart + 10 * kStep), node.mask();
  report = node.stream.report();
  EXPECT_EQ(value("status no_segmentation"), "1 of 1");
  EXPECT_EQ(value("frames"), "11");
  std::this_thread::sleep_for(std::chrono::milliseconds(60));
  report = node.stream.report();
  EXPECT_EQ(report.level, DiagnosticReport::kError);
  EXPECT_NE(report.message.find("no color image for 0.0"), std::string::npos) << report.message;
  EXPECT_NE(report.message.find("no depth image for"), std::string::npos);
  EXPECT_NE(report.message.find("no segmentation for"), std::string::npos);
}

}  // namespace
