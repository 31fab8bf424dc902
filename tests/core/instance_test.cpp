// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/core/instance.hpp"

#include <gtest/gtest.h>

#include "../flat_scene.hpp"
#include "../io/temporary_folder.hpp"

namespace {

using stillpoint::check_segmentation;
using stillpoint::Instance;
using stillpoint::Segmentation;

const cv::Size kSize(40, 30);

TEST(Instance, BoundsAreTheSmallestBox) {
  cv::Mat mask = cv::Mat::zeros(kSize, CV_8UC1);
  EXPECT_TRUE(stillpoint::mask_bounds(mask).empty());
  EXPECT_TRUE(stillpoint::mask_bounds(cv::Mat()).empty());
  mask.at<uchar>(7, 39) = 1;
  EXPECT_EQ(stillpoint::mask_bounds(mask), cv::Rect(39, 7, 1, 1));
  mask.at<uchar>(29, 4) = 255;
  EXPECT_EQ(stillpoint::mask_bounds(mask), cv::Rect(4, 7, 36, 23));
}

TEST(Instance, IsMadeFromAMaskOfThePicture) {
  cv::Mat mask = cv::Mat::zeros(kSize, CV_8UC1);
  mask(cv::Rect(5, 6, 7, 8)).setTo(3);
  mask.at<uchar>(6, 5) = 0;
  const Instance instance = stillpoint::instance_from_mask(mask, "chair", 0.5f);
  EXPECT_EQ(instance.box, cv::Rect(5, 6, 7, 8));
  EXPECT_EQ(instance.mask.size(), instance.box.size());
  EXPECT_EQ(instance.mask.at<uchar>(0, 0), 0);
  EXPECT_EQ(instance.mask.at<uchar>(1, 1), 255);
  EXPECT_EQ(instance.class_name, "chair");
  EXPECT_EQ(instance.score, 0.5f);
  EXPECT_TRUE(stillpoint::instance_from_mask(cv::Mat::zeros(kSize, CV_8UC1)).box.empty());
  EXPECT_ERROR(stillpoint::instance_from_mask(cv::Mat::zeros(kSize, CV_8UC3)), "CV_8UC1",
               "CV_8UC3");
}

TEST(Instance, FitsThePicture) {
  Segmentation segmentation = result({box_instance({0, 0, 40, 30}, kSize)});
  segmentation.instances.push_back(box_instance({3, 4, 5, 6}, kSize));
  EXPECT_NO_THROW(check_segmentation(segmentation, kSize));
  segmentation.instances[1].mask = cv::Mat();
  EXPECT_NO_THROW(check_segmentation(segmentation, kSize)) << "a bare box";

  for (const cv::Rect& box : {cv::Rect(-1, 0, 5, 5), cv::Rect(36, 0, 5, 5), cv::Rect(0, 26, 5, 5),
                              cv::Rect(3, 3, 0, 5), cv::Rect(3, 3, -2, -2), cv::Rect()}) {
    segmentation.instances[1].box = box;
    const std::string found = "found x " + std::to_string(box.x);
    EXPECT_ERROR(check_segmentation(segmentation, kSize), "segmentation.instances[1].box",
                 "inside 40x30", found.c_str());
  }
}

TEST(Instance, RefusesOtherMasks) {
  Segmentation segmentation = result({box_instance({3, 4, 5, 6}, kSize)});
  segmentation.instances[0].mask = cv::Mat::zeros(kSize, CV_8UC1);
  EXPECT_ERROR(check_segmentation(segmentation, kSize), "instances[0].mask", "box's size 5x6",
               "found CV_8UC1 40x30");
  segmentation.instances[0].mask = cv::Mat::zeros(6, 5, CV_8UC3);
  EXPECT_ERROR(check_segmentation(segmentation, kSize), "instances[0].mask", "CV_8UC1",
               "found CV_8UC3");
  segmentation.instances[0].mask = cv::Mat::zeros(6, 5, CV_32FC1);
  EXPECT_ERROR(check_segmentation(segmentation, kSize), "found CV_32FC1");
}

}  // namespace
