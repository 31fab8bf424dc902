// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/core/distortion.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace {

using stillpoint::Camera;

TEST(Distortion, LeavesAnUndistortedCameraAlone) {
  const Eigen::Vector2d pixel(12.5, 300);
  EXPECT_EQ(stillpoint::undistort_pixel(Camera::tum_fr3(), pixel), pixel);
  EXPECT_EQ(stillpoint::distort_pixel(Camera::tum_fr3(), pixel), pixel);
}

TEST(Distortion, UndistortsEveryPixelOfTheKnownCameras) {
  for (const Camera& camera : {Camera::tum_fr1(), Camera::tum_fr2(), Camera::bonn()})
    for (int y = 0; y < camera.height; y += 53)
      for (int x = 0; x < camera.width; x += 71) {
        const Eigen::Vector2d raw(x, y);
        const Eigen::Vector2d flat = stillpoint::undistort_pixel(camera, raw);
        EXPECT_LT((stillpoint::distort_pixel(camera, flat) - raw).norm(), 1e-6) << x << ' ' << y;
      }
}

TEST(Distortion, KnowsWhereALensCannotBeInverted) {
  Camera camera;
  camera.fx = camera.fy = 460, camera.cx = 319.5, camera.cy = 239.5, camera.k1 = -0.4;
  int seen = 0, unseen = 0;
  for (int y = 0; y < 480; y += 13)
    for (int x = 0; x < 640; x += 17) {
      const Eigen::Vector2d raw(x, y), flat = stillpoint::undistort_pixel(camera, raw);
      // The radius r (1 - 0.4 r^2) is largest, 0.6086, at r = 0.913.
      const double radius = std::hypot((x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy);
      const bool found = flat.allFinite();
      ++(found ? seen : unseen);
      EXPECT_FALSE(found && radius > 0.61) << x << ' ' << y;
      EXPECT_FALSE(!found && radius < 0.58) << x << ' ' << y;
      EXPECT_FALSE(found && (stillpoint::distort_pixel(camera, flat) - raw).norm() > 0.01)
          << x << ' ' << y;
    }
  EXPECT_GT(seen, 0);
  EXPECT_GT(unseen, 0);
}

TEST(Distortion, InvertsAStrongPincushionOverTheWholeImage) {
  Camera camera;
  camera.fx = camera.fy = 330, camera.cx = 319.5, camera.cy = 239.5;
  camera.k1 = 0.6, camera.p1 = 0.002, camera.p2 = -0.003;
  for (int y = 0; y < 480; y += 13)
    for (int x = 0; x < 640; x += 17) {
      const Eigen::Vector2d raw(x, y), flat = stillpoint::undistort_pixel(camera, raw);
      EXPECT_LT((stillpoint::distort_pixel(camera, flat) - raw).norm(), 1e-6) << x << ' ' << y;
    }
}

TEST(Distortion, FindsNoRayBehindTheFoldOfALens) {
  Camera camera;  // r (1 - 0.9 r^2 + 0.3 r^4) falls from r = 0.72 to 1.13, and rises again
  camera.fx = camera.fy = 300, camera.cx = 319.5, camera.cy = 239.5;
  camera.k1 = -0.9, camera.k2 = 0.3;
  int seen = 0;
  for (int y = 0; y < 480; y += 13)
    for (int x = 0; x < 640; x += 17) {
      const Eigen::Vector2d flat = stillpoint::undistort_pixel(camera, {x, y});
      if (!flat.allFinite()) continue;
      ++seen;
      EXPECT_LT((flat - Eigen::Vector2d(camera.cx, camera.cy)).norm(), 0.723 * camera.fx)
          << x << ' ' << y;
    }
  EXPECT_GT(seen, 0);
}

TEST(Distortion, FollowsBrownsFormula) {
  Camera camera;
  camera.k1 = 0.1, camera.k2 = 0.01, camera.k3 = 0.001, camera.p1 = 0.002, camera.p2 = -0.003;
  // By hand for (0.5, -0.25): r2 = 0.3125, radial = 1 + 0.03125 + 0.0009765625 + 0.000030517578.
  const Eigen::Vector2d d = stillpoint::distort_normalized(camera, {0.5, -0.25});
  EXPECT_NEAR(d.x(), 0.5 * 1.032257080078125 - 0.0005 - 0.0024375, 1e-12);
  EXPECT_NEAR(d.y(), -0.25 * 1.032257080078125 + 0.000875 + 0.00075, 1e-12);
}

}  // namespace
