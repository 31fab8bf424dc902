// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <opencv2/core.hpp>
#include <vector>

#include "stillpoint/core/config.hpp"
#include "stillpoint/core/depth_view.hpp"
#include "stillpoint/core/lens.hpp"

namespace stillpoint {

/// The depth of a frame averaged over square cells, as the motion check looks at it: motion blur of
/// a few pixels is hardly seen there, and a whole frame is a few thousand cells.
struct DepthCells {
  /// Side of a cell, pixels.
  int block_px = 8;
  int width = 0, height = 0;
  /// Depth per cell in metres; -1 where nothing in the block was measured, 0 where too little was
  /// or a depth edge tears it.
  std::vector<float> depth_m;
  /// Ray (x / z, y / z) of the center of each cell, lens distortion undone.
  std::vector<float> ray_x, ray_y;
  /// From a ray to a cell (its center at whole numbers): focal length, principal point, distortion.
  float fx = 1, fy = 1, cx = 0, cy = 0;
  Lens::Coefficients distortion;

  std::size_t size() const {
    return static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  }
  std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
           static_cast<std::size_t>(x);
  }

  /// Where a row of cells lies in the image, from -0.5 (the first) to 0.5 (the last).
  float row_share(float y) const {
    const float share = (y + 0.5f) / static_cast<float>(height) - 0.5f;
    return std::min(0.5f, std::max(-0.5f, share));
  }

  /// Greatest difference in depth of two neighboring cells of one surface at depth z, metres.
  static float most_step_m(float z) { return 0.03f + 0.025f * z; }

  /// The cell, in parts of cells, that a ray falls on. O(1).
  Eigen::Vector2f cell(float x, float y) const {
    const float xx = x * x, yy = y * y, xy = x * y;
    const float r2 = std::min(xx + yy, distortion.most_square);
    const float radial = 1 + r2 * (distortion.k1 + r2 * (distortion.k2 + r2 * distortion.k3));
    return {fx * (x * radial + 2 * distortion.p1 * xy + distortion.p2 * (r2 + 2 * xx)) + cx,
            fy * (y * radial + distortion.p1 * (r2 + 2 * yy) + 2 * distortion.p2 * xy) + cy};
  }

  /// Takes the depth of the blocks of a frame. Where its noise is far above a Kinect's, cells may
  /// spread more before they count as torn. O(pixels / 4).
  void set(const DepthView& depth, int block) {
    block_px = block;
    width = depth.size().width / block, height = depth.size().height / block;
    depth_m.resize(size());
    set_rays(depth.lens());
    if (depth.empty()) {
      std::fill(depth_m.begin(), depth_m.end(), 0.0f);
      return;
    }
    measure(depth, 0);
    const float noise = pixel_noise();
    if (noise > kUsualNoise) measure(depth, noise);
  }

 private:
  // Of a plane that faces the camera, the greatest less the least depth in a cell, over z^2: three
  // to four standard deviations of a pixel. A Kinect has 0.003 to 0.009. 1 / metres.
  static constexpr float kUsualNoise = 0.012f;
  static constexpr float kNoiseFromM = 2.5f;  // nearer, slopes spread more than noise
  static constexpr double kFacing = 0.3;      // share of the cells whose slope is little
  static constexpr std::size_t kFewestCells = 100;
  static constexpr float kMostSpread = 2;  // times the noise: 16 pixels hardly ever spread more

  // Fills depth_m. `noise`: see kUsualNoise; what it spreads does not tear a cell.
  void measure(const DepthView& depth, float noise) {
    spread_.clear();
    // With a number that the compiler knows, short loops become plain code.
    if (block_px == 8)
      measure_blocks(depth, 4, noise);
    else
      measure_blocks(depth, block_px / 2, noise);
  }

  // Of every second pixel of every second row, `side` each.
  STILLPOINT_ALWAYS_INLINE void measure_blocks(const DepthView& depth, int side, float noise) {
    const std::size_t stride = depth.image().step1();
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x)
        depth_m[index(x, y)] = block_depth(depth.row(y * block_px) + x * block_px, stride, side,
                                           depth.metres_per_unit_value(), noise);
  }

  // The noise of this frame's pixels (see kUsualNoise); 0 where too little is far enough away.
  float pixel_noise() {
    if (spread_.size() < kFewestCells) return 0;
    const auto facing = spread_.begin() +
                        static_cast<std::ptrdiff_t>(kFacing * static_cast<double>(spread_.size()));
    std::nth_element(spread_.begin(), facing, spread_.end());
    return *facing;
  }

  void set_rays(const Lens& lens) {
    const float b = static_cast<float>(block_px);
    // The center of cell i is pixel block * i + (block - 1) / 2.
    const float fx_now = lens.fx() / b, fy_now = lens.fy() / b;
    const float cx_now = (lens.cx() - 0.5f * (b - 1)) / b;
    const float cy_now = (lens.cy() - 0.5f * (b - 1)) / b;
    const Lens::Coefficients now = lens.coefficients();
    if (ray_x.size() == size() && fx == fx_now && fy == fy_now && cx == cx_now && cy == cy_now &&
        std::memcmp(&now, &distortion, sizeof now) == 0)
      return;
    fx = fx_now, fy = fy_now, cx = cx_now, cy = cy_now, distortion = now;
    ray_x.resize(size()), ray_y.resize(size());
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        const Eigen::Vector2f ray = lens.ray(b * static_cast<float>(x) + 0.5f * (b - 1),
                                             b * static_cast<float>(y) + 0.5f * (b - 1));
        ray_x[index(x, y)] = ray.x(), ray_y[index(x, y)] = ray.y();
      }
  }

  STILLPOINT_ALWAYS_INLINE float block_depth(const std::uint16_t* first, std::size_t stride,
                                             int side, float to_m, float noise) {
    const int samples = side * side;
    unsigned lo = 65535, hi = 0, n = 0, sum = 0;  // lo: one less, so that 0 is the highest
    for (int y = 0; y < side; ++y) {
      const std::uint16_t* row = first + static_cast<std::size_t>(2 * y + 1) * stride + 1;
      for (int x = 0; x < side; ++x, row += 2) {
        const unsigned z = *row;
        lo = std::min(lo, (z - 1) & 65535u), hi = std::max(hi, z);
        n += z != 0, sum += z;
      }
    }
    if (n == 0) return -1;
    if (static_cast<int>(2 * n) < samples) return 0;
    const float near = static_cast<float>(lo + 1) * to_m, far = static_cast<float>(hi) * to_m;
    if (static_cast<int>(n) == samples && near > kNoiseFromM)
      spread_.push_back((far - near) / (near * near));
    const float whole = std::max(0.03f + 0.05f * near, kMostSpread * noise * near * near);
    return far - near < whole ? static_cast<float>(sum) / static_cast<float>(n) * to_m : 0;
  }

  std::vector<float> spread_;  // of far cells, over z^2
};

}  // namespace stillpoint
