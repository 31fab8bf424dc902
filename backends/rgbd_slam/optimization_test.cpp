// SPDX-License-Identifier: BSD-2-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include "stillpoint/backends/rgbd_slam/bundle_adjustment.hpp"
#include "stillpoint/backends/rgbd_slam/pose_graph.hpp"
#include "test_scene.hpp"

namespace {

using namespace stillpoint;
using namespace stillpoint::rgbd_slam;
using namespace test_scene;

TEST(BundleAdjustment, HasExactDerivatives) {
  BundleProblem::Residual r{0, 0, {100, 90}, 0.4, 0.004, 1.2};
  const ReprojectionCost cost(camera(), r, true);
  const Eigen::Quaterniond q0 = Eigen::Quaterniond(0.9, 0.2, -0.3, 0.1).normalized();
  double q[4] = {q0.x(), q0.y(), q0.z(), q0.w()}, t[3] = {0.1, -0.2, 0.3}, X[3] = {0.5, 0.4, 3};
  double* parameters[] = {q, t, X};
  double value[3], jq[12], jt[9], jx[9];
  double* jacobians[] = {jq, jt, jx};
  ASSERT_TRUE(cost.Evaluate(parameters, value, jacobians));
  const int sizes[] = {4, 3, 3};
  for (int block = 0; block < 3; ++block)
    for (int i = 0; i < sizes[block]; ++i) {
      const double h = 1e-6, old = parameters[block][i];
      double up[3], down[3];
      parameters[block][i] = old + h;
      cost.Evaluate(parameters, up, nullptr);
      parameters[block][i] = old - h;
      cost.Evaluate(parameters, down, nullptr);
      parameters[block][i] = old;
      // Off the unit sphere the rotation matrix differs from q X q*: compare along the sphere only.
      if (block == 0) continue;
      for (int row = 0; row < 3; ++row)
        EXPECT_NEAR(jacobians[block][row * sizes[block] + i], (up[row] - down[row]) / (2 * h),
                    1e-4 * (1 + std::abs(up[row])));
    }
  for (int axis = 0; axis < 3; ++axis) {
    const double h = 1e-6;
    Eigen::Vector3d w = Eigen::Vector3d::Zero();
    w[axis] = h;
    double values[2][3];
    Eigen::Vector4d tangent;
    for (int side = 0; side < 2; ++side) {
      const Eigen::Quaterniond turned =
          Eigen::Quaterniond(Eigen::AngleAxisd((side ? -h : h), w / h)) * q0;
      double qt[4] = {turned.x(), turned.y(), turned.z(), turned.w()};
      const double* p[] = {qt, t, X};
      cost.Evaluate(p, values[side], nullptr);
      tangent = side ? Eigen::Vector4d((tangent - turned.coeffs()) / (2 * h))
                     : Eigen::Vector4d(turned.coeffs());
    }
    for (int row = 0; row < 3; ++row) {
      double expected = 0;
      for (int i = 0; i < 4; ++i) expected += jq[row * 4 + i] * tangent[i];
      EXPECT_NEAR(expected, (values[0][row] - values[1][row]) / (2 * h),
                  1e-4 * (1 + std::abs(expected)));
    }
  }
}

TEST(PoseGraph, SpreadsTheDriftOverTheLoop) {
  // A circle whose odometry turns a little too far; one edge says where the end really is.
  constexpr int kCount = 20;
  const auto truth = [](int i) {
    const double angle = 2 * std::acos(-1.0) * i / kCount;
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.linear() = Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitY()).toRotationMatrix();
    T.translation() = T.linear() * Eigen::Vector3d(0, 0, -3);
    return Eigen::Isometry3d(T.inverse());
  };
  std::map<KeyframeId, Eigen::Isometry3d> poses{{0, truth(0)}};
  std::vector<PoseGraphEdge> edges;
  Eigen::Isometry3d drift = Eigen::Isometry3d::Identity();
  drift.linear() = Eigen::AngleAxisd(0.01, Eigen::Vector3d::UnitY()).toRotationMatrix();
  drift.translation() << 0.01, 0, 0;
  for (int i = 1; i < kCount; ++i) {
    const Eigen::Isometry3d step = drift * truth(i) * truth(i - 1).inverse();
    poses[i] = step * poses[i - 1];
    edges.push_back({i, i - 1, step});
  }
  edges.push_back({kCount - 1, 0, truth(kCount - 1) * truth(0).inverse()});
  const auto error = [&] {
    double worst = 0;
    for (const auto& [id, T] : poses)
      worst =
          std::max(worst, (T.inverse().translation() - truth(id).inverse().translation()).norm());
    return worst;
  };
  const double before = error();
  ASSERT_TRUE(optimize_pose_graph(poses, edges, 0));
  EXPECT_LT(error(), before / 3);
  EXPECT_TRUE(poses[0].isApprox(truth(0), 1e-12));
}

}  // namespace
