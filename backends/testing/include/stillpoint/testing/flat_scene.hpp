// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cstdint>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "stillpoint/core/camera.hpp"
#include "stillpoint/core/frame.hpp"
#include "stillpoint/core/instance.hpp"

namespace stillpoint {

/// A flat figure in front of a wall.
struct Figure {
  cv::Rect box;  ///< May reach beyond the image.
  float depth_m = 2;
  std::uint32_t texture = 1;
};

/// Small images for tests: textured rectangles in front of a textured wall and, if wanted, a
/// floor. Exact and cheap: 320 x 240 by default, nothing is random.
struct FlatScene {
  cv::Size size{320, 240};
  float wall_m = 5;
  /// Camera above the floor; 0: no floor.
  float height_m = 0;
  bool with_depth = true;
  int color_channels = 3;

  Camera camera() const {
    Camera c;
    c.fx = c.fy = 525.0 * size.width / 640;
    c.cx = 0.5 * (size.width - 1), c.cy = 0.5 * (size.height - 1);
    c.width = size.width, c.height = size.height;
    return c;
  }

  /// Depth of the empty room at a row.
  float background_m(int y) const {
    const Camera c = camera();
    const double below = (y - c.cy) / c.fy;
    if (height_m <= 0 || below <= 0) return wall_m;
    return std::min(wall_m, static_cast<float>(height_m / below));
  }

  /// The nearest figure hides the others. Depth is CV_16UC1 at 5000 per metre, in whole
  /// millimetres. The wall's texture is shifted to the right by `turn_px`, as a turning camera
  /// would.
  RgbdFrame frame(double timestamp, const std::vector<Figure>& figures, int turn_px = 0) const {
    RgbdFrame f;
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

/// The instance of a rectangle, clipped to the image, with a full mask.
inline Instance box_instance(const cv::Rect& box, const cv::Size& size,
                             const std::string& class_name = "person") {
  Instance instance;
  instance.class_name = class_name;
  instance.box = box & cv::Rect(cv::Point(), size);
  instance.mask = cv::Mat(instance.box.size(), CV_8UC1, cv::Scalar(255));
  return instance;
}

}  // namespace stillpoint
