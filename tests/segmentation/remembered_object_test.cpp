// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/segmentation/remembered_object.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "stillpoint/core/random.hpp"

namespace stillpoint {
namespace {

// Each pixel shows the pixel of the mask that falls on its centre.
TEST(RememberedObject, DrawsTurnedAndScaledMasksPixelByPixel) {
  const cv::Size size(320, 240);
  RandomGenerator random(3);
  Instance instance;
  instance.box = cv::Rect(90, 60, 150, 110);
  instance.mask = cv::Mat(instance.box.size(), CV_8UC1);
  for (int y = 0; y < instance.mask.rows; ++y)
    for (int x = 0; x < instance.mask.cols; ++x)
      instance.mask.at<uchar>(y, x) = random.below(2) == 0 ? 0 : 255;
  RememberedObject object;
  RgbdFrame frame;
  frame.color = cv::Mat(size, CV_8UC1, cv::Scalar(90));
  FrameContext context;
  context.begin(frame, Camera());
  object.observe(context, DepthView(), instance, nullptr);

  for (const double degrees : {0.0, 0.3, -1.2, 40.0, -170.0})
    for (const double scale : {1.0, 1.004, 0.99, 1.7, 0.4})
      for (const double shift : {0.0, -70.3, 123.4}) {
        const double angle = degrees * 3.14159265358979 / 180;
        Eigen::Matrix3d to_image = Eigen::Matrix3d::Identity();
        to_image.topLeftCorner<2, 2>() = scale * Eigen::Rotation2Dd(angle).toRotationMatrix();
        const Eigen::Vector2d center(165, 115);
        to_image.block<2, 1>(0, 2) =
            center - to_image.topLeftCorner<2, 2>() * center + Eigen::Vector2d(shift, 0.31 * shift);
        RememberedObject::Place place;
        place.affine = to_image.topRows<2>();
        place.z = 0;
        object.set_place(place);
        const cv::Rect area(11, 7, 297, 220);  // some of it beyond
        cv::Mat drawn = cv::Mat::zeros(area.size(), CV_8UC1);
        object.draw_predicted(area, drawn);

        const Eigen::Matrix3d to_mask = to_image.inverse();
        int wrong = 0, set = 0;
        for (int y = 0; y < area.height; ++y)
          for (int x = 0; x < area.width; ++x) {
            const Eigen::Vector3d p =
                to_mask * Eigen::Vector3d(area.x + x, area.y + y, 1) +
                Eigen::Vector3d(0.5 - instance.box.x, 0.5 - instance.box.y, 0);
            const double u = std::floor(p.x()), v = std::floor(p.y());
            // Rounding may decide at a pixel's border.
            if (std::min({p.x() - u, u + 1 - p.x(), p.y() - v, v + 1 - p.y()}) < 1e-5) continue;
            const bool inside =
                u >= 0 && v >= 0 && u < instance.box.width && v < instance.box.height;
            const int expected =
                inside ? instance.mask.at<uchar>(static_cast<int>(v), static_cast<int>(u)) : 0;
            wrong += drawn.at<uchar>(y, x) != expected;
            set += expected != 0;
          }
        EXPECT_EQ(wrong, 0) << degrees << " degrees, scale " << scale << ", shift " << shift;
        EXPECT_GT(set, 100) << degrees << " degrees, scale " << scale << ", shift " << shift;
      }
}

// What is left of somebody behind somebody else: 5 pixels in each row of a large box.
TEST(RememberedObject, LooksMoreCloselyAtThinMasks) {
  Instance instance;
  instance.box = cv::Rect(60, 20, 200, 200);
  instance.mask = cv::Mat::zeros(instance.box.size(), CV_8UC1);
  for (int y = 0; y < 200; ++y) instance.mask.row(y).colRange(y / 2, y / 2 + 5).setTo(255);
  RgbdFrame frame;
  frame.color = cv::Mat(240, 320, CV_8UC1, cv::Scalar(90));
  FrameContext context;
  context.begin(frame, Camera());
  for (const char* name : {"person", ""}) {
    instance.class_name = name;
    RememberedObject object;
    object.observe(context, DepthView(), instance, nullptr);
    EXPECT_GE(object.inside().size(), 12u) << name;
    EXPECT_NEAR(object.center().x, 60 + 52, 5) << name;
    EXPECT_NEAR(object.center().y, 20 + 100, 5) << name;
  }
}

}  // namespace
}  // namespace stillpoint
