// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <opencv2/core.hpp>
#include <utility>
#include <vector>

#include "stillpoint/core/config.hpp"
#include "stillpoint/core/depth_view.hpp"
#include "stillpoint/core/lens.hpp"
#include "stillpoint/motion/packet.hpp"

namespace stillpoint {

/// The depth of a frame averaged over square cells, as the motion check looks at it: motion blur of
/// a few pixels is hardly seen there, and a whole frame is a few thousand cells.
struct DepthCells {
  /// From a cell to the four beside it: x, y.
  static constexpr int kNext[4][2] = {{-1, 0}, {1, 0}, {0, -1}, {0, 1}};

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
  std::size_t row_size() const { return static_cast<std::size_t>(width); }
  std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * row_size() + static_cast<std::size_t>(x);
  }

  /// Where a row of cells lies in the image, from -0.5 (the first) to 0.5 (the last).
  template <class Number>
  Number row_share(const Number& y) const {
    const Number share = (y + 0.5f) / static_cast<float>(height) - 0.5f;
    return detail::clamped(share, -0.5f, 0.5f);
  }

  /// Greatest difference in depth of two neighboring cells of one surface at depth z, metres.
  static float most_step_m(float z) { return 0.03f + 0.025f * z; }

  /// The cell, in parts of cells, that a ray falls on; rays may be packets of numbers. O(1).
  template <class Number>
  STILLPOINT_ALWAYS_INLINE std::pair<Number, Number> cell(const Number& x, const Number& y) const {
    const Number xx = x * x, yy = y * y, xy = x * y;
    const Number r2 = detail::clamped(xx + yy, 0.0f, distortion.most_square);
    const Number radial = 1 + r2 * (distortion.k1 + r2 * (distortion.k2 + r2 * distortion.k3));
    return {fx * (x * radial + 2 * distortion.p1 * xy + distortion.p2 * (r2 + 2 * xx)) + cx,
            fy * (y * radial + distortion.p1 * (r2 + 2 * yy) + 2 * distortion.p2 * xy) + cy};
  }

  /// Takes the depth of a frame's blocks, `block` pixels wide, an even number. Where its noise is
  /// far above a Kinect's, cells may spread more before they count as torn. O(pixels / 4).
  void set(const DepthView& depth, int block) {
    block_px = block;
    width = depth.size().width / block, height = depth.size().height / block;
    depth_m.resize(size());
    set_rays(depth.lens());
    if (depth.empty() || size() == 0) {
      std::fill(depth_m.begin(), depth_m.end(), 0.0f);
      return;
    }
    measure(depth, 0);
    if (const float noise = unusual_noise(); noise > 0) measure(depth, noise);
    for (const std::size_t cell : without_ray_) depth_m[cell] = 0;
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
    spread_.reserve(size());
    // With a number that the compiler knows, short loops become plain code.
    if (block_px == 8)
      measure_blocks(depth, 4, noise);
    else
      measure_blocks(depth, block_px / 2, noise);
  }

  // Of every second pixel of every second row, `side` each.
  STILLPOINT_ALWAYS_INLINE void measure_blocks(const DepthView& depth, int side, float noise) {
    const std::size_t samples = static_cast<std::size_t>(side), n = samples * row_size();
    for (int y = 0; y < height; ++y) {
      lo_.assign(n, 65535), hi_.assign(n, 0), count_.assign(n, 0), sum_.assign(n, 0);
      for (int k = 0; k < side; ++k)
        add_row(depth.row(y * block_px + 2 * k + 1) + 1, n, lo_.data(), hi_.data(), count_.data(),
                sum_.data());
      for (std::size_t x = 0; x < row_size(); ++x) join_columns(x, samples);
      find_depth(lo_.data(), hi_.data(), count_.data(), sum_.data(), row_size(), samples * samples,
                 depth.metres_per_unit_value(), noise, &depth_m[index(0, y)]);
      for (std::size_t x = 0; x < row_size(); ++x)
        if (count_[x] == samples * samples) note_spread(x, depth.metres_per_unit_value());
    }
  }

  // Adds every second pixel of a row to the columns of a row of cells. Without branches, as a loop
  // of vector instructions.
  STILLPOINT_ROW_LOOP static void add_row(const std::uint16_t* row, std::size_t n,
                                          std::uint16_t* STILLPOINT_RESTRICT lo,
                                          std::uint16_t* STILLPOINT_RESTRICT hi,
                                          std::uint16_t* STILLPOINT_RESTRICT count,
                                          std::uint32_t* STILLPOINT_RESTRICT sum) {
    for (std::size_t i = 0; i < n; ++i) {
      const std::uint16_t z = row[2 * i], before = static_cast<std::uint16_t>(z - 1);
      lo[i] = before < lo[i] ? before : lo[i];
      hi[i] = z > hi[i] ? z : hi[i];
      count[i] = static_cast<std::uint16_t>(count[i] + (z != 0));
      sum[i] += z;
    }
  }

  // The noise of this frame's pixels if it is above kUsualNoise; 0 if not, and where too little is
  // far enough away.
  float unusual_noise() {
    if (spread_.size() < kFewestCells) return 0;
    const auto facing = spread_.begin() +
                        static_cast<std::ptrdiff_t>(kFacing * static_cast<double>(spread_.size()));
    const auto usual = std::count_if(spread_.begin(), spread_.end(),
                                     [](float spread) { return spread <= kUsualNoise; });
    if (usual > facing - spread_.begin()) return 0;
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
    const cv::Size cells(width, height);
    if (cells == rays_of_ && fx == fx_now && fy == fy_now && cx == cx_now && cy == cy_now &&
        std::memcmp(&now, &distortion, sizeof now) == 0)
      return;
    fx = fx_now, fy = fy_now, cx = cx_now, cy = cy_now, distortion = now, rays_of_ = cells;
    ray_x.resize(size()), ray_y.resize(size());
    without_ray_.clear();
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        const Eigen::Vector2f ray = lens.ray(b * static_cast<float>(x) + 0.5f * (b - 1),
                                             b * static_cast<float>(y) + 0.5f * (b - 1));
        ray_x[index(x, y)] = ray.x(), ray_y[index(x, y)] = ray.y();
        if (!ray.allFinite()) without_ray_.push_back(index(x, y));
      }
  }

  // Puts what the columns of cell x hold together, in column x.
  STILLPOINT_ALWAYS_INLINE void join_columns(std::size_t x, std::size_t side) {
    const std::size_t first = x * side;
    std::uint16_t lo = lo_[first], hi = hi_[first], count = count_[first];
    std::uint32_t sum = sum_[first];
    for (std::size_t i = first + 1; i < first + side; ++i) {
      lo = std::min(lo, lo_[i]), hi = std::max(hi, hi_[i]);
      count = static_cast<std::uint16_t>(count + count_[i]), sum += sum_[i];
    }
    lo_[x] = lo, hi_[x] = hi, count_[x] = count, sum_[x] = sum;
  }

  // The depth of n cells of `all` pixels each. Without branches, too.
  STILLPOINT_ROW_LOOP static void find_depth(const std::uint16_t* lo, const std::uint16_t* hi,
                                             const std::uint16_t* count, const std::uint32_t* sum,
                                             std::size_t n, std::size_t all, float to_m,
                                             float noise, float* STILLPOINT_RESTRICT depth_m) {
    const int half = static_cast<int>(all + 1) / 2;
    const float of_noise = kMostSpread * noise;
    for (std::size_t i = 0; i < n; ++i) {
      const float near = static_cast<float>(lo[i] + 1) * to_m,
                  far = static_cast<float>(hi[i]) * to_m;
      const float of_slope = 0.03f + 0.05f * near, spread = of_noise * near * near;
      const float whole = of_slope < spread ? spread : of_slope;
      const int none = count[i] == 0, is_whole = (far - near < whole) & (count[i] >= half);
      const float mean =
          static_cast<float>(static_cast<int>(sum[i])) / static_cast<float>(count[i] + none) * to_m;
      depth_m[i] = mean * static_cast<float>(is_whole) - static_cast<float>(none);
    }
  }

  void note_spread(std::size_t x, float to_m) {
    const float near = static_cast<float>(lo_[x] + 1) * to_m,
                far = static_cast<float>(hi_[x]) * to_m;
    if (near > kNoiseFromM) spread_.push_back((far - near) / (near * near));
  }

  cv::Size rays_of_;
  std::vector<std::size_t> without_ray_;  // cells where the lens sees nothing
  // Of each column of a row of cells: the least depth (one less, so that 0, no measurement, is the
  // highest), the greatest one, how many there are, and their sum, in units.
  std::vector<std::uint16_t> lo_, hi_, count_;
  std::vector<std::uint32_t> sum_;
  std::vector<float> spread_;  // of far cells, over z^2
};

}  // namespace stillpoint
