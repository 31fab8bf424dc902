// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/mapping/dense_map.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <utility>

#include "../any_size.hpp"
#include "../io/temporary_folder.hpp"

namespace {

using stillpoint::Camera;
using stillpoint::DenseMap;
using stillpoint::DynamicMask;
using stillpoint::RgbdFrame;

Camera camera() {
  Camera c;
  c.fx = c.fy = 100, c.cx = 79.5, c.cy = 59.5, c.width = 160, c.height = 120;
  return c;
}

// A wall at `wall_m`, and a square object before it when object_m > 0.
RgbdFrame wall(double wall_m, double object_m = 0) {
  RgbdFrame frame;
  frame.color = cv::Mat(120, 160, CV_8UC3, cv::Scalar(10, 20, 30));
  frame.depth = cv::Mat(120, 160, CV_32FC1, cv::Scalar(wall_m));
  if (object_m > 0) {
    frame.color(cv::Rect(60, 40, 40, 40)) = cv::Scalar(200, 0, 0);
    frame.depth(cv::Rect(60, 40, 40, 40)) = object_m;
  }
  return frame;
}

std::size_t count_before(const DenseMap& map, double z_m) {
  std::size_t n = 0;
  for (const auto& p : map.points()) n += p.position.z() < z_m;
  return n;
}

TEST(DenseMap, PlacesPointsInTheWorld) {
  DenseMap map;
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation() << 1, 2, 3;
  map.integrate(wall(2), camera(), DynamicMask(), T);
  map.integrate(wall(2), camera(), DynamicMask(), T);
  const auto points = map.points();
  ASSERT_GT(points.size(), 1000u);
  for (const auto& p : points) {
    EXPECT_NEAR(p.position.z(), 5, 1e-4);
    EXPECT_NEAR(p.position.x(), 1, 1.6);
    EXPECT_EQ(p.bgr, cv::Vec3b(10, 20, 30));
    EXPECT_EQ(p.count, 2u);
  }
  EXPECT_TRUE(map.points(3).empty());
}

TEST(DenseMap, LeavesOutMaskRangeAndEdges) {
  DenseMap map;
  DynamicMask mask;
  mask.image = cv::Mat::zeros(120, 160, CV_8UC1);
  mask.image(cv::Rect(56, 36, 48, 48)) = 255;
  map.integrate(wall(2, 1), camera(), mask, Eigen::Isometry3d::Identity());
  EXPECT_GT(map.size(), 500u);
  EXPECT_EQ(count_before(map, 1.9), 0u);

  map.clear();
  map.integrate(wall(6), camera(), DynamicMask(), Eigen::Isometry3d::Identity());
  EXPECT_EQ(map.size(), 0u);
  RgbdFrame checkered = wall(2);
  for (int y = 0; y < 120; y += 2)
    for (int x = 0; x < 160; x += 4) checkered.depth.at<float>(y, x) = 3;
  map.integrate(checkered, camera(), DynamicMask(), Eigen::Isometry3d::Identity());
  EXPECT_EQ(map.size(), 0u);
  RgbdFrame holes = wall(2);
  holes.depth.setTo(std::numeric_limits<float>::quiet_NaN());
  map.integrate(holes, camera(), DynamicMask(), Eigen::Isometry3d::Identity());
  holes.depth.release();
  map.integrate(holes, camera(), DynamicMask(), Eigen::Isometry3d::Identity());
  EXPECT_EQ(map.size(), 0u);
}

TEST(DenseMap, RemovesWhatLaterFramesSeeThrough) {
  DenseMap map;
  const Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  map.integrate(wall(2, 1), camera(), DynamicMask(), T);
  EXPECT_GT(count_before(map, 1.5), 100u);
  map.integrate(wall(2), camera(), DynamicMask(), T);
  EXPECT_GT(count_before(map, 1.5), 100u);
  map.integrate(wall(2), camera(), DynamicMask(), T);
  EXPECT_EQ(count_before(map, 1.5), 0u);
  EXPECT_GT(map.carved(), 100u);
  const std::size_t wall_points = map.size();
  for (int i = 0; i < 5; ++i) map.integrate(wall(2), camera(), DynamicMask(), T);
  EXPECT_EQ(map.size(), wall_points);
  // A hidden wall is not contradicted by what stands before it.
  for (int i = 0; i < 5; ++i) map.integrate(wall(2, 1), camera(), DynamicMask(), T);
  EXPECT_GE(map.size(), wall_points);
}

TEST(DenseMap, KeepsWithinItsMemory) {
  DenseMap::Settings settings;
  settings.max_voxels = 1000;
  DenseMap map(settings), again(settings);
  for (DenseMap* m : {&map, &again})
    for (int i = 0; i < 4; ++i) {
      Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
      T.translation().x() = 0.5 * i;
      m->integrate(wall(2), camera(), DynamicMask(), T);
      EXPECT_LE(m->size(), 1000u);
    }
  const auto a = map.points(), b = again.points();
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) EXPECT_EQ(a[i].position, b[i].position);
}

TEST(DenseMap, UndistortsTheLens) {
  Camera bent = camera(), flat = camera();
  bent.k1 = 0.2, bent.k2 = -0.1;
  DenseMap distorted, straight;
  distorted.integrate(wall(2), bent, DynamicMask(), Eigen::Isometry3d::Identity());
  straight.integrate(wall(2), flat, DynamicMask(), Eigen::Isometry3d::Identity());
  float widest = 0, expected = 0;
  for (const auto& p : distorted.points()) widest = std::max(widest, p.position.x());
  for (const auto& p : straight.points()) expected = std::max(expected, p.position.x());
  EXPECT_LT(widest, 0.97f * expected);
  // The frame fits the map it made: carving sees nothing behind.
  const std::size_t before = distorted.size();
  for (int i = 0; i < 3; ++i)
    distorted.integrate(wall(2), bent, DynamicMask(), Eigen::Isometry3d::Identity());
  EXPECT_EQ(distorted.size(), before);
}

TEST(DenseMap, LeavesOutPixelsThatTheLensCannotSee) {
  Camera lens = camera();
  lens.k1 = -0.4;  // its corners are no ray's
  DenseMap map;
  map.integrate(wall(2), lens, DynamicMask(), Eigen::Isometry3d::Identity());
  EXPECT_GT(map.size(), 500u);
  for (const auto& p : map.points()) {
    ASSERT_TRUE(p.position.allFinite());
    EXPECT_LT(p.position.norm(), 2 / std::cos(std::atan(0.914)) + 0.01);
  }
}

TEST(DenseMap, RefusesAPoseThatIsNotFinite) {
  DenseMap map;
  for (const double bad : {std::nan(""), std::numeric_limits<double>::infinity()})
    for (const auto& [row, column] : {std::pair<int, int>{0, 0}, {1, 3}}) {
      Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
      T.matrix()(row, column) = bad;
      EXPECT_ERROR(map.integrate(wall(2), camera(), DynamicMask(), T), "T_world_camera",
                   "found NaN or infinity");
    }
  EXPECT_EQ(map.size(), 0u);
  map.integrate(wall(2), camera(), DynamicMask(), Eigen::Isometry3d::Identity());
  EXPECT_GT(map.size(), 0u);
}

TEST(DenseMap, RefusesAPlaceWhereVoxelsWouldCollapse) {
  DenseMap map;
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation().y() = 10000;  // metres; of a projected map, for example
  map.integrate(wall(2), camera(), DynamicMask(), T);
  EXPECT_GT(map.size(), 1000u);
  T.translation().y() = -5.4e6;
  EXPECT_ERROR(map.integrate(wall(2), camera(), DynamicMask(), T), "T_world_camera",
               "m of the origin", "-5400000", "take the first pose for the origin");
}

TEST(DenseMap, RefusesFramesOfAnotherSizeThanTheCameras) {
  DenseMap map;
  Camera larger = camera();
  larger.width *= 2, larger.height *= 2;
  EXPECT_ERROR(map.integrate(wall(2), larger, DynamicMask(), Eigen::Isometry3d::Identity()),
               "frame.color", "camera's size 320x240", "found 160x120", "Camera::resized");
  EXPECT_NO_THROW(
      map.integrate(wall(2), of_any_size(larger), DynamicMask(), Eigen::Isometry3d::Identity()));
}

TEST(DenseMap, RefusesWrongInput) {
  DenseMap::Settings bad;
  for (const double voxel_m : {0.0, -1.0, 1e-7, std::nan(""), 1 / 0.0}) {
    bad.voxel_m = voxel_m;
    EXPECT_THROW(DenseMap{bad}, stillpoint::Error);
  }
  Camera unfinished = camera();
  unfinished.k1 = std::nan("");
  EXPECT_ERROR(
      DenseMap().integrate(wall(2), unfinished, DynamicMask(), Eigen::Isometry3d::Identity()),
      "expected finite numbers, found nan");
  for (double DenseMap::Settings::*setting :
       {&DenseMap::Settings::edge_ratio, &DenseMap::Settings::carve_margin_m,
        &DenseMap::Settings::carve_margin_per_m})
    for (const double value : {-1.0, std::nan("")}) {
      bad = DenseMap::Settings();
      bad.*setting = value;
      EXPECT_THROW(DenseMap{bad}, stillpoint::Error);
    }
  DenseMap map;
  DynamicMask mask;
  mask.image = cv::Mat::zeros(3, 3, CV_8UC1);
  EXPECT_THROW(map.integrate(wall(2), camera(), mask, Eigen::Isometry3d::Identity()),
               stillpoint::Error);
  EXPECT_THROW(map.integrate(wall(2), Camera(), DynamicMask(), Eigen::Isometry3d::Identity()),
               stillpoint::Error);
}

}  // namespace
