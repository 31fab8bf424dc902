// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <cstdint>
#include <limits>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "stillpoint/core/camera.hpp"
#include "stillpoint/core/frame.hpp"
#include "stillpoint/core/lens.hpp"

namespace stillpoint {

/// A textured room of 6 x 2.6 x 6 m with two pillars, seen by any camera from near its middle, lens
/// distortion included; and, if wanted, a plain board in it. Exact depth, global shutter.
class RoomCamera {
 public:
  explicit RoomCamera(const Camera& camera) : camera_(camera) {
    Lens lens;
    lens.set(camera, {camera.width, camera.height});
    for (int y = 0; y < camera.height; ++y)
      for (int x = 0; x < camera.width; ++x)
        rays_.push_back(lens.ray(static_cast<float>(x), static_cast<float>(y)).homogeneous());
  }

  /// A board 0.6 x 0.6 m, parallel to the image of an unturned camera; center in the world.
  std::optional<Eigen::Vector3f> board_m;

  RgbdFrame frame(double timestamp, const Eigen::Isometry3d& T_world_camera) const {
    return frame_in_rows(timestamp, [&](double) { return T_world_camera; });
  }

  /// The same with a pose for each row: `T_world_camera(share)`, from -0.5 (first) to 0.5 (last).
  template <class PoseOfRow>
  RgbdFrame frame_in_rows(double timestamp, PoseOfRow&& T_world_camera) const {
    RgbdFrame frame;
    frame.timestamp = timestamp;
    frame.color.create(camera_.height, camera_.width, CV_8UC1);
    frame.depth.create(camera_.height, camera_.width, CV_32FC1);
    std::size_t i = 0;
    for (int y = 0; y < camera_.height; ++y) {
      const Eigen::Isometry3f T =
          Eigen::Isometry3d(T_world_camera((y + 0.5) / camera_.height - 0.5)).cast<float>();
      for (int x = 0; x < camera_.width; ++x, ++i) {
        const Hit hit = trace(T.translation(), T.linear() * rays_[i]);
        frame.color.at<uchar>(y, x) = hit.gray;
        frame.depth.at<float>(y, x) = hit.z;
      }
    }
    return frame;
  }

 private:
  struct Hit {
    float z = std::numeric_limits<float>::infinity();
    uchar gray = 90;
  };

  // Rays have a length of 1 along the camera's axis, so that the factor is the depth.
  Hit trace(const Eigen::Vector3f& o, const Eigen::Vector3f& d) const {
    Hit hit;
    const Eigen::Vector3f half(3, 1.3f, 3);
    for (int axis = 0; axis < 3; ++axis)
      take(o, d, axis, d[axis] > 0 ? half[axis] : -half[axis], half, Eigen::Vector3f::Zero(), true,
           hit);
    for (const float x : {-1.2f, 1.0f})
      for (const float side : {-0.2f, 0.2f}) {
        const Eigen::Vector3f at(x, 0, 1.8f), size(0.2f, 1.3f, 0.2f);
        take(o, d, 0, at.x() + side, size, at, true, hit);
        take(o, d, 2, at.z() + side, size, at, true, hit);
      }
    if (board_m)
      take(o, d, 2, board_m->z(), Eigen::Vector3f(0.3f, 0.3f, 0.01f), *board_m, false, hit);
    return hit;
  }

  static void take(const Eigen::Vector3f& o, const Eigen::Vector3f& d, int axis, float plane,
                   const Eigen::Vector3f& half, const Eigen::Vector3f& center, bool textured,
                   Hit& hit) {
    const float t = (plane - o[axis]) / d[axis];
    if (!(t > 0.05f && t < hit.z)) return;
    const Eigen::Vector3f p = o + t * d;
    for (int other = 0; other < 3; ++other)
      if (other != axis && std::abs(p[other] - center[other]) > half[other]) return;
    hit.z = t;
    hit.gray = textured ? shade(p, axis) : 120;
  }

  // Smooth noise with a lattice of 8 cm.
  static uchar shade(const Eigen::Vector3f& p, int axis) {
    const float u = p[(axis + 1) % 3] / 0.08f + 512, v = p[(axis + 2) % 3] / 0.08f + 512;
    const int i = static_cast<int>(u), j = static_cast<int>(v);
    const float a = u - static_cast<float>(i), b = v - static_cast<float>(j);
    const auto at = [&](int x, int y) {
      std::uint32_t h = static_cast<std::uint32_t>(x * 8191 + y * 131 + axis * 77);
      h ^= h >> 16, h *= 0x7feb352du, h ^= h >> 15, h *= 0x846ca68bu;
      return static_cast<float>((h ^ (h >> 16)) % 216u);
    };
    return static_cast<uchar>(20 + (1 - b) * ((1 - a) * at(i, j) + a * at(i + 1, j)) +
                              b * ((1 - a) * at(i, j + 1) + a * at(i + 1, j + 1)));
  }

  Camera camera_;
  std::vector<Eigen::Vector3f> rays_;
};

}  // namespace stillpoint
