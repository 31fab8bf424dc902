// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/evaluation/ghost_metrics.hpp"

#include <gtest/gtest.h>

namespace {

using namespace stillpoint;

Camera camera() {
  Camera c;
  c.fx = c.fy = 100, c.cx = 79.5, c.cy = 59.5, c.width = 160, c.height = 120;
  return c;
}

// A person (a board) at 2 m before a wall at 3 m; `person` false: the wall alone.
struct Scene {
  explicit Scene(bool person) {
    frame.color = cv::Mat(120, 160, CV_8UC3, cv::Scalar(10, 20, 30));
    frame.depth = cv::Mat(120, 160, CV_32FC1, cv::Scalar(3));
    people = cv::Mat::zeros(120, 160, CV_8UC1);
    if (!person) return;
    const cv::Rect board(60, 40, 40, 40);
    frame.depth(board) = 2;
    people(board) = 1;
  }
  RgbdFrame frame;
  cv::Mat people;
};

ColoredPoint point(double x, double y, double z) {
  ColoredPoint p;
  p.position = Eigen::Vector3d(x, y, z).cast<float>();
  return p;
}

TEST(GhostCounter, CountsWhatLiesWherePeopleWere) {
  GhostCounter counter;
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation() << 1, 0, 0;
  counter.add(Scene(true).frame, camera(), Scene(true).people, T);
  // On the board, on the wall, in empty space; in the world the camera stands at x = 1.
  const std::vector<ColoredPoint> map{point(1, 0, 2), point(1.1, 0.1, 2.02), point(-0.5, 0, 3),
                                      point(1, 0, 1)};
  const GhostCounts counts = counter.count(map, Eigen::Isometry3d::Identity());
  EXPECT_EQ(counts.points, 4u);
  EXPECT_EQ(counts.ghosts, 2u);
  EXPECT_DOUBLE_EQ(counts.share(), 0.5);
  // The same map in its own frame of reference.
  std::vector<ColoredPoint> own = map;
  for (ColoredPoint& p : own) p.position = (T.inverse() * p.position.cast<double>()).cast<float>();
  EXPECT_EQ(counter.count(own, T).ghosts, 2u);
  EXPECT_EQ(counter.count(own, Eigen::Isometry3d::Identity()).ghosts, 0u);
}

TEST(GhostCounter, WhatIsStaticThereIsNoGhost) {
  GhostCounter counter;
  const Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  Scene touching(true);
  touching.frame.depth.setTo(2.95);  // leans at the wall
  touching.frame.depth.setTo(3, touching.people == 0);
  counter.add(touching.frame, camera(), touching.people, T);
  const std::vector<ColoredPoint> map{point(0, 0, 3)};
  EXPECT_EQ(counter.count(map, T).ghosts, 1u);  // nobody ever saw the wall there
  counter.add(Scene(false).frame, camera(), Scene(false).people, T);
  EXPECT_EQ(counter.count(map, T).ghosts, 0u);
}

TEST(GhostCounter, AMaskMayBeAPartOfALargerImage) {
  GhostCounter counter;
  const Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  Scene scene(false);
  scene.people(cv::Rect(0, 40, 8, 40)) = 1;  // somebody leans at the wall, at the border
  counter.add(scene.frame, camera(), scene.people, T);
  const std::vector<ColoredPoint> map{point(-2.3, 0, 3)};
  EXPECT_EQ(counter.count(map, T).ghosts, 1u);
  cv::Mat larger(200, 300, CV_8UC1, cv::Scalar(1));  // people all around
  cv::Mat nobody = larger(cv::Rect(70, 40, 160, 120));
  nobody.setTo(0);
  counter.add(Scene(false).frame, camera(), nobody, T);
  EXPECT_EQ(counter.count(map, T).ghosts, 0u) << "the wall was seen there";
}

TEST(GhostCounter, ChecksItsInput) {
  GhostCounter counter;
  const Scene scene(true);
  const Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  EXPECT_THROW(counter.add(scene.frame, camera(), cv::Mat(), T), Error);
  EXPECT_THROW(counter.add(scene.frame, Camera(), scene.people, T), Error);
  Camera other = camera();
  other.width = 640, other.height = 480;
  EXPECT_THROW(counter.add(scene.frame, other, scene.people, T), Error);
  Eigen::Isometry3d far = T;
  far.translation().x() = 1e6;
  EXPECT_THROW(counter.add(scene.frame, camera(), scene.people, far), Error);
  GhostCounter::Settings settings;
  settings.cell_m = 0;
  EXPECT_THROW(GhostCounter{settings}, Error);
  EXPECT_TRUE(std::isnan(counter.count({}, T).share()));
}

}  // namespace
