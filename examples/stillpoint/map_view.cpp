// SPDX-License-Identifier: BSD-2-Clause
#include "map_view.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

namespace stillpoint::cli {

cv::Mat draw_map(const std::vector<ColoredPoint>& points, MapViewpoint viewpoint, cv::Size size) {
  const bool above = viewpoint == MapViewpoint::kAbove;
  const double turn = above ? 90 : 22;
  const Eigen::Vector3d place =
      above ? Eigen::Vector3d(0, -4.8, 2.6) : Eigen::Vector3d(0, -1.1, -1.6);
  const Eigen::Matrix3d R_view_world =
      Eigen::AngleAxisd(turn * EIGEN_PI / 180, Eigen::Vector3d::UnitX()).toRotationMatrix();
  const double focal = 0.8 * size.width;
  // A voxel of 2 cm, a little more so that surfaces close.
  constexpr double kDot_m = 0.026;

  cv::Mat picture(size, CV_8UC3, cv::Scalar(34, 30, 28));
  cv::Mat nearest(size, CV_32FC1, cv::Scalar(std::numeric_limits<float>::infinity()));
  for (const ColoredPoint& point : points) {
    if (above && point.position.y() < -0.6f) continue;
    const Eigen::Vector3d p = R_view_world * (point.position.cast<double>() - place);
    if (p.z() < 0.3) continue;
    const double u = focal * p.x() / p.z() + size.width / 2.0;
    const double v = focal * p.y() / p.z() + size.height / 2.0;
    if (!(std::abs(u) < 1e5 && std::abs(v) < 1e5)) continue;
    const double half = std::min(6.0, 0.5 * focal * kDot_m / p.z());
    const int x0 = std::max(0, static_cast<int>(std::lround(u - half)));
    const int x1 = std::min(size.width - 1, static_cast<int>(std::lround(u + half)));
    const int y0 = std::max(0, static_cast<int>(std::lround(v - half)));
    const int y1 = std::min(size.height - 1, static_cast<int>(std::lround(v + half)));
    const float z = static_cast<float>(p.z());
    for (int y = y0; y <= y1; ++y)
      for (int x = x0; x <= x1; ++x) {
        if (z >= nearest.at<float>(y, x)) continue;
        nearest.at<float>(y, x) = z;
        picture.at<cv::Vec3b>(y, x) = point.bgr;
      }
  }
  return picture;
}

}  // namespace stillpoint::cli
