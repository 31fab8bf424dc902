// SPDX-License-Identifier: BSD-2-Clause
#pragma once

// The test of both ORB_SLAM adapters, as C++14. The including file says what `Slam` is, which
// track_rgbd() is meant, and by ORB_SLAM_TEST(name) what the suite is called.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "../flat_scene.hpp"

namespace {

const double kStart_s = 1300000000;

ORB_SLAM_TEST(IsFedStaticKeypointsAndNeverStarved) {
  const FlatScene scene = large_scene();
  Slam slam("", "", Slam::RGBD, false);
  stillpoint::HostFrontEnd front_end(scene.camera());
  int in_person_before = 0;
  for (int i = 0; i < 6; ++i) {
    const Figure person = walker(i);
    const auto frame = scene.frame(kStart_s + i / 30.0, {person});
    stillpoint::Segmentation segmentation;
    if (i % 2 == 0) segmentation = result({box_instance(person.box, scene.size)});
    ASSERT_TRUE(track_rgbd(slam, front_end, frame, segmentation));
    EXPECT_TRUE(slam.frame.complete);
    EXPECT_EQ(slam.frame.N, front_end.stats().kept);
    EXPECT_EQ(slam.frame.mDescriptors.rows, slam.frame.N);
    EXPECT_LT(slam.frame.N, front_end.stats().keypoints - 100);
    const cv::Mat mask = front_end.mask();
    for (const cv::KeyPoint& k : slam.frame.mvKeys)
      EXPECT_EQ(mask.at<uchar>(cvRound(k.pt.y), cvRound(k.pt.x)), 0);
    // What is left is what the same frame without the hook's mask has outside the person.
    const cv::Rect inner(person.box.x + 20, person.box.y + 20, person.box.width - 40,
                         person.box.height - 40);
    for (const cv::KeyPoint& k : slam.frame.mvKeys) in_person_before += inner.contains(k.pt);
  }
  EXPECT_EQ(in_person_before, 0);
  EXPECT_EQ(front_end.stats().filtered, 6);
  EXPECT_GT(front_end.features_for(1000), 1000);
}

ORB_SLAM_TEST(StartsThoughMostOfThePictureIsMasked) {
  const FlatScene scene = large_scene();
  Slam slam("", "", Slam::RGBD, false);
  stillpoint::HostFrontEnd front_end(scene.camera());
  const Figure wall{{20, 10, 600, 460}, 2, 7};
  for (int i = 0; i < 3; ++i) {
    const auto frame = scene.frame(kStart_s + i / 30.0, {wall});
    EXPECT_TRUE(track_rgbd(slam, front_end, frame, result({box_instance(wall.box, scene.size)})));
    EXPECT_GE(slam.frame.N, i == 0 ? 501 : 100) << "frame " << i;
    EXPECT_LT(slam.frame.N, 600) << "the floor, no more";
  }
}

ORB_SLAM_TEST(WaitsWithTheHighFloorWhileTheHostDoesNotStart) {
  const FlatScene scene = large_scene();
  Slam slam("", "", Slam::RGBD, false);
  slam.features = 400;  // never enough for the host
  stillpoint::HostFrontEnd front_end(scene.camera());
  for (int i = 0; i < 3; ++i) {
    const auto frame = scene.frame(kStart_s + i / 30.0, {walker(i)});
    EXPECT_FALSE(
        track_rgbd(slam, front_end, frame, result({box_instance(walker(i).box, scene.size)})));
    EXPECT_EQ(slam.frame.N, front_end.stats().keypoints) << "all are needed, frame " << i;
  }
}

ORB_SLAM_TEST(GivesThePoseOfTheCameraInTheWorld) {
  const FlatScene scene = large_scene();
  Slam slam("", "", Slam::RGBD, false);
  stillpoint::HostFrontEnd front_end(scene.camera());
  const float c = std::cos(0.3f), s = std::sin(0.3f);
  // T_camera_world: turned about y, then moved.
  const cv::Matx44f T_camera_world(c, 0, s, 1, 0, 1, 0, 2, -s, 0, c, 3, 0, 0, 0, 1);
  slam.pose_of = [&](double) { return T_camera_world; };
  cv::Matx44d T_world_camera;
  ASSERT_TRUE(track_rgbd(slam, front_end, scene.frame(kStart_s, {}), result({}), &T_world_camera));
  const cv::Matx44d one = cv::Matx44d(T_camera_world) * T_world_camera;
  EXPECT_LT(cv::norm(one, cv::Matx44d::eye(), cv::NORM_INF), 1e-6);
}

ORB_SLAM_TEST(RunsAsEverWithoutAFrontEnd) {
  const FlatScene scene = large_scene();
  Slam slam("", "", Slam::RGBD, false);
  const auto frame = scene.frame(kStart_s, {walker(0)});
  slam.TrackRGBD(frame.color, frame.depth, frame.timestamp);
  EXPECT_GT(slam.frame.N, 1500);
  EXPECT_EQ(slam.GetTrackingState(), 2);
}

}  // namespace
