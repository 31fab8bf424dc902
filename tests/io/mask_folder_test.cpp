// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/io/mask_folder.hpp"

#include <gtest/gtest.h>

#include "temporary_folder.hpp"

namespace {

using stillpoint::Instance;
using stillpoint::instances_from_labels;

const cv::Size kSize(40, 30);

cv::Mat background() { return cv::Mat::zeros(kSize, CV_8UC1); }

int pixels(const Instance& i) { return cv::countNonZero(i.mask); }

TEST(MaskFolder, OneInstancePerLabel) {
  cv::Mat labels = background();
  labels(cv::Rect(2, 3, 4, 5)) = 7;
  labels(cv::Rect(20, 10, 3, 3)) = 2;
  labels(cv::Rect(30, 20, 2, 2)) = 2;  // one person, in two pieces
  const auto instances = instances_from_labels(labels, "cat");
  ASSERT_EQ(instances.size(), 2u);
  EXPECT_EQ(instances[0].box, cv::Rect(20, 10, 12, 12));
  EXPECT_EQ(pixels(instances[0]), 13);
  EXPECT_EQ(instances[0].class_name, "cat");
  EXPECT_EQ(instances[1].box, cv::Rect(2, 3, 4, 5));
  EXPECT_EQ(instances[1].mask.at<uchar>(0, 0), 255);
  EXPECT_EQ(pixels(instances[1]), 20);
}

TEST(MaskFolder, ZeroAnd255IsSplitIntoParts) {
  cv::Mat labels = background();
  labels(cv::Rect(20, 2, 10, 10)) = 255;
  labels(cv::Rect(2, 2, 8, 8)) = 255;
  labels.at<uchar>(10, 10) = 255;  // touches by its corner: the same part
  labels(cv::Rect(35, 25, 2, 2)) = 255;
  auto instances = instances_from_labels(labels, "person", 5);
  ASSERT_EQ(instances.size(), 2u) << "the speck is dropped";
  EXPECT_EQ(instances[0].box, cv::Rect(2, 2, 9, 9));
  EXPECT_EQ(pixels(instances[0]), 65);
  EXPECT_EQ(instances[1].box, cv::Rect(20, 2, 10, 10));
  EXPECT_EQ(instances_from_labels(labels, "person", 4).size(), 3u);
}

TEST(MaskFolder, NothingEverywhereAndTooManyParts) {
  EXPECT_TRUE(instances_from_labels(background()).empty());
  const auto all = instances_from_labels(cv::Mat(kSize, CV_8UC1, cv::Scalar(255)));
  ASSERT_EQ(all.size(), 1u);
  EXPECT_EQ(all[0].box, cv::Rect(cv::Point(), kSize));
  cv::Mat dots = background();
  for (int y = 0; y < kSize.height; y += 2)
    for (int x = 0; x < kSize.width; x += 2) dots.at<uchar>(y, x) = 255;
  dots.at<uchar>(29, 38) = dots.at<uchar>(28, 39) = 255;  // a larger one, last
  const auto many = instances_from_labels(dots, "person", 1);
  ASSERT_EQ(many.size(), 255u);
  EXPECT_EQ(pixels(many.back()), 3) << "the largest ones are kept";
  EXPECT_ERROR(instances_from_labels(cv::Mat::zeros(kSize, CV_16UC1)), "CV_8UC1", "CV_16UC1");
}

TEST(MaskFolder, DoesNotDependOnThreads) {
  cv::Mat dots = background();
  unsigned state = 5;
  for (int y = 0; y < kSize.height; ++y)
    for (int x = 0; x < kSize.width; ++x)
      if ((state = state * 1664525u + 1013904223u) >> 30 == 0) dots.at<uchar>(y, x) = 255;
  const int threads = cv::getNumThreads();
  cv::setNumThreads(1);
  const auto one = instances_from_labels(dots, "person", 1);
  cv::setNumThreads(4);
  const auto four = instances_from_labels(dots, "person", 1);
  cv::setNumThreads(threads);
  ASSERT_EQ(one.size(), four.size());
  for (std::size_t i = 0; i < one.size(); ++i) EXPECT_EQ(one[i].box, four[i].box);
}

TEST(MaskFolder, WritesWhatItReads) {
  TemporaryFolder folder;
  cv::Mat labels = background();
  labels(cv::Rect(2, 3, 4, 5)) = 1;
  labels(cv::Rect(20, 10, 8, 3)) = 2;
  stillpoint::write_labels(folder.path(), "12.500000", instances_from_labels(labels), kSize);
  const auto path = folder / "12.500000.png";
  EXPECT_EQ(cv::countNonZero(stillpoint::read_labels(path, kSize) != labels), 0);
  EXPECT_EQ(cv::countNonZero(stillpoint::read_mask(path, kSize) != (labels > 0)), 0);
  stillpoint::write_labels(folder.path(), "13", {}, kSize);
  EXPECT_EQ(cv::countNonZero(stillpoint::read_labels(folder / "13.png", kSize)), 0);
}

TEST(MaskFolder, PaintsBoxesAndOverlaps) {
  Instance box, mask;
  box.box = cv::Rect(0, 0, 10, 10);
  mask.box = cv::Rect(5, 5, 10, 10);
  mask.mask = cv::Mat(10, 10, CV_8UC1, cv::Scalar(255));
  const cv::Mat labels = stillpoint::labels_from_instances({box, mask}, kSize);
  EXPECT_EQ(labels.at<uchar>(2, 2), 1);
  EXPECT_EQ(labels.at<uchar>(7, 7), 2) << "the later one lies on top";
  EXPECT_EQ(labels.at<uchar>(20, 20), 0);
  EXPECT_ERROR(stillpoint::labels_from_instances({mask}, cv::Size(12, 12)), "inside 12x12");
  EXPECT_ERROR(stillpoint::labels_from_instances(std::vector<Instance>(255, box), kSize), "254");
}

TEST(MaskFolder, RefusesOtherPictures) {
  TemporaryFolder folder;
  const auto read = [&] { stillpoint::read_labels(folder / "m.png", kSize); };
  EXPECT_ERROR(read(), "m.png", "no such file");
  stillpoint::write_image(folder / "m.png", cv::Mat::zeros(kSize, CV_8UC3));
  EXPECT_ERROR(read(), "m.png", "CV_8UC1", "CV_8UC3", "gray");
  stillpoint::write_image(folder / "m.png", cv::Mat::zeros(kSize, CV_8UC4));
  EXPECT_ERROR(read(), "CV_8UC4");
  stillpoint::write_image(folder / "m.png", cv::Mat::zeros(kSize, CV_16UC1));
  EXPECT_ERROR(read(), "CV_16UC1", "8 bits");
  stillpoint::write_image(folder / "m.png", cv::Mat::zeros(30, 20, CV_8UC1));
  EXPECT_ERROR(read(), "40x30", "20x30", "resize");
  const std::string bytes = stillpoint::read_file(folder / "m.png", "mask");
  folder.write("m.png", bytes.substr(0, bytes.size() / 2));
  EXPECT_ERROR(read(), "m.png", "truncated");
}

TEST(MaskFolder, RefusesA0And255MaskWhoseEdgesAreBlurred) {
  TemporaryFolder folder;
  cv::Mat mask = cv::Mat::zeros(kSize, CV_8UC1);
  mask(cv::Rect(10, 10, 12, 12)) = 255;
  EXPECT_EQ(stillpoint::instances_from_labels(mask).size(), 1u);
  cv::Mat resized;
  cv::resize(mask, resized, kSize * 2, 0, 0, cv::INTER_LINEAR);
  EXPECT_ERROR(stillpoint::instances_from_labels(resized), "found 255 beside", "interpolation");
  std::vector<uchar> jpeg;
  cv::imencode(".jpg", mask, jpeg);
  stillpoint::write_image(folder / "m.png", cv::imdecode(jpeg, cv::IMREAD_UNCHANGED));
  EXPECT_ERROR(stillpoint::read_labels(folder / "m.png", kSize), "m.png", "JPEG");
  mask(cv::Rect(12, 12, 3, 3)) = 7;  // an instance, and pixels to ignore
  EXPECT_ERROR(stillpoint::instances_from_labels(mask), "beside 1 other", "set it to 0");
}

}  // namespace
