// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstddef>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "stillpoint/core/frame.hpp"

namespace stillpoint::rgbd_slam {

/// Makes the grey image of a frame in `gray`, whose memory is used again: a copy, also of a grey
/// frame. Were that one shared, the next color frame would be converted into the caller's image,
/// and what he draws into it between two calls would be tracked.
inline void copy_gray(const RgbdFrame& frame, cv::Mat& gray) {
  if (frame.given_gray().empty())
    cv::cvtColor(frame.color, gray, cv::COLOR_BGR2GRAY);
  else
    frame.given_gray().copyTo(gray);
}

/// An image and smaller ones of it. Pixel centres are at whole numbers on every level.
class ImagePyramid {
 public:
  /// Level 0 shares its data with `image`. Levels without a pixel are left out.
  void build(const cv::Mat& image, int levels, double scale_factor) {
    images_.assign(1, image);
    double scale = 1;
    for (int level = 1; level < levels; ++level) {
      scale *= scale_factor;
      const cv::Size size(static_cast<int>(std::lround(image.cols / scale)),
                          static_cast<int>(std::lround(image.rows / scale)));
      if (size.empty()) break;
      cv::Mat smaller;
      cv::resize(images_.back(), smaller, size, 0, 0, cv::INTER_LINEAR);
      images_.push_back(smaller);
    }
  }

  int levels() const { return static_cast<int>(images_.size()); }
  const cv::Mat& image(int level) const { return images_[static_cast<std::size_t>(level)]; }

  /// Pixels of level 0 in one of this level, along x. Widths are rounded, so it is not exactly a
  /// power of the scale factor.
  double scale(int level) const { return static_cast<double>(images_[0].cols) / image(level).cols; }

  /// Pixel of level 0 of a pixel of a level, and back.
  Eigen::Vector2d from_level(const Eigen::Vector2d& p, int level) const {
    return {(p.x() + 0.5) * scale(level) - 0.5, (p.y() + 0.5) * scale_y(level) - 0.5};
  }
  Eigen::Vector2d to_level(const Eigen::Vector2d& p, int level) const {
    return {(p.x() + 0.5) / scale(level) - 0.5, (p.y() + 0.5) / scale_y(level) - 0.5};
  }

 private:
  double scale_y(int level) const {
    return static_cast<double>(images_[0].rows) / image(level).rows;
  }

  std::vector<cv::Mat> images_;
};

}  // namespace stillpoint::rgbd_slam
