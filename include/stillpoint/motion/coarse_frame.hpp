// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "stillpoint/core/depth_view.hpp"
#include "stillpoint/core/frame.hpp"

namespace stillpoint {

/// A frame averaged over square blocks, as the motion components look at it: motion blur of a few
/// pixels is hardly seen there, and a whole frame is a few thousand cells.
struct CoarseFrame {
  int block_px = 8;
  int width = 0, height = 0;
  /// Mean brightness (green) per cell, 0 to 255.
  std::vector<float> intensity;
  /// Depth per cell in metres; 0 where the block has none or is torn by a depth edge.
  std::vector<float> depth_m;
  /// Focal length and principal point in cells.
  float fx = 1, fy = 1, cx = 0, cy = 0;

  std::size_t size() const {
    return static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  }
  std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
           static_cast<std::size_t>(x);
  }

  /// Averages the blocks of a frame. O(pixels / 4).
  void set(const RgbdFrame& frame, const DepthView& depth, int block) {
    block_px = block;
    width = frame.color.cols / block, height = frame.color.rows / block;
    intensity.assign(size(), 0.0f);
    depth_m.resize(size());
    const float b = static_cast<float>(block);
    fx = depth.focal_px() / b, fy = depth.focal_y_px() / b;
    // The centre of cell i is pixel block * i + (block - 1) / 2.
    cx = (depth.center_x() - 0.5f * (b - 1)) / b, cy = (depth.center_y() - 0.5f * (b - 1)) / b;
    const int channels = frame.color.channels(), green = channels == 3 ? 1 : 0;
    const int samples = block / 2;
    for (int y = 0; y < height; ++y) {
      float* to = intensity.data() + index(0, y);
      for (int k = 0; k < samples; ++k) {
        const uchar* row = frame.color.ptr<uchar>(y * block + 2 * k) + green;
        for (int x = 0; x < width; ++x) {
          int sum = 0;
          const uchar* p = row + x * block * channels;
          for (int j = 0; j < samples; ++j) sum += p[2 * j * channels];
          to[x] += static_cast<float>(sum);
        }
      }
      const float scale = 1.0f / static_cast<float>(samples * samples);
      for (int x = 0; x < width; ++x) to[x] *= scale;
      for (int x = 0; x < width; ++x)
        depth_m[index(x, y)] = depth.empty() ? 0 : block_depth(depth, x * block, y * block, block);
    }
  }

  /// Halves `fine` in both directions.
  void halve(const CoarseFrame& fine) {
    block_px = fine.block_px * 2;
    width = fine.width / 2, height = fine.height / 2;
    intensity.resize(size());
    depth_m.resize(size());
    fx = fine.fx / 2, fy = fine.fy / 2;
    cx = (fine.cx - 0.5f) / 2, cy = (fine.cy - 0.5f) / 2;
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        float sum = 0, lo = 1e9f, hi = 0, total = 0;
        int measured = 0;
        for (const int k : {0, 1, 2, 3}) {
          const std::size_t j = fine.index(2 * x + (k & 1), 2 * y + (k >> 1));
          sum += fine.intensity[j];
          const float z = fine.depth_m[j];
          if (z <= 0) continue;
          ++measured, total += z, lo = std::min(lo, z), hi = std::max(hi, z);
        }
        intensity[index(x, y)] = 0.25f * sum;
        const bool whole = measured >= 2 && hi - lo < 0.04f + 0.06f * lo;
        depth_m[index(x, y)] = whole ? total / static_cast<float>(measured) : 0;
      }
  }

 private:
  static float block_depth(const DepthView& depth, int x0, int y0, int block) {
    int lo = 65536, hi = 0, sum = 0, n = 0;
    for (int y = 1; y < block; y += 2) {
      const std::uint16_t* row = depth.row(y0 + y) + x0;
      for (int x = 1; x < block; x += 2) {
        const int z = row[x];
        if (z == 0) continue;
        lo = std::min(lo, z), hi = std::max(hi, z), sum += z, ++n;
      }
    }
    if (2 * n < (block / 2) * (block / 2)) return 0;
    const float to_m = depth.metres_per_unit_value();
    const float near = static_cast<float>(lo) * to_m, far = static_cast<float>(hi) * to_m;
    return far - near < 0.03f + 0.05f * near
               ? static_cast<float>(sum) / static_cast<float>(n) * to_m
               : 0;
  }
};

}  // namespace stillpoint
