// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/motion/blur_meter.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "../flat_scene.hpp"
#include "../io/temporary_folder.hpp"
#include "stillpoint/core/random.hpp"

namespace {

using namespace stillpoint;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// 640 x 480 before a wall at 5 m: tiles of 28 pixels that stand askew, so that rims are everywhere.
RgbdFrame tiles(double timestamp, int channels = 3) {
  RgbdFrame frame = large_scene().frame(timestamp, {});
  RandomGenerator random(5);
  cv::Mat coarse(40, 40, CV_8UC1);
  for (int y = 0; y < coarse.rows; ++y)
    for (int x = 0; x < coarse.cols; ++x)
      coarse.ptr(y)[x] = static_cast<uchar>(30 + random.below(180));
  cv::resize(coarse, coarse, {}, 28, 28, cv::INTER_NEAREST);
  cv::warpAffine(coarse, frame.color, cv::getRotationMatrix2D({560, 560}, 35, 1), {880, 720});
  frame.color = frame.color(cv::Rect(240, 240, 640, 480)).clone();
  if (channels == 3) cv::cvtColor(frame.color, frame.color, cv::COLOR_GRAY2BGR);
  return frame;
}

RgbdFrame moved(const RgbdFrame& frame, double timestamp, const cv::Size& way) {
  RgbdFrame out = frame;
  out.timestamp = timestamp;
  out.color = cv::Mat();
  cv::blur(frame.color, out.color, way);
  return out;
}

// Of an image after its sharp original.
double sharpness_of(const RgbdFrame& sharp, const cv::Mat& image) {
  BlurMeter meter;
  meter.measure(sharp, {});
  RgbdFrame frame = sharp;
  frame.timestamp += 0.033;
  frame.color = image;
  return meter.measure(frame, {}).whole.sharpness;
}

Eigen::Isometry3d moved_by(const Eigen::Vector3d& t, double turn = 0) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  T.translation() = t;
  return T;
}

TEST(BlurMeter, PredictsTheMotionDuringTheExposure) {
  const FlatScene scene = large_scene();
  const RgbdFrame first = scene.frame(10, {}), second = scene.frame(10.1, {});
  BlurMeterSettings settings;
  settings.exposure_s = 0.02;
  const auto motion = [&](const Eigen::Isometry3d& T, const RgbdFrame& frame) {
    BlurMeter meter(settings, scene.camera());
    EXPECT_TRUE(std::isnan(meter.measure(first, T).whole.motion_px)) << "no frame before";
    return meter.measure(frame, T).whole.motion_px;
  };
  EXPECT_EQ(motion(moved_by({0, 0, 0}), second), 0);
  // 0.1 m to the side in 0.1 s, before a wall at 5 m: a fifth of it while the shutter is open.
  EXPECT_NEAR(motion(moved_by({0.1, 0, 0}), second), 525 * 0.1 / 5 * 0.2, 1e-6);
  EXPECT_NEAR(motion(moved_by({0, -0.1, 0}), second), 525 * 0.1 / 5 * 0.2, 1e-6);
  // Around the optical axis, each point by its distance from the middle.
  double radius = 0;
  for (int j = 0; j < 6; ++j)
    for (int i = 0; i < 8; ++i) radius += std::hypot(80 * i + 40 - 319.5, 80 * j + 40 - 239.5) / 48;
  EXPECT_NEAR(motion(moved_by({0, 0, 0}, 0.05), second), radius * 2 * std::sin(0.025) * 0.2, 1e-6);
  // Without depth the translation is not seen, the turn is.
  RgbdFrame flat = second;
  flat.depth = cv::Mat();
  EXPECT_NEAR(motion(moved_by({0.1, 0, 0}, 0.05), flat), radius * 2 * std::sin(0.025) * 0.2, 1e-6);
  // Everything behind the camera.
  Eigen::Isometry3d back = Eigen::Isometry3d::Identity();
  back.linear() = Eigen::AngleAxisd(3, Eigen::Vector3d::UnitY()).toRotationMatrix();
  EXPECT_TRUE(std::isnan(motion(back, flat)));
}

TEST(BlurMeter, KnowsNoMotionWithoutPoseCameraOrTime) {
  const FlatScene scene = large_scene();
  const Eigen::Isometry3d T = moved_by({0.1, 0, 0});
  BlurMeter meter({}, scene.camera()), no_camera;
  for (int i = 0; i < 3; ++i) {
    const RgbdFrame frame = scene.frame(0.1 * i, {});
    EXPECT_TRUE(std::isnan(meter.measure(frame, {}).whole.motion_px));
    EXPECT_TRUE(std::isnan(no_camera.measure(frame, T).whole.motion_px));
  }
  EXPECT_TRUE(std::isnan(meter.measure(scene.frame(0.2, {}), T).whole.motion_px)) << "same time";
  EXPECT_TRUE(std::isnan(meter.measure(scene.frame(0.1, {}), T).whole.motion_px)) << "back in time";
  EXPECT_GT(meter.measure(scene.frame(0.2, {}), T).whole.motion_px, 0);
}

TEST(BlurMeter, TakesTheExposureFromSettingsCameraOrFrameRate) {
  Camera camera = FlatScene().camera();
  camera.fps = 20;
  EXPECT_DOUBLE_EQ(BlurMeter({}, camera).exposure_s(), 0.025);
  for (const double bad : {0.0, -30.0, kNaN}) {
    Camera unknown = camera;
    unknown.fps = bad;
    EXPECT_ERROR(BlurMeter({}, unknown), "camera.fps", "more than 0");
  }
  camera.exposure_s = 0.01;
  EXPECT_DOUBLE_EQ(BlurMeter({}, camera).exposure_s(), 0.01);
  BlurMeterSettings settings;
  settings.exposure_s = 0.005;
  EXPECT_DOUBLE_EQ(BlurMeter(settings, camera).exposure_s(), 0.005);
  for (const double bad : {-0.01, 10.0, kNaN}) {
    settings.exposure_s = bad;
    EXPECT_ERROR(BlurMeter(settings, camera), "BlurMeterSettings.exposure_s", "0 to 10 s");
  }
}

TEST(BlurMeter, SharpnessSinksAsTheBlurGrows) {
  for (const int channels : {1, 3}) {
    const RgbdFrame sharp = tiles(1, channels);
    for (const bool down : {false, true}) {
      double last = 1;
      for (const int way : {3, 5, 9, 15}) {
        const RgbdFrame blurred = moved(sharp, 2, down ? cv::Size(1, way) : cv::Size(way, 1));
        const double sharpness = sharpness_of(sharp, blurred.color);
        EXPECT_LT(sharpness, last - 0.05) << way << (down ? " down" : " across");
        last = sharpness;
        if (way >= 5) {
          EXPECT_LT(sharpness, 0.7);
        }
      }
    }
    EXPECT_EQ(sharpness_of(sharp, sharp.color), 1);
  }
}

TEST(BlurMeter, SharpnessIsNoMeasureOfContrastOrNoise) {
  const RgbdFrame sharp = tiles(1);
  cv::Mat dark, noisy = sharp.color.clone();
  sharp.color.convertTo(dark, -1, 0.5, 10);
  EXPECT_GT(sharpness_of(sharp, dark), 0.9);
  // The same noise over sharp and blurred images leaves them apart.
  RandomGenerator random(1);
  cv::Mat blurred = moved(sharp, 2, {9, 1}).color;
  for (cv::Mat* image : {&noisy, &blurred})
    for (int y = 0; y < image->rows; ++y)
      for (int x = 0; x < 3 * image->cols; ++x) {
        uchar& v = image->ptr(y)[x];
        v = cv::saturate_cast<uchar>(v + static_cast<int>(random.below(21)) - 10);
      }
  RgbdFrame first = sharp;
  first.color = noisy;
  EXPECT_LT(sharpness_of(first, blurred), 0.7);
}

TEST(BlurMeter, TheReferenceFollowsTheScene) {
  const RgbdFrame sharp = tiles(0);
  BlurMeter meter;
  meter.measure(sharp, {});
  // Some blurred images do not become the usual thing; half a minute of soft ones does.
  double t = 0;
  for (; t < 0.5; t += 0.033)
    EXPECT_LT(meter.measure(moved(sharp, t + 0.033, {9, 9}), {}).whole.sharpness, 0.6);
  for (; t < 30; t += 0.5) meter.measure(moved(sharp, t + 0.033, {9, 9}), {});
  EXPECT_EQ(meter.measure(moved(sharp, t + 0.033, {9, 9}), {}).whole.sharpness, 1);
}

TEST(BlurMeter, ForgetsTheSceneWhereTimeGoesBack) {
  const RgbdFrame sharp = tiles(10);
  BlurMeter meter;
  meter.measure(sharp, {});
  EXPECT_LT(meter.measure(moved(sharp, 10.033, {9, 9}), {}).whole.sharpness, 0.6);
  EXPECT_EQ(meter.measure(moved(sharp, 5, {9, 9}), {}).whole.sharpness, 1) << "nothing to compare";
}

TEST(BlurMeter, TellsPartsOfTheImageApart) {
  const RgbdFrame sharp = tiles(1);
  RgbdFrame half = sharp;
  half.timestamp = 1.05;
  half.color = sharp.color.clone();
  const cv::Rect left(0, 0, 320, 480), right(320, 0, 320, 480);
  cv::blur(sharp.color(right), half.color(right), {13, 1});
  BlurMeterSettings settings;
  settings.exposure_s = 0.01;
  BlurMeter meter(settings, large_scene().camera());
  meter.measure(sharp, {});
  const ImageBlur& blur = meter.measure(half, moved_by({0.1, 0, 0}));
  EXPECT_GT(blur.in(left).sharpness, 0.9);
  EXPECT_LT(blur.in(right).sharpness, 0.6);
  EXPECT_GT(blur.whole.sharpness, blur.in(right).sharpness);
  EXPECT_LT(blur.whole.sharpness, blur.in(left).sharpness);
  // The motion is the object's own where it is known; what is too small is like the whole.
  EXPECT_NEAR(blur.in(left, 20).motion_px, 4, 1e-6);
  EXPECT_DOUBLE_EQ(blur.in(left).motion_px, blur.whole.motion_px);
  EXPECT_NEAR(blur.whole.motion_px, 2.1, 1e-6);
  for (const cv::Rect& box : {cv::Rect(3, 3, 5, 5), cv::Rect(), cv::Rect(639, 479, 1, 1)})
    EXPECT_EQ(blur.in(box).sharpness, blur.whole.sharpness);
  EXPECT_EQ(ImageBlur().in(left).width_px(), 0);
}

TEST(BlurMeter, SaysNothingWhereNothingIsSeen) {
  BlurMeter meter;
  RgbdFrame frame;
  for (const cv::Size size :
       {cv::Size(1, 1), cv::Size(20, 200), cv::Size(200, 20), cv::Size(45, 60), cv::Size(641, 479)})
    for (const int type : {CV_8UC1, CV_8UC3}) {
      frame.timestamp += 0.1;
      frame.color = cv::Mat(size, type, cv::Scalar::all(128));
      EXPECT_TRUE(std::isnan(meter.measure(frame, {}).whole.sharpness)) << size;
    }
  // And loses nothing by it.
  RgbdFrame sharp = tiles(frame.timestamp + 0.1);
  EXPECT_EQ(meter.measure(sharp, {}).whole.sharpness, 1);
  frame.color = cv::Mat();
  EXPECT_ERROR(meter.measure(frame, {}), "frame.color");
}

TEST(BlurMeter, LeavesTheFramesAlone) {
  const RgbdFrame gray = tiles(0, 1), color = tiles(0.1);
  const cv::Mat gray_before = gray.color.clone(), color_before = color.color.clone();
  // A grey frame is read in place; a color one after it must not be converted into it.
  BlurMeter meter;
  meter.measure(gray, {});
  const double sharpness = meter.measure(color, {}).whole.sharpness;
  EXPECT_TRUE(identical(gray.color, gray_before));
  EXPECT_TRUE(identical(color.color, color_before));
  EXPECT_EQ(sharpness, 1) << "all channels are the same here";
}

TEST(Blur, EdgesOverruleTheMotion) {
  const auto blur = [](double motion, double sharpness) {
    Blur b;
    b.motion_px = motion, b.sharpness = sharpness;
    return b;
  };
  EXPECT_EQ(blur(12, 0.4).width_px(), 12);
  EXPECT_EQ(blur(12, kNaN).width_px(), 12);
  EXPECT_EQ(blur(12, 0.95).width_px(), 0) << "a shorter exposure than was thought";
  EXPECT_EQ(blur(kNaN, 0.4).width_px(), 0);
  EXPECT_EQ(Blur().width_px(), 0);
}

}  // namespace
