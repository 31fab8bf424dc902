// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/segmentation/template_patch.hpp"

#include <gtest/gtest.h>

#include "../flat_scene.hpp"
#include "stillpoint/core/frame_context.hpp"

namespace {

using stillpoint::TemplatePatch;

const FlatScene scene;

cv::Mat gray_of(const stillpoint::RgbdFrame& frame) {
  stillpoint::FrameContext context;
  context.begin(frame, {});
  return context.gray().clone();
}

TemplatePatch patch_of(const cv::Mat& gray, const stillpoint::Instance& instance) {
  TemplatePatch patch;
  patch.sample(gray, instance);
  return patch;
}

TEST(TemplatePatch, FindsWhereTheObjectWent) {
  for (const int width : {12, 40, 100})
    for (const cv::Point shift : {cv::Point(0, 0), cv::Point(7, -3), cv::Point(-16, 12)}) {
      const Figure before{{100, 60, width, 2 * width}, 2, 1};
      Figure after = before;
      after.box += shift;
      const TemplatePatch patch =
          patch_of(gray_of(scene.frame(0, {before})), box_instance(before.box, scene.size));
      cv::Point corner = before.box.tl();
      EXPECT_NEAR(patch.locate(gray_of(scene.frame(1, {after})), 16, corner), 1, 1e-9);
      EXPECT_EQ(corner, after.box.tl()) << "width " << width;
    }
}

TEST(TemplatePatch, ScoresLowWhereTheObjectIsGone) {
  const Figure figure{{100, 60, 40, 80}, 2, 1};
  const TemplatePatch patch =
      patch_of(gray_of(scene.frame(0, {figure})), box_instance(figure.box, scene.size));
  cv::Point corner = figure.box.tl();
  EXPECT_LT(patch.locate(gray_of(scene.frame(1, {})), 16, corner), 0.5);
}

TEST(TemplatePatch, LooksAtAllOfABoxOfAnySize) {
  for (int side = 10; side <= 130; ++side) {
    const cv::Rect box(20, 10, side, side);
    cv::Mat gray(160, 160, CV_8UC1, cv::Scalar(0));
    cv::RNG random(side);
    random.fill(gray(box), cv::RNG::UNIFORM, 0, 256);
    const TemplatePatch patch = patch_of(gray, box_instance(box, gray.size()));
    cv::Mat changed = gray.clone();
    const int last = std::max(2, side / 8);
    for (const cv::Rect& end : {cv::Rect(box.x, box.y + side - last, side, last),
                                cv::Rect(box.x + side - last, box.y, last, side)}) {
      gray.copyTo(changed);
      changed(end).setTo(0);
      cv::Point corner = box.tl();
      EXPECT_LT(patch.locate(changed, 0, corner), 0.999) << side << " at " << end;
    }
  }
}

TEST(TemplatePatch, LooksAtTheMaskOnly) {
  // The wall around the object changes; only an upright half of the box is the object.
  const Figure figure{{100, 60, 20, 80}, 2, 1};
  stillpoint::Instance instance = box_instance({100, 60, 40, 80}, scene.size);
  instance.mask(cv::Rect(20, 0, 20, 80)).setTo(0);
  const TemplatePatch patch = patch_of(gray_of(scene.frame(0, {figure})), instance);
  cv::Point corner = instance.box.tl();
  EXPECT_NEAR(patch.locate(gray_of(scene.frame(1, {figure}, 33)), 8, corner), 1, 1e-9);
  EXPECT_EQ(corner, instance.box.tl());
}

TEST(TemplatePatch, TakesGreyImages) {
  FlatScene grey;
  grey.color_channels = 1;
  const Figure before{{100, 60, 40, 80}, 2, 1}, after{{105, 64, 40, 80}, 2, 1};
  const TemplatePatch patch =
      patch_of(gray_of(grey.frame(0, {before})), box_instance(before.box, grey.size));
  cv::Point corner = before.box.tl();
  EXPECT_NEAR(patch.locate(gray_of(grey.frame(1, {after})), 8, corner), 1, 1e-9);
  EXPECT_EQ(corner, after.box.tl());
}

TEST(TemplatePatch, OfEqualScoresTakesTheNearest) {
  // Tiles look the same every 8 pixels.
  cv::Mat tiles(scene.size, CV_8UC1);
  for (int y = 0; y < tiles.rows; ++y)
    for (int x = 0; x < tiles.cols; ++x)
      tiles.at<uchar>(y, x) = static_cast<uchar>(((x % 8) * 37 + (y % 8) * 101) * 29 % 251);
  const TemplatePatch patch = patch_of(tiles, box_instance({100, 60, 24, 48}, scene.size));
  for (const cv::Point start : {cv::Point(100, 60), cv::Point(102, 61), cv::Point(97, 57)}) {
    cv::Point corner = start;
    EXPECT_NEAR(patch.locate(tiles, 24, corner), 1, 1e-9);
    EXPECT_EQ(corner, cv::Point(100, 60)) << "from " << start.x << " " << start.y;
  }
}

TEST(TemplatePatch, SaysNothingWithoutTextureOrOutsideTheImage) {
  const cv::Mat flat(scene.size, CV_8UC1, cv::Scalar(90));
  const stillpoint::Instance instance = box_instance({100, 60, 40, 80}, scene.size);
  cv::Point corner = instance.box.tl();
  EXPECT_EQ(patch_of(flat, instance).locate(flat, 8, corner), -1);

  const cv::Mat color = gray_of(scene.frame(0, {}));
  corner = {5000, -5000};
  EXPECT_EQ(patch_of(color, instance).locate(color, 8, corner), -1);
  EXPECT_EQ(corner, cv::Point(5000, -5000));
  // Half of it in the image is enough.
  corner = {-20, 60};
  EXPECT_GT(patch_of(color, instance).locate(color, 0, corner), -1);
}

TEST(TemplatePatch, IsEmptyForAnEmptyMask) {
  stillpoint::Instance instance = box_instance({100, 60, 40, 80}, scene.size);
  EXPECT_FALSE(patch_of(gray_of(scene.frame(0, {})), instance).empty());
  instance.mask.setTo(0);
  EXPECT_TRUE(patch_of(gray_of(scene.frame(0, {})), instance).empty());
}

TEST(TemplatePatch, TakesBareBoxesAndSinglePixels) {
  const cv::Mat color = gray_of(scene.frame(0, {}));
  stillpoint::Instance instance = box_instance({100, 60, 40, 80}, scene.size);
  instance.mask = cv::Mat();
  cv::Point corner(103, 58);
  EXPECT_NEAR(patch_of(color, instance).locate(color, 8, corner), 1, 1e-9);
  EXPECT_EQ(corner, cv::Point(100, 60));

  corner = {319, 239};
  EXPECT_EQ(patch_of(color, box_instance({319, 239, 1, 1}, scene.size)).locate(color, 8, corner),
            -1);
}

}  // namespace
