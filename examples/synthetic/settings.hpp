// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "synthetic/camera.hpp"
#include "synthetic/depth.hpp"

namespace stillpoint {

/// What is filmed, and how. The room and the camera's path depend on `motion`, `seed` and the
/// frame rate alone, never on people or movers, so that sequences with and without people can be
/// compared.
struct SyntheticSettings {
  SyntheticMotion motion = SyntheticMotion::kXyz;
  /// 0 to 20.
  int people = 2;
  /// People sit on chairs or stand, and hardly move.
  bool seated = false;
  /// Every second walking person carries a carton.
  bool carried_object = true;
  /// 0 = none, 1 = a pushed carton, 2 = also a swinging door.
  int movers = 0;
  /// A pillar between the camera and the people who walk closest to it.
  bool pillar = false;
  /// 0 = 150, or the whole way for SyntheticMotion::kLoop.
  int frames = 0;
  double fps = 30;
  /// Exposure time; 0 = no motion blur. Timestamps are mid-exposure.
  double shutter_s = 0.025;
  int width = 640, height = 480;
  std::uint64_t seed = 1;
  /// Timestamp of the first frame.
  double start_s = 1300000000.0;
  /// Deviation of the color camera's noise at middle grey, in steps of 8 bits.
  double color_noise = 1.6;
  KinectNoise depth_noise;
};

/// Motion blur of one label of a frame.
struct SyntheticBlur {
  /// 0 = the static world.
  int label = 0;
  /// Visible pixels at mid-exposure.
  int pixels = 0;
  /// Mean way of these pixels across the image during the exposure.
  double blur_px = 0;
};

struct SyntheticFrame {
  /// Seconds, mid-exposure, rounded to microseconds.
  double timestamp = 0;
  /// Maps points from camera coordinates (x right, y down, z forward) to the world, metres.
  Eigen::Isometry3d T_world_camera = Eigen::Isometry3d::Identity();
  /// H x W, CV_8UC3 (BGR), blurred over the exposure.
  cv::Mat color;
  /// H x W, CV_16UC1, `depth_units_per_m` of SyntheticSequence::camera(), as a Kinect measures it.
  cv::Mat depth;
  /// H x W, CV_32FC1, exact metres along the optical axis at mid-exposure.
  cv::Mat exact_depth;
  /// H x W, CV_8UC1, exact at mid-exposure: 0 = static, 1.. = people (with what they carry),
  /// 101.. = movers.
  cv::Mat labels;
  /// H x W, CV_8UC1: which limb of a person (synthetic::Limb), 0 elsewhere.
  cv::Mat limbs;
  /// The static world first, then everything visible that moves, by label.
  std::vector<SyntheticBlur> blur;
};

namespace synthetic {

/// The settings with the number of frames filled in. Throws Error naming the one out of range.
SyntheticSettings checked_settings(SyntheticSettings s);

}  // namespace synthetic
}  // namespace stillpoint
