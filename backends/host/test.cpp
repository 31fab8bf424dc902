// SPDX-License-Identifier: BSD-2-Clause
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <stillpoint/backends/host.hpp>
#include <stillpoint/front_end.hpp>
#include <stillpoint/motion/constant_velocity.hpp>
#include <thread>

#include "../../tests/flat_scene.hpp"
#include "../../tests/io/temporary_folder.hpp"

/// A host's own keypoint; its number is also in its descriptor.
struct Corner {
  float column, row;
  int number;
};

template <>
struct stillpoint::KeypointTraits<Corner> {
  static float x(const Corner& c) { return c.column; }
  static float y(const Corner& c) { return c.row; }
};

namespace {

using namespace stillpoint;

const FlatScene kScene;
const Figure kPerson{{100, 60, 80, 160}, 2, 7};
const double kStart_s = 1300000000;

// A regular grid over the image, 5 pixels apart: 64 x 48.
struct Features {
  std::vector<Corner> corners;
  cv::Mat descriptors;
  Features() {
    for (int y = 0; y < 240; y += 5)
      for (int x = 0; x < 320; x += 5) {
        const int number = static_cast<int>(corners.size());
        corners.push_back({static_cast<float>(x), static_cast<float>(y), number});
      }
    descriptors.create(static_cast<int>(corners.size()), 8, CV_32SC1);
    for (const Corner& c : corners) descriptors.row(c.number).setTo(c.number);
  }
};

void feed(HostFrontEnd& front_end, double timestamp, const Figure& person = kPerson) {
  front_end.compute_mask(kScene.frame(timestamp, {person}),
                         result({box_instance(person.box, kScene.size)}));
}

HostSettings no_floor() {
  HostSettings settings;
  settings.min_keypoints = settings.min_keypoints_at_start = 0;
  return settings;
}

TEST(Host, HookKeepsWhatIsStaticAndItsDescriptors) {
  HostFrontEnd front_end(kScene.camera(), no_floor());
  feed(front_end, kStart_s);
  Features f;
  const cv::Mat shared = f.descriptors, before = f.descriptors.clone();
  const std::size_t all = f.corners.size();
  ASSERT_TRUE(keep_static(kStart_s, f.corners, f.descriptors));
  ASSERT_EQ(f.descriptors.rows, static_cast<int>(f.corners.size()));
  EXPECT_LT(f.corners.size(), all - 16 * 32 + 40);
  EXPECT_GT(f.corners.size(), all / 2);
  const cv::Mat mask = front_end.mask();
  for (std::size_t i = 0; i < f.corners.size(); ++i) {
    const Corner& c = f.corners[i];
    EXPECT_EQ(mask.at<uchar>(cvRound(c.row), cvRound(c.column)), 0);
    EXPECT_EQ(f.descriptors.at<int>(static_cast<int>(i), 7), c.number);
    if (i > 0) {
      EXPECT_LT(f.corners[i - 1].number, c.number) << "order kept";
    }
  }
  EXPECT_EQ(cv::norm(shared, before, cv::NORM_INF), 0) << "another holder of the old descriptors";
  const HostStats stats = front_end.stats();
  EXPECT_EQ(stats.keypoints, static_cast<int>(all));
  EXPECT_EQ(stats.kept, static_cast<int>(f.corners.size()));
  EXPECT_EQ(stats.frames, 1);
  EXPECT_EQ(stats.filtered, 1);
  EXPECT_EQ(stats.instances, 1);
  EXPECT_GT(stats.mask_share, 0.15);
}

TEST(Host, HookWithoutAMaskChangesNothing) {
  Features f;
  const std::size_t all = f.corners.size();
  const auto expect_untouched = [&](double timestamp) {
    EXPECT_FALSE(keep_static(timestamp, f.corners, f.descriptors));
    EXPECT_EQ(f.corners.size(), all);
    EXPECT_EQ(f.descriptors.rows, static_cast<int>(all));
  };
  expect_untouched(kStart_s);  // no front end at all
  {
    HostFrontEnd front_end(kScene.camera(), no_floor());
    expect_untouched(kStart_s);  // no frame yet
    feed(front_end, kStart_s);
    expect_untouched(kStart_s + 1.0 / 30);
    expect_untouched(std::numeric_limits<double>::quiet_NaN());
    EXPECT_EQ(front_end.stats().filtered, 0);
    cv::Mat none;
    EXPECT_TRUE(keep_static(kStart_s + 1e-6, f.corners, none)) << "rounded; no descriptors";
    EXPECT_TRUE(none.empty());
  }
  Features again;
  EXPECT_FALSE(keep_static(kStart_s, again.corners, again.descriptors)) << "its front end is gone";
  std::vector<Corner> nothing;
  HostFrontEnd front_end(kScene.camera());
  feed(front_end, kStart_s);
  cv::Mat no_rows;
  EXPECT_TRUE(keep_static(kStart_s, nothing, no_rows));
  EXPECT_TRUE(front_end.stats().status & kNoKeypoints);
}

TEST(Host, HookFindsTheMaskOfAnEarlierFrame) {
  HostFrontEnd front_end(kScene.camera(), no_floor());
  const auto at = [](int i) { return kStart_s + i / 30.0; };
  for (int i = 0; i < HostFrontEnd::kMasks + 1; ++i) {
    Figure person = kPerson;
    person.box.x += 4 * i;
    feed(front_end, at(i), person);
  }
  Features first, second;
  EXPECT_FALSE(keep_static(at(0), first.corners, first.descriptors)) << "too long ago";
  ASSERT_TRUE(keep_static(at(1), second.corners, second.descriptors));
  // Then he stood 12 pixels further left than in the newest mask.
  for (const Corner& c : second.corners)
    EXPECT_FALSE(cv::Rect(104, 60, 80, 160).contains(cv::Point(cvRound(c.column), cvRound(c.row))));
}

TEST(Host, FloorIsHighUntilTheHostHasStarted) {
  HostSettings settings;
  settings.min_keypoints_at_start = 600;
  settings.min_keypoints = 100;
  HostFrontEnd front_end(kScene.camera(), settings);
  // 700 keypoints: 500 in the person, 200 far from him.
  const auto kept = [&](double timestamp) {
    feed(front_end, timestamp);
    std::vector<Corner> corners;
    for (int i = 0; i < 700; ++i)
      corners.push_back(i < 500 ? Corner{110.0f + static_cast<float>(i % 25) * 2,
                                         80.0f + static_cast<float>(i / 25) * 5, i}
                                : Corner{250.0f + static_cast<float>(i % 10) * 5,
                                         10.0f + static_cast<float>(i % 200) / 10 * 10, i});
    cv::Mat none;
    EXPECT_TRUE(keep_static(front_end, timestamp, corners, none));
    return static_cast<int>(corners.size());
  };
  EXPECT_EQ(kept(kStart_s), 600);
  EXPECT_TRUE(front_end.stats().status & kKeypointFloor);
  EXPECT_EQ(kept(kStart_s + 0.033), 200) << "600 were enough to start";
  front_end.set_lost(false);
  EXPECT_EQ(kept(kStart_s + 0.067), 200) << "a lost host relocalises with few";
  front_end.set_lost(true);
  front_end.correct_pose(kStart_s + 0.067, cv::Matx44d::eye());
  EXPECT_EQ(kept(kStart_s + 0.1), 200) << "a host with a pose has started";
  front_end.set_lost(true);
  EXPECT_EQ(kept(kStart_s + 0.133), 600) << "a host that starts anew needs them again";
  EXPECT_EQ(front_end.features_for(200), 700) << "200 of 700 are static";
  EXPECT_EQ(front_end.features_for(500, 1000), 1000);
}

TEST(Host, PosesReachTheMotionCheck) {
  // Nobody is segmented; somebody walks through space that was seen to be free. Nothing in the
  // images tells the camera's motion, so only the host's poses can.
  HostFrontEnd host(kScene.camera(), no_floor()), not_told(kScene.camera(), no_floor());
  FrontEnd front_end(FrontEndSettings(), kScene.camera());
  ConstantVelocity velocity;
  double last_s = 0;
  int found = 0;
  for (int i = 0; i < 12; ++i) {
    const double t = kStart_s + i / 30.0;
    Figure person = kPerson;
    person.box.x += 8 * i;
    RgbdFrame frame = kScene.frame(t, {person});
    frame.color.setTo(cv::Scalar::all(90));
    host.compute_mask(frame, Segmentation());
    not_told.compute_mask(frame, Segmentation());
    const cv::Mat expected =
        front_end.compute_mask(frame, Segmentation(), velocity.predict(last_s, t)).image;
    EXPECT_EQ(cv::norm(host.mask(), expected, cv::NORM_INF), 0) << "frame " << i;
    EXPECT_EQ(not_told.stats().instances, 0);
    found += host.stats().instances;
    last_s = t;
    host.correct_pose(t, cv::Matx44d::eye());
    velocity.add(t, Eigen::Isometry3d::Identity());
    front_end.correct_pose(Eigen::Isometry3d::Identity());
  }
  EXPECT_GT(found, 3);
}

TEST(Host, EachThreadsHookFindsItsOwnCamera) {
  const auto camera_of = [](int x) {
    HostFrontEnd front_end(kScene.camera(), no_floor());
    Figure person = kPerson;
    person.box.x = x;
    for (int i = 0; i < 20; ++i) {
      const double t = kStart_s + i / 30.0;  // the same timestamps in both
      feed(front_end, t, person);
      Features f;
      ASSERT_TRUE(keep_static(t, f.corners, f.descriptors));
      const cv::Mat mask = front_end.mask();
      for (const Corner& c : f.corners)
        ASSERT_EQ(mask.at<uchar>(cvRound(c.row), cvRound(c.column)), 0);
    }
    EXPECT_EQ(front_end.stats().filtered, 20);
  };
  std::thread other([&] { camera_of(20); });
  camera_of(200);
  other.join();
}

TEST(Host, SlipsAreErrorsThatSayWhat) {
  HostSettings settings;
  settings.min_keypoints = -1;
  EXPECT_ERROR(HostFrontEnd(Camera(), settings), "min_keypoints", "found -1");
  settings = HostSettings();
  settings.preset = "motion";
  EXPECT_ERROR(HostFrontEnd(Camera(), settings), "default, network_only or paper",
               "found \"motion\"");
  HostFrontEnd front_end(kScene.camera());
  RgbdFrame frame = kScene.frame(kStart_s, {});
  frame.depth = frame.depth.colRange(0, 100);
  EXPECT_ERROR(front_end.compute_mask(frame, Segmentation()), "frame.depth", "found 100x240");
  EXPECT_ERROR(front_end.correct_pose(kStart_s, cv::Matx44d::zeros()), "rotation", "set_lost");
  cv::Matx44d nan = cv::Matx44d::eye();
  nan(0, 3) = std::nan("");
  EXPECT_ERROR(front_end.correct_pose(kStart_s, nan), "rotation");
  EXPECT_ERROR(front_end.correct_pose(std::nan(""), cv::Matx44d::eye()), "timestamp", "seconds",
               "found nan");
  feed(front_end, kStart_s);
  Features f;
  cv::Mat fewer = f.descriptors.rowRange(0, 10);
  EXPECT_ERROR(keep_static(kStart_s, f.corners, fewer), "expected one row per keypoint, 3072",
               "found 10");
}

// What the library's own front end makes of the same settings.
TEST(Host, SettingsReachTheFrontEnd) {
  Segmentation cat = result({box_instance(kPerson.box, kScene.size)});
  cat.instances[0].class_name = "cat";
  const auto mask_of = [&](const HostSettings& settings) {
    HostFrontEnd host(kScene.camera(), settings);
    host.compute_mask(kScene.frame(kStart_s, {kPerson}), cat);
    return host.mask();
  };
  HostSettings settings;
  EXPECT_EQ(cv::countNonZero(mask_of(settings)), 0) << "no person";
  settings.dynamic_classes = {"cat"};
  const cv::Mat wide = mask_of(settings);
  settings.dilation_px = 2;
  const cv::Mat narrow = mask_of(settings);
  EXPECT_GT(cv::countNonZero(narrow), kPerson.box.area() / 2);
  EXPECT_EQ(cv::boundingRect(wide).width, cv::boundingRect(narrow).width + 2 * 4);  // 320 wide

  // Exposure and sensor reach their owners, who refuse what makes no sense.
  settings.exposure_s = -1;
  EXPECT_ERROR(HostFrontEnd(Camera(), settings), "exposure_s", "found -1");
  settings.exposure_s = 0.01;
  settings.sensor.sigmas = -1;
  EXPECT_ERROR(HostFrontEnd(Camera(), settings), "SensorModel.sigmas", "found -1");
}

TEST(Host, PresetsAreThoseOfTheFrontEnd) {
  // Nobody is segmented: only the motion check finds who walks.
  for (const char* preset : {"default", "network_only", "paper"}) {
    HostSettings settings;
    settings.preset = preset;
    HostFrontEnd host(kScene.camera(), settings);
    int found = 0;
    for (int i = 0; i < 12; ++i) {
      Figure person = kPerson;
      person.box.x += 8 * i;
      host.compute_mask(kScene.frame(kStart_s + i / 30.0, {person}), Segmentation());
      host.correct_pose(kStart_s + i / 30.0, cv::Matx44d::eye());
      found += host.stats().instances;
    }
    EXPECT_EQ(found > 3, preset == std::string("default")) << preset;
  }
}

TEST(Host, MonoAndPaperRun) {
  HostSettings settings = no_floor();
  settings.preset = "paper";
  HostFrontEnd front_end(Camera(), settings);
  FlatScene scene;
  scene.with_depth = false, scene.color_channels = 1;
  front_end.compute_mask(scene.frame(kStart_s, {kPerson}),
                         result({box_instance(kPerson.box, scene.size)}));
  EXPECT_TRUE(front_end.stats().status & kNoDepth);
  Features f;
  EXPECT_TRUE(keep_static(kStart_s, f.corners, f.descriptors));
  EXPECT_LT(f.corners.size(), 3072u);
}

}  // namespace
