// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/motion/constant_velocity.hpp"

#include <gtest/gtest.h>

namespace {

using stillpoint::ConstantVelocity;

// A camera on a helix: constant turn and speed in its own axes.
Eigen::Isometry3d pose(double t) {
  Eigen::Isometry3d step = Eigen::Isometry3d::Identity();
  step.linear() = Eigen::AngleAxisd(0.02, Eigen::Vector3d(1, 2, 3).normalized()).matrix();
  step.translation() = Eigen::Vector3d(0.01, -0.02, 0.005);
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  for (int i = 0; i < static_cast<int>(t * 30 + 0.5); ++i) T = T * step;
  return T;
}

TEST(ConstantVelocity, PredictsTheNextFrame) {
  ConstantVelocity velocity;
  EXPECT_FALSE(velocity.predict(0, 1 / 30.0));
  velocity.add(0, pose(0));
  EXPECT_FALSE(velocity.predict(0, 1 / 30.0)) << "one pose says nothing";
  velocity.add(1 / 30.0, pose(1 / 30.0));
  const auto T_next_last = velocity.predict(1 / 30.0, 2 / 30.0);
  ASSERT_TRUE(T_next_last);
  EXPECT_TRUE(T_next_last->isApprox(pose(2 / 30.0).inverse() * pose(1 / 30.0), 1e-12));
  // A frame left out, and a host that is a frame behind.
  EXPECT_TRUE(velocity.predict(1 / 30.0, 3 / 30.0)
                  ->isApprox(pose(3 / 30.0).inverse() * pose(1 / 30.0), 2e-3));
  EXPECT_TRUE(velocity.predict(2 / 30.0, 3 / 30.0)->isApprox(*T_next_last, 1e-9));
}

TEST(ConstantVelocity, SaysNothingFromOldPoses) {
  ConstantVelocity velocity;
  velocity.add(0, pose(0));
  velocity.add(1, pose(1));
  EXPECT_FALSE(velocity.predict(1, 1.03)) << "two poses too far apart";
  velocity.add(1.03, pose(1.03));
  EXPECT_FALSE(velocity.predict(0.4, 0.43)) << "time went back";
  EXPECT_TRUE(velocity.predict(1.03, 1.06));
  EXPECT_FALSE(velocity.predict(1.03, 2)) << "too far ahead";
  EXPECT_FALSE(velocity.predict(1.9, 1.93)) << "the host is too far behind";
  EXPECT_FALSE(velocity.predict(1.06, 1.03)) << "backwards";
  velocity.add(1.03, pose(1.03));
  EXPECT_FALSE(velocity.predict(1.03, 1.06)) << "the same timestamp twice";
  velocity.add(1.06, pose(1.06));
  EXPECT_TRUE(velocity.predict(1.06, 1.1));
  velocity.reset();
  EXPECT_FALSE(velocity.predict(1.06, 1.1));
  velocity.add(1.1, pose(1.1));
  EXPECT_FALSE(velocity.predict(1.1, 1.13)) << "the first pose after being lost";
}

}  // namespace
