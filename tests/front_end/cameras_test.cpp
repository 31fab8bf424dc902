// SPDX-License-Identifier: BSD-2-Clause
// What real cameras do to the front end: lenses, rates, dropouts, delays, hosts that err.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>
#include <utility>
#include <vector>

#include "../flat_scene.hpp"
#include "room_camera.hpp"
#include "stillpoint/front_end.hpp"
#include "stillpoint/motion/ego_motion.hpp"

namespace {

using namespace stillpoint;

Camera camera_of(int width, double focal_share = 0.82) {
  Camera camera;
  camera.width = width, camera.height = width * 3 / 4;
  camera.fx = camera.fy = focal_share * width;
  camera.cx = 0.5 * (camera.width - 1), camera.cy = 0.5 * (camera.height - 1);
  return camera;
}

Eigen::Isometry3d turned(double deg, double x = 0) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = Eigen::AngleAxisd(deg * CV_PI / 180, Eigen::Vector3d::UnitY()).toRotationMatrix();
  T.translation() = Eigen::Vector3d(x, 0, -1.5);
  return T;
}

// Looks to and fro, up to 1.5 degrees from frame to frame.
double yaw_deg(double i) { return 15 * std::sin(0.1 * i); }

const Segmentation kNothing;

TEST(Cameras, NothingMovesBehindADistortingLens) {
  for (const double focal : {330.0, 380.0}) {
    Camera camera = camera_of(640);
    camera.fx = camera.fy = focal;
    camera.k1 = -0.28, camera.k2 = 0.08;
    const RoomCamera room(camera);
    for (const bool exact_poses : {true, false}) {
      SCOPED_TRACE(testing::Message() << focal << (exact_poses ? ", exact poses" : ", no poses"));
      FrontEnd front_end(FrontEndSettings(), camera);
      double sum = 0;
      const int frames = 50;
      for (int i = 0; i < frames; ++i) {
        const Eigen::Isometry3d pose = turned(yaw_deg(i), 0.1 * std::sin(0.05 * i));
        std::optional<Eigen::Isometry3d> motion;
        if (exact_poses && i > 0)
          motion = pose.inverse() * turned(yaw_deg(i - 1), 0.1 * std::sin(0.05 * (i - 1)));
        front_end.compute_mask(room.frame(i / 30.0, pose), kNothing, motion);
        if (exact_poses) front_end.correct_pose(pose);
        sum += front_end.stats().mask_share;
      }
      EXPECT_LE(sum / frames, 0.01);
    }
  }
}

TEST(Cameras, ALensThatCannotSeeItsCornersDoesNoHarm) {
  Camera camera = camera_of(640);
  camera.fx = camera.fy = 460;
  camera.k1 = -0.4;  // most that the distortion reaches is 0.61 of the focal length
  Camera pinhole = camera;
  pinhole.k1 = 0;
  const RoomCamera room(pinhole);
  FrontEnd front_end(FrontEndSettings(), camera);
  for (int i = 0; i < 12; ++i) {
    const Eigen::Isometry3d pose = turned(yaw_deg(i));
    RgbdFrame frame = room.frame(i / 30.0, pose);
    // In a corner that no ray reaches, and in the middle.
    const Instance corner = box_instance({0, 0, 90, 120}, frame.color.size());
    const Instance middle = box_instance({300, 200, 60, 90}, frame.color.size());
    front_end.compute_mask(frame, i % 3 == 2 ? Segmentation() : result({corner, middle}));
    front_end.correct_pose(pose);
    EXPECT_GT(cv::countNonZero(front_end.mask().image), 0);
    for (const DynamicObject& object : front_end.objects())
      for (const auto& state : {object.in_camera, object.in_world})
        EXPECT_TRUE(!state || (state->centroid_m.allFinite() && state->velocity_m_s.allFinite() &&
                               state->covariance.allFinite()));
  }
}

TEST(Cameras, AFrameWithoutDepthInATurnDoesNoHarm) {
  const Camera camera = camera_of(320);
  const RoomCamera room(camera);
  for (const bool predicts : {true, false}) {
    SCOPED_TRACE(predicts);
    FrontEnd front_end(FrontEndSettings(), camera);
    for (int i = 0; i < 40; ++i) {
      const Eigen::Isometry3d pose = turned(-40 + 2 * i);  // 60 deg/s
      std::optional<Eigen::Isometry3d> motion;
      if (predicts && i > 0) motion = pose.inverse() * turned(-40 + 2 * (i - 1));
      RgbdFrame frame = room.frame(i / 30.0, pose);
      if (i == 20) frame.depth = cv::Mat();
      front_end.compute_mask(frame, kNothing, motion);
      EXPECT_EQ(front_end.stats().mask_share, 0) << i;
      if (predicts && i > 0) {
        ASSERT_TRUE(front_end.ego_motion().motion().has_value());
        EXPECT_NEAR(Eigen::AngleAxisd(front_end.ego_motion().motion()->linear()).angle(),
                    2 * CV_PI / 180, 0.003)
            << i;
      }
      front_end.correct_pose(pose);
    }
  }
}

TEST(Cameras, ADepthImageOfAFewSpecksDoesNoHarm) {
  const Camera camera = camera_of(320);
  const RoomCamera room(camera);
  FrontEnd front_end(FrontEndSettings(), camera);
  int chain = 0;
  for (int i = 0; i < 16; ++i) {
    RgbdFrame frame = room.frame(i / 30.0, turned(yaw_deg(i)));
    if (i == 8) {
      const cv::Rect speck(100, 100, 30, 30);
      const cv::Mat measured = frame.depth(speck).clone();
      frame.depth.setTo(0);
      measured.copyTo(frame.depth(speck));
    }
    front_end.compute_mask(frame, kNothing);
    EXPECT_EQ(front_end.stats().mask_share, 0) << i;
    const EgoMotion& ego = front_end.ego_motion();
    EXPECT_EQ(ego.motion().has_value(), i > 0) << i;
    EXPECT_TRUE(i < 2 || ego.chain() == chain) << i;
    chain = ego.chain();
  }
}

TEST(Cameras, DepthMayComeLessOftenThanColor) {
  const Camera camera = camera_of(320);
  const RoomCamera room(camera);
  for (const int every : {2, 6}) {
    SCOPED_TRACE(every);
    FrontEnd front_end(FrontEndSettings(), camera);
    const auto compute = [&](int i, bool somebody) {
      RgbdFrame frame = room.frame(i / 30.0, turned(yaw_deg(i)));
      if (somebody) frame.depth(cv::Rect(120, 60, 60, 160)).setTo(1.2);
      if (i % every != 0) frame.depth = cv::Mat();
      front_end.compute_mask(frame, kNothing);
    };
    for (int i = 0; i < 42; ++i) {
      compute(i, false);
      EXPECT_EQ(front_end.stats().mask_share, 0) << i;
      const EgoMotion& ego = front_end.ego_motion();
      ASSERT_EQ(ego.motion().has_value(), i >= every) << i;
      if (i < every) continue;
      // Between two depth images it goes on as before; the yaw is accelerated by up to 0.15 deg
      // per frame and frame.
      const int gap = i % every;
      const double late_deg = 0.15 * gap * (gap + every) / 2;
      const Eigen::Isometry3d off = ego.pose().inverse() * turned(yaw_deg(i) - yaw_deg(0));
      EXPECT_LT(Eigen::AngleAxisd(off.linear()).angle() * 180 / CV_PI, 0.5 + late_deg) << i;
      if (gap > 0) continue;
      const double yaw_deg_s = 30 * (yaw_deg(i) - yaw_deg(i - every)) / every;
      EXPECT_NEAR(ego.angular_velocity().y() * 180 / CV_PI, yaw_deg_s, 3) << i;
    }
    // Who comes in afterwards is found.
    for (int i = 42; i < 54; i += every) {
      compute(i, true);
      EXPECT_EQ(front_end.mask().image.at<uchar>(140, 150), 255) << i;
    }
  }
}

TEST(Cameras, AMotionInMillimetresIsRefused) {
  const Camera camera = camera_of(320);
  const RoomCamera room(camera);
  FrontEnd front_end(FrontEndSettings(), camera);
  const auto pose = [](int i) { return turned(yaw_deg(i), 0.01 * i); };
  for (int i = 0; i < 30; ++i) {
    Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
    if (i > 0) motion = pose(i).inverse() * pose(i - 1);
    motion.translation() *= 1000;
    front_end.compute_mask(room.frame(i / 30.0, pose(i)), kNothing, motion);
    EXPECT_EQ(front_end.stats().mask_share, 0) << i;
    if (i == 0) continue;
    EXPECT_TRUE(front_end.stats().status & kPoseRefused) << i;
    ASSERT_TRUE(front_end.ego_motion().motion().has_value()) << i;
    EXPECT_NEAR(front_end.ego_motion().speed_m_s(), 0.3, 0.1) << i;
  }
  // A cut, to another place, is one.
  const int chain = front_end.ego_motion().chain();
  const Eigen::Isometry3d there = turned(150);
  front_end.compute_mask(room.frame(1, there), kNothing, there.inverse() * pose(29));
  EXPECT_FALSE(front_end.stats().status & kPoseRefused);
  EXPECT_NE(front_end.ego_motion().chain(), chain);
}

TEST(Cameras, NothingIsAssumedWhereDepthStaysAway) {
  const Camera camera = camera_of(320);
  const RoomCamera room(camera);
  FrontEnd front_end(FrontEndSettings(), camera);
  for (int i = 0; i < 40; ++i) {
    RgbdFrame frame = room.frame(i / 30.0, turned(yaw_deg(i)));
    if (i >= 10 && i < 30) frame.depth = cv::Mat();
    front_end.compute_mask(frame, kNothing);
    EXPECT_EQ(front_end.stats().mask_share, 0) << i;
    // The last depth is that of frame 9; 0.25 s are bridged.
    EXPECT_EQ(front_end.ego_motion().motion().has_value(), (i > 0 && i < 17) || i > 30) << i;
  }
}

TEST(Cameras, AWrongStampOfTheDepthDoesNoHarm) {
  const Camera camera = camera_of(320);
  const RoomCamera room(camera);
  for (const double off_s : {0.0, -0.3, 0.3}) {
    SCOPED_TRACE(off_s);
    FrontEnd front_end(FrontEndSettings(), camera);
    for (int i = 0; i < 40; ++i) {
      RgbdFrame frame = room.frame(i / 30.0, turned(yaw_deg(i)));
      frame.depth_timestamp = frame.timestamp + (i == 20 ? off_s : 0);
      front_end.compute_mask(frame, kNothing);
      EXPECT_EQ(front_end.stats().mask_share, 0) << i;
    }
    // Who comes in afterwards is found.
    for (int i = 40; i < 45; ++i) {
      RgbdFrame frame = room.frame(i / 30.0, turned(yaw_deg(i)));
      frame.depth(cv::Rect(120, 60, 60, 160)).setTo(1.2);
      front_end.compute_mask(frame, kNothing);
      EXPECT_EQ(front_end.mask().image.at<uchar>(140, 150), 255) << i;
    }
  }
}

TEST(Cameras, TellsHowLateTheDepthIsTaken) {
  const Camera camera = camera_of(320);
  const RoomCamera room(camera);
  for (const double late_s : {-0.02, 0.0, 0.03}) {
    SCOPED_TRACE(late_s);
    FrontEnd front_end(FrontEndSettings(), camera);
    EXPECT_TRUE(std::isnan(front_end.stats().depth_delay_s));
    double share = 0;
    for (int i = 0; i < 120; ++i) {
      RgbdFrame frame = room.frame(i / 30.0, turned(yaw_deg(i)));
      frame.depth = room.frame(0, turned(yaw_deg(i + 30 * late_s))).depth;
      front_end.compute_mask(frame, kNothing);
      share += front_end.stats().mask_share / 120;
    }
    EXPECT_NEAR(front_end.stats().depth_delay_s, late_s, 0.003);
    EXPECT_EQ(share, 0);
  }
}

TEST(Cameras, TellsHowLongTheDepthIsReadOut) {
  const Camera camera = camera_of(320);
  const RoomCamera room(camera);
  const auto pose = [](double i) { return turned(yaw_deg(i), 0.15 * std::sin(0.07 * i)); };
  for (const double readout_s : {-0.02, 0.0, 0.03}) {
    SCOPED_TRACE(readout_s);
    FrontEnd front_end(FrontEndSettings(), camera);
    EXPECT_TRUE(std::isnan(front_end.stats().depth_readout_s));
    double share = 0;
    for (int i = 0; i < 210; ++i) {
      RgbdFrame frame = room.frame(i / 30.0, pose(i));
      frame.depth =
          room.frame_in_rows(0, [&](double row) { return pose(i + 30 * readout_s * row); }).depth;
      front_end.compute_mask(frame, kNothing);
      share += front_end.stats().mask_share / 210;
    }
    EXPECT_NEAR(front_end.stats().depth_readout_s, readout_s, 0.003);
    EXPECT_EQ(share, 0);
  }
}

TEST(Cameras, WithoutDepthTheHostsMotionIsUsed) {
  const FlatScene scene;
  FrontEnd front_end(FrontEndSettings(), scene.camera());
  const Eigen::Isometry3d motion = turned(1).inverse() * turned(0);
  for (int i = 0; i < 3; ++i) {
    RgbdFrame frame = scene.frame(i / 30.0, {});
    frame.depth = cv::Mat();
    front_end.compute_mask(frame, kNothing, motion);
    ASSERT_TRUE(front_end.ego_motion().motion().has_value());
    EXPECT_TRUE(front_end.ego_motion().motion()->isApprox(motion));
  }
  // 4.6 px in the middle of the image and more at its sides, exposed for half of the time.
  EXPECT_NEAR(front_end.stats().blur.motion_px, 2.5, 0.2);
}

TEST(Cameras, FindASlowBoardAtAnyRate) {
  const Camera camera = camera_of(240);
  for (const double speed_m_s : {0.05, 0.1})
    for (const double hz : {10.0, 30.0, 60.0, 90.0}) {
      SCOPED_TRACE(testing::Message() << speed_m_s << " m/s at " << hz << " Hz");
      RoomCamera room(camera);
      FrontEnd front_end(FrontEndSettings(), camera);
      const int frames = static_cast<int>(2.4 * hz);
      int found = 0;
      for (int i = 0; i < frames; ++i) {
        // It comes nearer from 1.1 m.
        room.board_m = Eigen::Vector3f(0, 0, static_cast<float>(-0.4 - speed_m_s * i / hz));
        front_end.compute_mask(room.frame(i / hz, turned(0)), kNothing,
                               Eigen::Isometry3d::Identity());
        if (i > 1.8 * hz) found += front_end.stats().mask_share > 0.05;
      }
      EXPECT_GT(found, 0.9 * (frames - 1.8 * hz - 1));
    }
}

TEST(Cameras, APoseThatIsNotFiniteIsRefusedAndForgotten) {
  const Camera camera = camera_of(320);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  Eigen::Isometry3d broken = Eigen::Isometry3d::Identity();
  broken.translation().x() = nan;
  for (const bool as_correction : {false, true}) {
    RoomCamera room(camera);
    FrontEnd front_end(FrontEndSettings(), camera);
    int found = 0;
    for (int i = 0; i < 49; ++i) {
      room.board_m = Eigen::Vector3f(-0.6f + 0.025f * static_cast<float>(i), 0, 0);
      const bool bad = i == 10;
      front_end.compute_mask(room.frame(i / 30.0, turned(0)), kNothing,
                             bad && !as_correction ? broken : Eigen::Isometry3d::Identity());
      front_end.correct_pose(bad && as_correction ? broken : turned(0));
      EXPECT_EQ((front_end.stats().status & kPoseRefused) != 0, bad) << i;
      if (i > 20) found += front_end.stats().moving > 0;
    }
    EXPECT_GE(found, 27);
  }
}

TEST(Cameras, NeverWriteIntoTheCallersImage) {
  FlatScene gray_scene, color_scene;
  gray_scene.size = color_scene.size = {200, 150};  // so small that nothing is shrunk
  gray_scene.color_channels = 1;
  for (const FrontEndSettings& settings : {FrontEndSettings::network_only(), FrontEndSettings()}) {
    FrontEnd front_end(settings, gray_scene.camera());
    const RgbdFrame gray = gray_scene.frame(0, {{{40, 20, 60, 100}, 2, 3}});
    const cv::Mat before = gray.color.clone();
    front_end.compute_mask(gray, kNothing);
    for (int i = 1; i < 5; ++i)
      front_end.compute_mask(color_scene.frame(0.033 * i, {{{60, 20, 60, 100}, 2, 9}}), kNothing);
    EXPECT_TRUE(identical(gray.color, before));
  }
}

TEST(Cameras, AFrontEndMovesButIsNotCopied) {
  static_assert(!std::is_copy_constructible<FrontEnd>::value, "two would share one mask");
  static_assert(!std::is_copy_assignable<FrontEnd>::value, "two would share one mask");
  const FlatScene scene;
  const Figure person{{100, 60, 60, 140}, 2, 1};
  std::vector<FrontEnd> cameras;
  std::vector<Instance> first;
  for (int k = 0; k < 9; ++k) {
    cameras.emplace_back(FrontEndSettings(), scene.camera());
    cameras.back().compute_mask(scene.frame(1, {person}),
                                result({box_instance(person.box, scene.size)}));
    if (k == 0) first = cameras[0].instances();
  }
  for (const FrontEnd& front_end : cameras) {
    ASSERT_EQ(front_end.instances().size(), 1u);
    EXPECT_TRUE(identical(front_end.instances()[0].mask, first[0].mask));
  }
  FrontEnd moved = std::move(cameras[4]);
  moved.compute_mask(scene.frame(1.03, {person}), Segmentation());
  EXPECT_EQ(moved.stats().restored, 1);
}

TEST(Cameras, ResultsAreTheCallers) {
  const FlatScene scene;
  const auto person = [](int i) { return Figure{{60 + 8 * i, 60, 60, 140}, 2, 1}; };
  const auto show = [&](FrontEnd& front_end, int i) -> const DynamicMask& {
    return front_end.compute_mask(scene.frame(1 + i / 30.0, {person(i)}),
                                  result({box_instance(person(i).box, scene.size)}));
  };
  FrontEnd front_end({}, scene.camera()), other({}, scene.camera());
  const DynamicMask kept = show(front_end, 0);
  const std::vector<Instance> instances = front_end.instances();
  const cv::Mat mask_then = kept.image.clone(), instance_then = instances[0].mask.clone();
  show(other, 0);
  for (int i = 1; i < 6; ++i) {
    // He draws into what he was given.
    cv::Mat drawn = show(front_end, i).image;
    drawn.setTo(255);
    for (const Instance& s : front_end.instances()) cv::Mat(s.mask).setTo(77);
    if (i < 5) {
      show(other, i);
      drawn.release();
      continue;
    }
  }
  EXPECT_TRUE(identical(kept.image, mask_then));
  EXPECT_TRUE(identical(instances[0].mask, instance_then));
  EXPECT_TRUE(identical(show(front_end, 6).image, (show(other, 5), show(other, 6)).image));
}

// A detector takes a room for a person who fills most of the image.
TEST(Cameras, AFalsePersonOverMostOfTheImageIsDoubtedAndNotCarriedOn) {
  const Camera camera = camera_of(320);
  const RoomCamera room(camera);
  Instance person;
  person.box = cv::Rect(10, 5, 300, 230);
  for (const bool motion : {true, false})
    for (const bool says_when : {true, false}) {
      SCOPED_TRACE(testing::Message() << (motion ? "default " : "network_only ") << says_when);
      FrontEnd front_end(motion ? FrontEndSettings() : FrontEndSettings::network_only(), camera);
      for (int i = 0; i < 30; ++i) {
        const bool falsely = i % 10 == 5 || i % 10 == 6;
        Segmentation found = falsely ? result({person}) : result({});
        if (says_when) found.timestamp = i / 30.0;
        front_end.compute_mask(room.frame(i / 30.0, turned(0)), found);
        EXPECT_EQ(front_end.stats().mask_share, 0) << i;
        EXPECT_EQ((front_end.stats().status & kObjectDoubted) != 0, falsely) << i;
      }
    }
}

// Most of the room is known to be static.
TEST(Cameras, AFalsePersonOnWhatIsKnownToBeStaticIsNotBelieved) {
  const Camera camera = camera_of(320);
  const RoomCamera room(camera);
  Instance person;
  person.box = cv::Rect(10, 5, 300, 230);
  FrontEnd front_end({}, camera);
  for (int i = 0; i < 30; ++i) {
    front_end.compute_mask(room.frame(i / 30.0, turned(0)), i < 15 ? result({}) : result({person}));
    EXPECT_LT(front_end.stats().mask_share, 0.05) << i;
  }
  EXPECT_TRUE(front_end.stats().status & kObjectDoubted);
}

TEST(Cameras, SettingsInPixelsHoldForAnyWidth) {
  for (const int width : {160, 320, 640, 1280}) {
    FlatScene scene;
    scene.size = {width, width * 3 / 4};
    const double scale = width / 640.0;
    const cv::Rect box(cv::Point(cvRound(200 * scale), cvRound(100 * scale)),
                       cv::Size(cvRound(120 * scale), cvRound(280 * scale)));
    FrontEnd front_end({}, scene.camera());
    const cv::Mat mask =
        front_end
            .compute_mask(scene.frame(1, {{box, 2, 1}}), result({box_instance(box, scene.size)}))
            .image;
    const cv::Rect grown = mask_bounds(mask);
    EXPECT_NEAR(grown.width / scale, 140, 1.5 / scale) << width;
  }
}

TEST(Cameras, WithoutCompensationTheStatusSaysTheSame) {
  FrontEndSettings settings;
  settings.use_compensation = false;
  const FlatScene scene;
  FrontEnd front_end(settings, scene.camera());
  front_end.compute_mask(scene.frame(1, {}), kNothing);
  EXPECT_TRUE(front_end.stats().status & kNeverSegmented);
  EXPECT_TRUE(std::isinf(front_end.mask().age_s));
  front_end.compute_mask(scene.frame(1.1, {}), result({}));
  EXPECT_FALSE(front_end.stats().status & (kNeverSegmented | kNoSegmentation));
  EXPECT_EQ(front_end.mask().age_s, 0);
  front_end.compute_mask(scene.frame(1.2, {}), kNothing);
  EXPECT_TRUE(front_end.stats().status & kNoSegmentation);
  EXPECT_NEAR(front_end.mask().age_s, 0.1, 1e-9);
  front_end.compute_mask(scene.frame(1.15, {}), kNothing);
  EXPECT_TRUE(front_end.stats().status & kTimestampOrder);
  EXPECT_TRUE(front_end.stats().status & kNeverSegmented) << "history was forgotten";
}

TEST(Cameras, RefusesFramesWhoseTimesNobodySet) {
  for (const bool compensation : {true, false}) {
    FrontEndSettings settings;
    settings.use_compensation = compensation;
    FrontEnd front_end(settings);
    RgbdFrame frame;
    frame.color = cv::Mat(48, 64, CV_8UC3, cv::Scalar::all(90));
    EXPECT_NO_THROW(front_end.compute_mask(frame, Segmentation()));
    EXPECT_THROW(front_end.compute_mask(frame, Segmentation()), Error);
  }
}

}  // namespace
