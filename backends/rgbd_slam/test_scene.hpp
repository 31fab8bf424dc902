// SPDX-License-Identifier: BSD-2-Clause
// A textured box room for the tests of this back end: exact poses, exact depth, no file.
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <opencv2/core.hpp>

#include "stillpoint/core/camera.hpp"
#include "stillpoint/core/frame.hpp"
#include "stillpoint/core/selection.hpp"

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

// The left part of the image shows what another camera sees: what moves as one.
inline void cover_left(stillpoint::RgbdFrame& frame, double share,
                       const Eigen::Isometry3d& T_world_camera) {
  const stillpoint::RgbdFrame mover = render(T_world_camera, frame.timestamp);
  const cv::Rect left(0, 0, static_cast<int>(frame.color.cols * share), frame.color.rows);
  mover.color(left).copyTo(frame.color(left));
  mover.depth(left).copyTo(frame.depth(left));
}

// What the camera sees at path(2 step), behind what moves and fills two fifths of the image.
inline stillpoint::RgbdFrame render_with_mover(int step) {
  Eigen::Isometry3d T = path(2 * step);
  stillpoint::RgbdFrame frame = render(T, step / 15.0);
  T.pretranslate(Eigen::Vector3d(0.03, 0, 0.01) * step);
  cover_left(frame, 0.4, T);
  return frame;
}

inline stillpoint::Selection keep_all(std::size_t n) {
  stillpoint::Selection s;
  s.probability.assign(n, 0.0f);
  s.reason.assign(n, stillpoint::KeypointReason::kStatic);
  for (std::size_t i = 0; i < n; ++i) s.kept.push_back(static_cast<int>(i));
  return s;
}

}  // namespace test_scene
