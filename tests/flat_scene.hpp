// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "stillpoint/core/camera.hpp"
#include "stillpoint/core/frame.hpp"
#include "stillpoint/core/instance.hpp"
#include "stillpoint/core/mask.hpp"

/// A flat figure in front of a wall.
struct Figure {
  cv::Rect box;  ///< May reach beyond the picture.
  float depth_m = 2;
  std::uint32_t texture = 1;
};

/// Small pictures for tests: textured rectangles in front of a textured wall and, if wanted, a
/// floor. Exact and cheap: 320 x 240 by default, nothing is random.
struct FlatScene {
  cv::Size size{320, 240};
  float wall_m = 5;
  /// Camera above the floor; 0: no floor.
  float height_m = 0;
  bool with_depth = true;
  int color_channels = 3;

  stillpoint::Camera camera() const {
    stillpoint::Camera c;
    c.fx = c.fy = 525.0 * size.width / 640;
    c.cx = 0.5 * (size.width - 1), c.cy = 0.5 * (size.height - 1);
    c.width = size.width, c.height = size.height;
    return c;
  }

  /// Depth of the empty room at a row.
  float background_m(int y) const {
    const stillpoint::Camera c = camera();
    const double below = (y - c.cy) / c.fy;
    if (height_m <= 0 || below <= 0) return wall_m;
    return std::min(wall_m, static_cast<float>(height_m / below));
  }

  /// The nearest figure hides the others. Depth is CV_16UC1 at 5000 per metre, in whole
  /// millimetres. The wall's texture is shifted to the right by `turn_px`, as a turning camera
  /// would.
  stillpoint::RgbdFrame frame(double timestamp, const std::vector<Figure>& figures,
                              int turn_px = 0) const {
    stillpoint::RgbdFrame f;
    f.timestamp = timestamp;
    f.color.create(size, CV_8UC(color_channels));
    cv::Mat depth(size, CV_16UC1);
    for (int y = 0; y < size.height; ++y)
      for (int x = 0; x < size.width; ++x) {
        float z = background_m(y);
        int u = x - turn_px, v = y;
        std::uint32_t texture = 0;
        for (const Figure& g : figures)
          if (g.depth_m < z && g.box.contains({x, y}))
            z = g.depth_m, u = x - g.box.x, v = y - g.box.y, texture = g.texture;
        for (int c = 0; c < color_channels; ++c)
          f.color.ptr<uchar>(y)[color_channels * x + c] = shade(u, v, texture);
        depth.at<std::uint16_t>(y, x) =
            static_cast<std::uint16_t>(5 * static_cast<int>(1000 * std::min(z, 13.0f) + 0.5f));
      }
    if (with_depth) f.depth = depth;
    return f;
  }

 private:
  static std::uint32_t hash(std::uint32_t x) {
    x ^= x >> 16, x *= 0x7feb352du, x ^= x >> 15, x *= 0x846ca68bu;
    return x ^ (x >> 16);
  }
  // Smooth noise with a lattice of 4 pixels: no two places alike, and alike over a pixel or two.
  static uchar shade(int u, int v, std::uint32_t texture) {
    const int x = (u + 4096) / 4, y = (v + 4096) / 4, fx = (u + 4096) % 4, fy = (v + 4096) % 4;
    const auto at = [&](int i, int j) {
      return static_cast<int>(hash(static_cast<std::uint32_t>(i * 8191 + j) + (texture << 24)) %
                              216u);
    };
    const int top = (4 - fx) * at(x, y) + fx * at(x + 1, y);
    const int bottom = (4 - fx) * at(x, y + 1) + fx * at(x + 1, y + 1);
    return static_cast<uchar>(20 + ((4 - fy) * top + fy * bottom) / 16);
  }
};

/// The scene of the tests of adapters: 640 x 480, as hosts need many keypoints; and who walks
/// there.
inline FlatScene large_scene() {
  FlatScene scene;
  scene.size = {640, 480};
  return scene;
}
inline Figure walker(int i) { return {{180 + 6 * i, 100, 150, 340}, 2, 7}; }

/// The instance of a rectangle, clipped to the picture, with a full mask.
inline stillpoint::Instance box_instance(const cv::Rect& box, const cv::Size& size,
                                         const std::string& class_name = "person") {
  stillpoint::Instance instance;
  instance.class_name = class_name;
  instance.box = box & cv::Rect(cv::Point(), size);
  instance.mask = cv::Mat(instance.box.size(), CV_8UC1, cv::Scalar(255));
  return instance;
}

/// A result of the segmenter.
inline stillpoint::Segmentation result(std::vector<stillpoint::Instance> instances) {
  stillpoint::Segmentation segmentation;
  segmentation.available = true;
  segmentation.instances = std::move(instances);
  return segmentation;
}

/// The instances as one mask of the whole picture, 255 where one of them is.
inline cv::Mat picture_of(const std::vector<stillpoint::Instance>& instances,
                          const cv::Size& size) {
  return stillpoint::mask_from_instances(instances, size);
}

/// A mask of the whole picture, 255 in the rectangles.
inline cv::Mat picture_of(const std::vector<cv::Rect>& boxes, const cv::Size& size) {
  cv::Mat all = cv::Mat::zeros(size, CV_8UC1);
  for (const cv::Rect& box : boxes) all(box & cv::Rect(cv::Point(), size)).setTo(255);
  return all;
}

inline int pixels(const cv::Mat& mask) { return cv::countNonZero(mask); }

/// Intersection over union of two masks; 1 if both are empty.
inline double iou(const cv::Mat& a, const cv::Mat& b) {
  const int both = pixels(a & b), any = pixels(a | b);
  return any == 0 ? 1 : static_cast<double>(both) / any;
}

/// True if two pictures have the same size, type and bytes.
inline bool identical(const cv::Mat& a, const cv::Mat& b) {
  if (a.size() != b.size() || a.type() != b.type()) return false;
  for (int y = 0; y < a.rows; ++y)
    if (!std::equal(a.ptr<uchar>(y),
                    a.ptr<uchar>(y) + a.elemSize() * static_cast<std::size_t>(a.cols),
                    b.ptr<uchar>(y)))
      return false;
  return true;
}
