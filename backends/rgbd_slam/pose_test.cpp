// SPDX-License-Identifier: BSD-2-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "stillpoint/backends/rgbd_slam/patch.hpp"
#include "stillpoint/backends/rgbd_slam/pnp.hpp"
#include "stillpoint/backends/rgbd_slam/pose_graph.hpp"
#include "stillpoint/backends/rgbd_slam/tracked_frame.hpp"
#include "test_scene.hpp"

namespace {

using namespace stillpoint;
using namespace stillpoint::rgbd_slam;
using namespace test_scene;

std::vector<PoseObservation> observations_of(const Camera& camera, const Eigen::Isometry3d& T,
                                             int n) {
  std::vector<PoseObservation> observations;
  for (int i = 0; i < n; ++i) {
    const auto random = [&](int k) {
      return mix(static_cast<std::uint32_t>(i * 3 + k)) / 4294967296.0;
    };
    const double z = 1 + 3 * random(2);
    const Eigen::Vector2d pixel(320 * random(0), 240 * random(1));
    PoseObservation o;
    o.pixel = pixel;
    o.inverse_depth = i % 3 ? 1 / z : 0;
    o.point = T.inverse() * camera.unproject(pixel.x(), pixel.y(), z);
    observations.push_back(o);
  }
  return observations;
}

Eigen::Isometry3d some_pose() {
  return Eigen::Translation3d(0.3, -0.2, 0.5) *
         Eigen::AngleAxisd(0.37, Eigen::Vector3d(0.2, -0.3, 0.1).normalized());
}

TEST(PoseOptimizer, FindsThePoseAndTheOutliers) {
  const Camera camera = test_scene::camera();
  const Eigen::Isometry3d truth = some_pose();
  auto observations = observations_of(camera, truth, 120);
  for (std::size_t i = 0; i < 24; ++i) observations[i].pixel.x() += 30 + static_cast<double>(i);
  Eigen::Isometry3d T = Eigen::Translation3d(0.03, -0.02, 0.02) *
                        Eigen::AngleAxisd(0.04, Eigen::Vector3d(2, 3, -2).normalized()) * truth;
  EXPECT_EQ(optimize_pose(camera, NoiseModel(), observations, T), 96);
  EXPECT_TRUE(T.isApprox(truth, 1e-6));
  for (std::size_t i = 0; i < 24; ++i) EXPECT_FALSE(observations[i].inlier);
}

TEST(PoseOptimizer, DropsADepthThatDisagreesButKeepsThePixel) {
  const Camera camera = test_scene::camera();
  const Eigen::Isometry3d truth = some_pose();
  auto observations = observations_of(camera, truth, 60);
  observations[1].inverse_depth += 0.02;
  Eigen::Isometry3d T = truth;
  optimize_pose(camera, NoiseModel(), observations, T);
  EXPECT_TRUE(T.isApprox(truth, 1e-4));
  EXPECT_TRUE(observations[1].inlier);
  EXPECT_FALSE(observations[1].depth_inlier);
}

// More points are on somebody who walked into the newest keyframe than on the walls that both know.
TEST(RefinePose, KeepsToWhatSeveralKeyframesKnow) {
  constexpr std::size_t kWalls = 80, kAll = 200;
  CameraModel model;
  model.camera = test_scene::camera();
  const Eigen::Isometry3d truth = some_pose();
  const auto observations = observations_of(model.camera, truth, kAll);
  KeypointFrame seen;
  for (const PoseObservation& o : observations) {
    FrameKeypoint k;
    k.x = static_cast<float>(o.pixel.x()), k.y = static_cast<float>(o.pixel.y());
    k.depth_m = static_cast<float>(o.inverse_depth > 0 ? 1 / o.inverse_depth : 0);
    seen.keypoints.push_back(k);
  }
  seen.descriptors.resize(kAll);
  Map map;
  Keyframe& first = map.add_keyframe(seen, truth);
  Keyframe& newest = map.add_keyframe(seen, truth);
  TrackedFrame frame(seen);
  for (std::size_t i = 0; i < kAll; ++i) {
    const bool wall = i < kWalls;
    const Eigen::Vector3d walked(wall ? 0 : 0.05, 0, 0);
    MapPoint& p = map.add_point(observations[i].point - walked, newest, i);
    if (wall) map.observe(p, first, i);
    frame.points[i] = p.id;
  }
  frame.T_camera_world = truth;
  EXPECT_GE(refine_pose(model, map, frame), static_cast<int>(kWalls));
  EXPECT_LT((frame.T_camera_world.inverse() * truth).translation().norm(), 0.002);
  for (std::size_t i = 0; i < kWalls; ++i) EXPECT_TRUE(frame.points[i]);
}

TEST(PnpRansac, FindsThePoseWithoutAGuess) {
  const Camera camera = test_scene::camera();
  const Eigen::Isometry3d truth = some_pose();
  auto observations = observations_of(camera, truth, 90);
  for (std::size_t i = 0; i < 45; ++i) observations[i].pixel = {7.0 * static_cast<double>(i), 90};
  const auto T = solve_pnp_ransac(camera, NoiseModel(), observations, 20);
  ASSERT_TRUE(T.has_value());
  EXPECT_TRUE(T->isApprox(truth, 1e-4));
  observations.resize(3);
  EXPECT_FALSE(solve_pnp_ransac(camera, NoiseModel(), observations, 20).has_value());
}

TEST(PoseGraph, SpreadsTheDriftOverTheLoop) {
  // A circle whose odometry turns a little too far; one edge says where the end really is.
  constexpr std::size_t kCount = 20;
  const auto truth = [](std::size_t i) {
    const double angle = 2 * std::acos(-1.0) * static_cast<double>(i) / kCount;
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.linear() = Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitY()).toRotationMatrix();
    T.translation() = T.linear() * Eigen::Vector3d(0, 0, -3);
    return Eigen::Isometry3d(T.inverse());
  };
  std::map<KeyframeId, Eigen::Isometry3d> poses{{KeyframeId(0), truth(0)}};
  std::vector<PoseGraphEdge> edges;
  Eigen::Isometry3d drift = Eigen::Isometry3d::Identity();
  drift.linear() = Eigen::AngleAxisd(0.01, Eigen::Vector3d::UnitY()).toRotationMatrix();
  drift.translation() << 0.01, 0, 0;
  for (std::size_t i = 1; i < kCount; ++i) {
    const Eigen::Isometry3d step = drift * truth(i) * truth(i - 1).inverse();
    const KeyframeId id(i), last(i - 1);
    poses[id] = step * poses[last];
    edges.push_back({id, last, step});
  }
  edges.push_back({KeyframeId(kCount - 1), KeyframeId(0), truth(kCount - 1) * truth(0).inverse()});
  const auto error = [&] {
    double worst = 0;
    for (const auto& [id, T] : poses)
      worst = std::max(
          worst, (T.inverse().translation() - truth(id.index()).inverse().translation()).norm());
    return worst;
  };
  const double before = error();
  ASSERT_TRUE(optimize_pose_graph(poses, edges, KeyframeId(0)));
  EXPECT_LT(error(), before / 3);
  EXPECT_TRUE(poses[KeyframeId(0)].isApprox(truth(0), 1e-12));
}

// A smooth pattern on a plane at 2 m before the first camera, as a camera at `T_world_camera` sees
// it.
cv::Mat smooth_plane(const Camera& camera, const Eigen::Isometry3d& T_world_camera) {
  cv::Mat gray(camera.height, camera.width, CV_32FC1);
  for (int y = 0; y < gray.rows; ++y)
    for (int x = 0; x < gray.cols; ++x) {
      const Eigen::Vector3d d = T_world_camera.linear() * camera.unproject(x, y, 1);
      const Eigen::Vector3d o = T_world_camera.translation();
      const Eigen::Vector3d p = o + d * ((2 - o.z()) / d.z());
      gray.at<float>(y, x) = static_cast<float>(128 + 40 * std::sin(90 * p.x() + 7 * p.y()) +
                                                40 * std::sin(80 * p.y() - 20 * p.x()));
    }
  return gray;
}

TEST(Patch, FindsItsPlaceToATenthOfAPixelWhateverTheTurnAndTheLight) {
  const Camera camera = test_scene::camera();
  const Eigen::Isometry3d first = Eigen::Isometry3d::Identity();
  Eigen::Isometry3d second = first;
  second.linear() = Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  second.translation() << 0.013, -0.008, 0.1;
  ImagePyramid a, b;
  a.build(smooth_plane(camera, first), 3, 1.2);
  b.build(smooth_plane(camera, second) + 15, 3, 1.2);
  for (int level = 0; level < 3; ++level)
    for (const Eigen::Vector2d& pixel :
         {Eigen::Vector2d(150, 110), Eigen::Vector2d(170.3, 140.6), Eigen::Vector2d(120, 130)}) {
      const Eigen::Vector3d point = camera.unproject(pixel.x(), pixel.y(), 2);
      const Patch patch = cut_patch(a, camera, pixel, level, first.linear(), 2);
      ASSERT_FALSE(patch.empty());
      const Eigen::Vector2d truth = camera.project(second.inverse() * point);
      const auto place = align_patch(b, camera, patch, second.inverse(), point,
                                     truth + Eigen::Vector2d(0.8, -0.7), level);
      ASSERT_TRUE(place.has_value()) << level << ' ' << pixel.transpose();
      EXPECT_LT((*place - truth).norm(), 0.1) << level << ' ' << pixel.transpose();
    }
}

TEST(Patch, RefusesOtherSurfacesAndRims) {
  const Camera camera = test_scene::camera();
  ImagePyramid pyramid, blank;
  pyramid.build(smooth_plane(camera, Eigen::Isometry3d::Identity()), 3, 1.2);
  blank.build(cv::Mat(240, 320, CV_32FC1, cv::Scalar(90)), 3, 1.2);
  const Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  const Eigen::Vector2d pixel(160, 120);
  const Patch patch = cut_patch(pyramid, camera, pixel, 0, T.linear(), 2);
  ASSERT_FALSE(patch.empty());
  const Eigen::Vector3d point = camera.unproject(160, 120, 2);
  EXPECT_FALSE(align_patch(blank, camera, patch, T, point, pixel, 0).has_value());
  EXPECT_FALSE(align_patch(pyramid, camera, patch, T, point, {3, 120}, 0).has_value());
  EXPECT_FALSE(align_patch(pyramid, camera, patch, T, -point, pixel, 0).has_value());
  EXPECT_FALSE(align_patch(pyramid, camera, Patch(), T, point, pixel, 0).has_value());
  EXPECT_TRUE(cut_patch(pyramid, camera, {3, 120}, 0, T.linear(), 2).empty());
  EXPECT_TRUE(cut_patch(pyramid, camera, pixel, 7, T.linear(), 2).empty());
}

}  // namespace
