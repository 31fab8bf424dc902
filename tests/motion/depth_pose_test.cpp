// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/motion/depth_pose.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "small_camera.hpp"

namespace stillpoint {
namespace {

// A wall at 3 m with a half column and before it, taking a third of the image, something larger and
// round whose middle is at x.
RgbdFrame scene(double timestamp, double x_m) {
  const Camera camera = small_camera();
  RgbdFrame frame;
  frame.timestamp = timestamp;
  frame.color = cv::Mat::zeros(camera.height, camera.width, CV_8UC1);
  frame.depth.create(camera.height, camera.width, CV_32FC1);
  for (int v = 0; v < camera.height; ++v)
    for (int u = 0; u < camera.width; ++u) {
      const double off = 2 * (u - camera.cx) / camera.fx - x_m;
      const double column = 3 * (u - camera.cx) / camera.fx + 1.2;
      double z = std::abs(column) < 0.2 ? 3 - 0.2 * std::cos(CV_PI * column / 0.4) : 3;
      if (std::abs(off) < 0.5) z = 2.2 - 0.4 * std::cos(CV_PI * off);
      frame.depth.at<float>(v, u) = static_cast<float>(z);
    }
  return frame;
}

// How far the pose is from where the camera stands, metres, after it was dragged for a second.
// `known`: corners tell what moves.
double dragged_m(double mover_m_s, const SensorModel& sensor = {}, bool known = false) {
  DepthPose pose(sensor);
  FreeSpaceMap map(sensor);
  DepthCells cells;
  FrameContext context;
  const EgoMotion resting;
  for (int i = 0; i < 30; ++i) {
    context.begin(scene(i / 30.0, mover_m_s * i / 30.0), small_camera());
    cells.set(context.depth, 4);
    std::vector<std::uint8_t> moving(known ? cells.size() : 0);
    for (std::size_t k = 0; k < moving.size(); ++k) moving[k] = cells.depth_m[k] < 2.5f;
    pose.locate(i / 30.0, cells, moving, resting, map);
    map.add(pose.shot(), cells, std::vector<std::uint8_t>(cells.size(), 0));
  }
  EXPECT_TRUE(pose.fit().has_value());
  return pose.shot().T_map_depth.translation().norm();
}

TEST(DepthPose, IsDraggedAlongAWallByHalf) {
  EXPECT_LT(dragged_m(0), 0.001);
  EXPECT_LT(dragged_m(0.5), 0.28) << "0.43 where predictions begin at the last registered pose";
}

TEST(DepthPose, IsNotDraggedByWhatIsKnownToMove) { EXPECT_LT(dragged_m(0.5, {}, true), 0.01); }

TEST(DepthPose, IsFoundWithASensorThatMeasuresFromItsLensOn) {
  SensorModel sensor;
  sensor.min_range_m = 0;
  EXPECT_LT(dragged_m(0, sensor), 0.001);
}

}  // namespace
}  // namespace stillpoint
