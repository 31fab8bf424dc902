// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/core/lens.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace {

using namespace stillpoint;

Camera wide_angle() {
  Camera camera;
  camera.fx = camera.fy = 350, camera.cx = 321, camera.cy = 238;
  camera.k1 = -0.28, camera.k2 = 0.08, camera.p1 = 0.001, camera.p2 = -0.0005;
  return camera;
}

TEST(Lens, RaysAndPixelsAreInverse) {
  for (const Camera& camera : {wide_angle(), Camera::tum_fr1(), Camera::tum_fr3()}) {
    Lens lens;
    lens.set(camera, {640, 480});
    for (float v = 0; v < 480; v += 23.7f)
      for (float u = 0; u < 640; u += 19.3f) {
        const Eigen::Vector2f back = lens.pixel(lens.ray(u, v));
        EXPECT_NEAR(back.x(), u, 0.03);
        EXPECT_NEAR(back.y(), v, 0.03);
        const Eigen::Vector2d flat = undistort_pixel(camera, {u, v});
        EXPECT_NEAR(lens.ray(u, v).x(), (flat.x() - camera.cx) / camera.fx, 1e-4);
        EXPECT_NEAR(lens.ray(u, v).y(), (flat.y() - camera.cy) / camera.fy, 1e-4);
      }
  }
}

TEST(Lens, NothingFoldsBackIntoTheImage) {
  Lens lens;
  lens.set(wide_angle(), {640, 480});
  for (float x = 1.3f; x < 20; x *= 1.1f) {
    EXPECT_GT(lens.pixel({x, 0.1f}).x(), 640) << x;
    EXPECT_LT(lens.pixel({-x, 0.1f}).x(), 0) << x;
  }
}

TEST(Lens, FollowsTheCameraAndTheSize) {
  Lens lens;
  lens.set({}, {100, 50});
  EXPECT_FLOAT_EQ(lens.fx(), 90);
  EXPECT_FLOAT_EQ(lens.cx(), 49.5f);
  lens.set({}, {200, 50});
  EXPECT_FLOAT_EQ(lens.fx(), 180);
  Camera camera = wide_angle();
  lens.set(camera, {640, 480});
  const float before = lens.ray(0, 0).x();
  camera.k1 = 0;
  lens.set(camera, {640, 480});
  EXPECT_NE(lens.ray(0, 0).x(), before);
}

}  // namespace
