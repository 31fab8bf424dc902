// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/depth/mask_dilation.hpp"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "stillpoint/core/random.hpp"

namespace stillpoint {
namespace {

// A mask of a few discs and single pixels; any value but 0 is set.
cv::Mat random_mask(RandomGenerator& random, const cv::Size& size) {
  cv::Mat mask = cv::Mat::zeros(size, CV_8UC1);
  const auto below = [&](int n) {
    return static_cast<int>(random.below(static_cast<std::size_t>(n)));
  };
  for (int k = 0; k < 4; ++k)
    cv::circle(mask, {below(size.width), below(size.height)}, below(12), 1 + below(255),
               cv::FILLED);
  return mask;
}

// OpenCV's dilation, as 255 or 0.
cv::Mat dilated(const cv::Mat& mask, int px) {
  cv::Mat out;
  cv::dilate(mask, out, cv::Mat(), {-1, -1}, px, cv::BORDER_CONSTANT | cv::BORDER_ISOLATED);
  return out != 0;
}

TEST(MaskDilation, IsThatOfOpenCv) {
  RandomGenerator random(1);
  MaskDilation dilation;
  for (const cv::Size& size :
       {cv::Size(640, 48), cv::Size(133, 70), cv::Size(64, 64), cv::Size(5, 90)})
    for (const int px : {0, 1, 2, 5, 7, 20, 63, 64, 150}) {
      const cv::Mat mask = random_mask(random, size);
      dilation.begin(size);
      dilation.add(mask, {{}, size}, px);
      cv::Mat found(size, CV_8UC1, cv::Scalar(7));
      const int count = dilation.write(found);
      const cv::Mat expected = dilated(mask, px);
      EXPECT_EQ(cv::norm(found, expected, cv::NORM_INF), 0) << size << " " << px;
      EXPECT_EQ(count, cv::countNonZero(expected)) << size << " " << px;
    }
}

TEST(MaskDilation, UnitesBoxesOfTheirOwnReach) {
  const cv::Size size(200, 100);
  const struct {
    cv::Rect box;
    int px;
  } parts[] = {
      {{3, 5, 40, 30}, 6}, {{60, 0, 9, 100}, 70}, {{150, 60, 50, 40}, 1}, {{199, 0, 1, 1}, 3}};
  RandomGenerator random(2);
  MaskDilation dilation;
  dilation.begin(size);
  cv::Mat expected = cv::Mat::zeros(size, CV_8UC1), found(size, CV_8UC1);
  for (const auto& part : parts) {
    const cv::Mat mask = random_mask(random, part.box.size());
    dilation.add(mask, part.box, part.px);
    cv::Mat whole = cv::Mat::zeros(size, CV_8UC1);
    mask.copyTo(whole(part.box));
    expected |= dilated(whole, part.px);
  }
  EXPECT_EQ(dilation.write(found), cv::countNonZero(expected));
  EXPECT_EQ(cv::norm(found, expected, cv::NORM_INF), 0);
}

TEST(MaskDilation, OfNothingIsNothing) {
  MaskDilation dilation;
  dilation.begin({30, 20});
  dilation.add(cv::Mat(), {}, 5);
  cv::Mat found(20, 30, CV_8UC1, cv::Scalar(255));
  EXPECT_EQ(dilation.write(found), 0);
  EXPECT_EQ(cv::countNonZero(found), 0);
}

}  // namespace
}  // namespace stillpoint
