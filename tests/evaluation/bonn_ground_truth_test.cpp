// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/evaluation/bonn_ground_truth.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "stillpoint/evaluation/trajectory_error.hpp"

namespace {

using stillpoint::Trajectory;

Trajectory turning_body() {
  Trajectory body;
  for (int i = 0; i < 60; ++i) {
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.translation() << 0.02 * i, std::sin(0.1 * i), 1;
    T.linear() = Eigen::AngleAxisd(0.05 * i, Eigen::Vector3d(1, 2, 0.5).normalized()).matrix();
    body.push_back({i / 30.0, T});
  }
  return body;
}

// The page's matrices, multiplied out: T_ROS^-1 T T_ROS T_m.
TEST(BonnGroundTruth, FollowsTheFormula) {
  Eigen::Matrix4d ros, marker;
  ros << -1, 0, 0, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 1;
  marker << 1.0157, 0.1828, -0.2389, 0.0113, 0.0009, -0.8431, -0.6413, -0.0098, -0.3009, 0.6147,
      -0.8085, 0.0111, 0, 0, 0, 1;
  const Trajectory body = turning_body(), camera = stillpoint::camera_of_bonn_body(body);
  ASSERT_EQ(camera.size(), body.size());
  for (std::size_t i = 0; i < body.size(); ++i) {
    const Eigen::Matrix4d T = ros.inverse() * body[i].T_world_camera.matrix() * ros * marker;
    EXPECT_EQ(camera[i].timestamp, body[i].timestamp);
    EXPECT_LT((camera[i].T_world_camera.translation() - T.topRightCorner<3, 1>()).norm(), 1e-12);
    // The page's rotation is scaled by 1.06; ours is a rotation, within a degree of it.
    const Eigen::Matrix3d R = camera[i].T_world_camera.linear();
    EXPECT_LT((R * R.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-12);
    EXPECT_LT((R - T.topLeftCorner<3, 3>() / 1.059).norm(), 0.02);
  }
}

// The camera is 19 mm from the body's origin: where the body turns, the two paths differ by less.
TEST(BonnGroundTruth, DiffersFromTheBodyByItsLever) {
  const Trajectory body = turning_body(), camera = stillpoint::camera_of_bonn_body(body);
  const double off = stillpoint::ate(body, camera).rmse_m;
  EXPECT_GT(off, 0.005);
  EXPECT_LT(off, 0.019);
  EXPECT_LT(stillpoint::ate(camera, camera).rmse_m, 1e-12);
}

}  // namespace
