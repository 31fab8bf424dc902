// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/core/camera.hpp"

#include <gtest/gtest.h>

#include "../io/temporary_folder.hpp"

namespace {

using namespace stillpoint;

TEST(Camera, OfResizedImagesSeesAPointAtTheSamePlace) {
  const Camera full = Camera::bonn();
  const Camera half = full.resized(320, 240);
  EXPECT_EQ(half.width, 320);
  const Eigen::Vector3d p(0.4, -0.3, 2);
  // The middle of a block of 2 x 2 pixels becomes the middle of one.
  EXPECT_TRUE(half.project(p).isApprox((full.project(p) - Eigen::Vector2d(0.5, 0.5)) / 2, 1e-12));
  EXPECT_EQ(half.k1, full.k1) << "the lens is the same";
  EXPECT_NEAR(half.resized(640, 480).cx, full.cx, 1e-9);
  EXPECT_ERROR(Camera().resized(320, 240), "found 0x0 to 320x240");
  EXPECT_ERROR(full.resized(320, 0), "found 640x480 to 320x0");
}

}  // namespace
