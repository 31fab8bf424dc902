// SPDX-License-Identifier: BSD-2-Clause
// A textured box room for the tests of this back end: exact poses, exact depth, no file.
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "../../tests/io/temporary_folder.hpp"
#include "stillpoint/backends/rgbd_slam/features.hpp"
#include "stillpoint/core/camera.hpp"
#include "stillpoint/core/frame.hpp"
#include "stillpoint/core/selection.hpp"
#include "stillpoint/tracking/tracker.hpp"

namespace test_scene {

inline stillpoint::Camera camera() {
  stillpoint::Camera c;
  c.fx = c.fy = 260, c.cx = 159.5, c.cy = 119.5, c.width = 320, c.height = 240;
  return c;
}

inline std::uint32_t mix(std::uint32_t a) {
  a ^= a >> 16, a *= 0x7feb352du, a ^= a >> 15, a *= 0x846ca68bu, a ^= a >> 16;
  return a;
}

// Grey value of a wall: random tiles of 30 cm and of 7 cm over each other.
inline int texture(int wall, double u, double v) {
  const auto tile = [&](double size) {
    const auto i = static_cast<std::uint32_t>(static_cast<int>(std::floor(u / size)) + 4096);
    const auto k = static_cast<std::uint32_t>(static_cast<int>(std::floor(v / size)) + 4096);
    return mix(i * 73856093u ^ mix(k * 19349663u + static_cast<std::uint32_t>(wall)));
  };
  return 30 + static_cast<int>(tile(0.30) % 80) + static_cast<int>(tile(0.07) % 110);
}

// Renders the room x in [-3, 3], y in [-1.5, 1.5], z in [-3, 3], four rays a pixel, from the
// inside.
inline stillpoint::RgbdFrame render(const Eigen::Isometry3d& T_world_camera, double timestamp) {
  const stillpoint::Camera c = camera();
  const Eigen::Vector3d half(3, 1.5, 3);
  stillpoint::RgbdFrame frame;
  frame.timestamp = timestamp;
  frame.color.create(c.height, c.width, CV_8UC1);
  frame.depth.create(c.height, c.width, CV_16UC1);
  const auto cast = [&](double x, double y, double& z) {
    const Eigen::Vector3d ray = c.unproject(x, y, 1);
    const Eigen::Vector3d d = T_world_camera.linear() * ray, o = T_world_camera.translation();
    z = std::numeric_limits<double>::max();
    int axis = 0;
    for (int a = 0; a < 3; ++a) {
      if (d[a] == 0) continue;
      const double t = ((d[a] > 0 ? half[a] : -half[a]) - o[a]) / d[a];
      if (t < z) z = t, axis = a;
    }
    const Eigen::Vector3d p = o + z * d;
    return texture(axis * 2 + (d[axis] > 0), p[(axis + 1) % 3], p[(axis + 2) % 3]);
  };
  for (int y = 0; y < c.height; ++y)
    for (int x = 0; x < c.width; ++x) {
      double z = 0;
      int sum = 0;
      for (const double dy : {-0.25, 0.25})
        for (const double dx : {-0.25, 0.25}) sum += cast(x + dx, y + dy, z);
      frame.color.at<uchar>(y, x) = static_cast<uchar>(std::min(255, (sum + 2) / 4));
      cast(x, y, z);
      frame.depth.at<std::uint16_t>(y, x) =
          static_cast<std::uint16_t>(std::lround(z * frame.depth_units_per_m));
    }
  return frame;
}

// Puts what a camera elsewhere in the room sees over the left columns of a frame.
inline void cover_left(stillpoint::RgbdFrame& frame, int columns,
                       const Eigen::Isometry3d& T_world_camera) {
  const stillpoint::RgbdFrame other = render(T_world_camera, frame.timestamp);
  const cv::Rect part(0, 0, columns, frame.color.rows);
  other.color(part).copyTo(frame.color(part));
  other.depth(part).copyTo(frame.depth(part));
}

// A walk that sways and turns; seconds.
inline Eigen::Isometry3d path_at(double t) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation() << 0.5 * std::sin(0.9 * t), 0.15 * std::sin(1.3 * t), 0.4 * std::sin(0.7 * t);
  T.linear() = (Eigen::AngleAxisd(0.35 * std::sin(0.8 * t), Eigen::Vector3d::UnitY()) *
                Eigen::AngleAxisd(0.15 * std::sin(0.5 * t), Eigen::Vector3d::UnitX()))
                   .toRotationMatrix();
  return T;
}

// The same; step = 1/30 s.
inline Eigen::Isometry3d path(int step) { return path_at(step / 30.0); }

// What the camera sees at path(2 step), behind what moves as one and fills two fifths of the
// image.
inline stillpoint::RgbdFrame render_with_mover(int step) {
  const Eigen::Isometry3d T = path(2 * step);
  stillpoint::RgbdFrame frame = render(T, step / 15.0);
  Eigen::Isometry3d moved = T;
  moved.pretranslate(Eigen::Vector3d(0.03, 0, 0.01) * step);
  cover_left(frame, frame.color.cols * 2 / 5, moved);
  return frame;
}

inline stillpoint::Selection keep_all(std::size_t n) {
  stillpoint::Selection s;
  s.probability.assign(n, 0.0f);
  s.reason.assign(n, stillpoint::KeypointReason::kStatic);
  for (std::size_t i = 0; i < n; ++i) s.kept.push_back(static_cast<int>(i));
  return s;
}

// Grey frames and color ones in turn: what the tracker is given stays as it was.
inline void expect_images_untouched(stillpoint::Tracker& tracker) {
  std::vector<stillpoint::RgbdFrame> frames;
  std::vector<cv::Mat> colors, depths;
  for (int step = 0; step < 6; ++step) {
    stillpoint::RgbdFrame frame = render(path(step), step / 30.0);
    if (step % 2) cv::cvtColor(frame.color, frame.color, cv::COLOR_GRAY2BGR);
    frames.push_back(frame);
    colors.push_back(frame.color.clone()), depths.push_back(frame.depth.clone());
    const std::size_t n = tracker.extract(frame, stillpoint::DynamicMask()).size();
    EXPECT_TRUE(tracker.track(frame, stillpoint::DynamicMask(), keep_all(n))) << step;
  }
  tracker.finish();
  for (std::size_t i = 0; i < frames.size(); ++i) {
    EXPECT_EQ(cv::norm(frames[i].color, colors[i], cv::NORM_INF), 0) << i;
    EXPECT_EQ(cv::norm(frames[i].depth, depths[i], cv::NORM_INF), 0) << i;
  }
}

// Passes on what ORB finds, with one keypoint at NaN when told so.
class SpoiledExtractor final : public stillpoint::rgbd_slam::FeatureExtractor {
 public:
  explicit SpoiledExtractor(const bool& spoiled) : spoiled_(spoiled) {}
  void extract(const cv::Mat& gray, const cv::Mat& mask,
               stillpoint::rgbd_slam::Features& features) override {
    orb_.extract(gray, mask, features);
    if (spoiled_) features.keypoints.at(7).pt.y = std::numeric_limits<float>::quiet_NaN();
  }
  int levels() const override { return orb_.levels(); }
  double scale_factor() const override { return orb_.scale_factor(); }

 private:
  const bool& spoiled_;
  stillpoint::rgbd_slam::OrbExtractor orb_;
};

// What is not finite is refused, and the tracker goes on as if nothing had been: `make` makes one
// of a camera and an extractor.
template <class Make>
void expect_only_finite_numbers(const Make& make) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinite = std::numeric_limits<double>::infinity();
  bool spoiled = false;
  stillpoint::Trajectory expected;
  for (const bool disturbed : {false, true}) {
    const auto tracker = make(camera(), std::make_unique<SpoiledExtractor>(spoiled));
    for (int step = 0; step < 8; ++step) {
      const stillpoint::RgbdFrame frame = render(path(step), step / 30.0);
      std::size_t n = 0;
      if (disturbed) {
        spoiled = true;
        EXPECT_ERROR(tracker->extract(frame, {}), "extract", "finite pixels", "number 7", "nan");
        spoiled = false;
      }
      n = tracker->extract(frame, {}).size();
      if (disturbed) {
        for (const double bad : {nan, infinite}) {
          stillpoint::RgbdFrame other = frame;
          other.timestamp = bad;
          EXPECT_ERROR(tracker->track(other, {}, keep_all(n)), "frame.timestamp",
                       "expected seconds");
        }
        stillpoint::Selection wrong = keep_all(n);
        wrong.kept.back() = static_cast<int>(n);
        const std::string found = "found " + std::to_string(n);
        EXPECT_ERROR(tracker->track(frame, {}, wrong), "selection.kept", found.c_str());
        stillpoint::RgbdFrame small = frame;
        small.color = frame.color(cv::Rect(0, 0, 64, 48)), small.depth.release();
        EXPECT_ERROR(tracker->track(small, {}, keep_all(n)), "320x240", "found 64x48");
      }
      EXPECT_TRUE(tracker->track(frame, {}, keep_all(n))) << step;
    }
    tracker->finish();
    const stillpoint::Trajectory trajectory = tracker->trajectory();
    ASSERT_EQ(trajectory.size(), 8u);
    if (!disturbed) expected = trajectory;
    for (std::size_t i = 0; i < trajectory.size(); ++i)
      EXPECT_EQ(trajectory[i].T_world_camera.matrix(), expected[i].T_world_camera.matrix()) << i;
  }
  stillpoint::Camera bad = camera();
  bad.cx = nan;
  EXPECT_ERROR(make(bad, nullptr), "camera: expected finite numbers, found nan");
  bad = camera();
  bad.fx = infinite;
  EXPECT_ERROR(make(bad, nullptr), "camera: expected finite numbers, found inf");
}

}  // namespace test_scene
