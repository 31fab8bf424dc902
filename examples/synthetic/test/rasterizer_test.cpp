// SPDX-License-Identifier: BSD-2-Clause
#include "synthetic/rasterizer.hpp"

#include <gtest/gtest.h>

#include "synthetic/shading.hpp"

namespace stillpoint::synthetic {
namespace {

Camera small_camera() {
  Camera c;
  c.width = 64, c.height = 48, c.fx = c.fy = 50, c.cx = 31.5, c.cy = 23.5;
  return c;
}

/// Looks along +y of the world from the origin.
Frame ahead() {
  Frame f;
  f.x = {1, 0, 0}, f.y = {0, 0, -1}, f.z = {0, 1, 0};
  return f;
}

/// A rectangle that faces a camera which looks along +y.
Quad facing(double left, double right, double bottom, double top, double y) {
  Quad q;
  q.corner = {left, y, top}, q.edge_u = {right - left, 0, 0}, q.edge_v = {0, 0, bottom - top};
  q.texels_along_u = q.texels_along_v = 8;
  return q;
}

StaticScene plain_scene() {
  StaticScene scene;
  scene.textures.emplace_back(Canvas(8, 8, {100, 150, 200}));
  return scene;
}

TEST(SyntheticRasterizer, RectangleHasItsDepthAndItsPixels) {
  StaticScene scene = plain_scene();
  scene.quads.push_back(facing(-0.5, 0.5, -0.25, 0.25, 2));
  Rasterizer raster(small_camera());
  const MovingThings nothing;
  raster.draw(scene, nothing, ahead(), 0, 0);
  int count = 0;
  for (int y = 0; y < 48; ++y)
    for (int x = 0; x < 64; ++x) {
      // Pixel centres at whole numbers: half width 0.5 * 50 / 2 = 12.5 pixels around 31.5.
      const bool inside = x >= 19 && x <= 44 && std::abs(y - 23.5) <= 6.25;
      EXPECT_EQ(raster.surface_at(x, y), inside ? 0 : Rasterizer::kNothing) << x << ' ' << y;
      if (inside) {
        EXPECT_NEAR(raster.depth_at(x, y), 2, 1e-5);
        ++count;
      }
    }
  EXPECT_EQ(count, 26 * 12);
}

TEST(SyntheticRasterizer, RectangleIsNotSeenFromBehindOrBehindTheCamera) {
  StaticScene scene = plain_scene();
  Quad q = facing(-0.5, 0.5, -0.25, 0.25, 2);
  std::swap(q.edge_u, q.edge_v);  // turned round
  scene.quads.push_back(q);
  scene.quads.push_back(facing(-0.5, 0.5, -0.25, 0.25, -2));
  Rasterizer raster(small_camera());
  const MovingThings nothing;
  raster.draw(scene, nothing, ahead(), 0, 0);
  for (int y = 0; y < 48; ++y)
    for (int x = 0; x < 64; ++x) EXPECT_EQ(raster.surface_at(x, y), Rasterizer::kNothing);
}

TEST(SyntheticRasterizer, FloorThatReachesBehindTheCameraHasTheDepthOfItsPlane) {
  StaticScene scene = plain_scene();
  Quad floor;
  floor.corner = {-50, 50, -1.5}, floor.edge_u = {100, 0, 0}, floor.edge_v = {0, -100, 0};
  floor.texels_along_u = floor.texels_along_v = 100;
  scene.quads.push_back(floor);
  Rasterizer raster(small_camera());
  const MovingThings nothing;
  raster.draw(scene, nothing, ahead(), 0, 0);
  for (int y = 30; y < 48; ++y)
    for (int x = 0; x < 64; ++x)
      EXPECT_NEAR(raster.depth_at(x, y), 1.5 * 50 / (y - 23.5), 1e-3) << x << ' ' << y;
}

TEST(SyntheticRasterizer, BallAndConeAreMetWhereTheyAre) {
  StaticScene scene = plain_scene();
  RoundPart part;
  part.frame.origin = {0, 2, -0.3}, part.length = 0.6, part.radius0 = 0.3, part.radius1 = 0.1;
  scene.parts.push_back(part);
  Rasterizer raster(small_camera());
  const MovingThings nothing;
  raster.draw(scene, nothing, ahead(), 0, 0);
  int met = 0;
  for (int y = 0; y < 48; ++y)
    for (int x = 0; x < 64; ++x) {
      if (raster.surface_at(x, y) == Rasterizer::kNothing) continue;
      ++met;
      const double z = static_cast<double>(raster.depth_at(x, y));
      const Vec3 p = Vec3{(x - 31.5) / 50 * z, z, -(y - 23.5) / 50 * z} - part.frame.origin;
      // Distance from the surface: over all balls between the two ends, the nearest one.
      double distance = 1e9;
      for (int i = 0; i <= 400; ++i) {
        const double w = i / 400.0;
        distance = std::min(distance, norm(p - Vec3{0, 0, 0.6 * w}) - (0.3 - 0.2 * w));
      }
      EXPECT_NEAR(distance, 0, 2e-3) << x << ' ' << y;
    }
  EXPECT_GT(met, 100);
}

TEST(SyntheticRasterizer, RoundPartIsTheSameWithAndWithoutBounds) {
  // Very near parts are drawn without bounds on the image; a shift of the whole scene must not
  // change which pixels a part covers.
  StaticScene scene = plain_scene();
  RoundPart part;
  const Vec3 axis = normalized({0.5, 0.3, 0.8});
  part.frame.z = axis, part.frame.x = normalized(cross(axis, {0, 0, 1}));
  part.frame.y = cross(axis, part.frame.x);
  part.frame.origin = {-0.2, 1.0, -0.2}, part.length = 0.5, part.radius0 = 0.08;
  part.radius1 = 0.12, part.stretch_x = 1.3, part.stretch_y = 0.8;
  scene.parts.push_back(part);
  Camera wide = small_camera();
  wide.width = 192, wide.height = 144, wide.cx = 95.5, wide.cy = 71.5;
  Rasterizer narrow(small_camera()), large(wide);
  const MovingThings nothing;
  narrow.draw(scene, nothing, ahead(), 0, 0);
  large.draw(scene, nothing, ahead(), 0, 0);
  for (int y = 0; y < 48; ++y)
    for (int x = 0; x < 64; ++x)
      EXPECT_EQ(narrow.surface_at(x, y), large.surface_at(x + 64, y + 48)) << x << ' ' << y;
}

TEST(SyntheticRasterizer, NearerSurfaceHidesTheFartherOneAndLabelsAreItsOwn) {
  StaticScene scene = plain_scene();
  scene.quads.push_back(facing(-5, 5, -5, 5, 4));
  MovingThings things;
  Quad mover = facing(-0.2, 0.2, -0.2, 0.2, 2);
  mover.label = kFirstMoverLabel;
  things.quads.push_back(mover);
  RoundPart ball;
  ball.frame.origin = {0.8, 3, 0}, ball.length = 0.01, ball.radius0 = ball.radius1 = 0.2;
  ball.label = 1;
  things.parts.push_back(ball);
  Rasterizer raster(small_camera());
  raster.draw(scene, things, ahead(), 0, 0);
  EXPECT_EQ(raster.quad(raster.surface_at(31, 23)).label, kFirstMoverLabel);
  EXPECT_EQ(raster.moving_index(raster.surface_at(31, 23)), 0);
  const int seen = raster.surface_at(45, 23);
  ASSERT_TRUE(raster.is_part(seen));
  EXPECT_EQ(raster.part(seen).label, 1);
  EXPECT_EQ(raster.moving_index(seen), 0);
  EXPECT_EQ(raster.quad(raster.surface_at(2, 2)).label, 0);
  EXPECT_EQ(raster.moving_index(raster.surface_at(2, 2)), -1);
}

TEST(SyntheticShading, ColorIsTextureTimesLightInLinearLight) {
  StaticScene scene = plain_scene();
  Quad q = facing(-5, 5, -5, 5, 2);
  q.glow = 0.5f;
  scene.quads.push_back(q);
  Rasterizer raster(small_camera());
  const MovingThings nothing;
  raster.draw(scene, nothing, ahead(), 0, 0);
  std::vector<float> sum(3 * 64 * 48, 0.0f);
  const Shader shader;
  shader.add(raster, 1, 0, sum);
  for (std::size_t i = 0; i < sum.size(); i += 3) {
    EXPECT_NEAR(sum[i], 0.5 * 200 * 200 / 65025.0, 1e-4);
    EXPECT_NEAR(sum[i + 1], 0.5 * 150 * 150 / 65025.0, 1e-4);
    EXPECT_NEAR(sum[i + 2], 0.5 * 100 * 100 / 65025.0, 1e-4);
  }
}

TEST(SyntheticTexture, LevelsKeepTheMeanLight) {
  Canvas canvas(64, 32, {0, 0, 0});
  Random random(4);
  double light = 0;
  for (std::uint32_t& p : canvas.pixels) {
    const int v = random.below(256);
    p = pack({v, v, v}), light += v * v / 2048.0;
  }
  const Texture texture(canvas);
  EXPECT_EQ(texture.level_count(), 7);
  const Color last = unpack(texture.sample(64, 32, texture.level_count() - 1));
  EXPECT_NEAR(last.red, std::sqrt(light), 3);
  // The middle of a texel is that texel.
  EXPECT_EQ(texture.sample(64 + 5.5f, 32 + 7.5f, 0), canvas.at(5, 7));
  EXPECT_EQ(texture.sample(128 + 5.5f, 96 + 7.5f, 0), canvas.at(5, 7)) << "repeats";
}

}  // namespace
}  // namespace stillpoint::synthetic
