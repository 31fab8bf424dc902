// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "stillpoint/core/config.hpp"
#include "stillpoint/core/depth_view.hpp"
#include "stillpoint/core/instance.hpp"
#include "stillpoint/depth/region_cells.hpp"

namespace stillpoint {

/// Which pixels are the object's, from the cells of its region: all pixels of a cell amid the
/// region; of a cell at its rim those with a depth that the cells around it have; and what the
/// camera did not measure, on the mask or right beside the object.
class RegionPixels {
 public:
  /// Writes the mask, CV_8UC1 of the size of `area`, the pixels of the cells used. O(pixels).
  void find(const RegionCells& cells, int cell_px, const Instance& instance, const cv::Rect& area,
            cv::Mat& mask) {
    find_bounds(cells);
    const DepthView& depth = cells.depth();
    for (int y = 0; y < area.height; ++y) {
      if (y % cell_px == 0) spread_row(y / cell_px, cell_px);
      const std::uint16_t* z = depth.row(area.y + y) + area.x;
      in_bounds(z, area.width, mask.ptr<uchar>(y));
      const int in_box = area.y + y - instance.box.y;
      if (instance.mask.empty() || in_box < 0 || in_box >= instance.box.height) continue;
      const int x = instance.box.x - area.x;
      add_unmeasured(z + x, instance.mask.ptr<uchar>(in_box), instance.box.width,
                     mask.ptr<uchar>(y) + x);
    }
    // At outlines cameras measure nothing.
    wide_.create(depth.size());
    cv::Mat wide = wide_(area);
    detail::dilate_square(mask, 1, wide);
    for (int y = 0; y < area.height; ++y)
      add_unmeasured(depth.row(area.y + y) + area.x, wide.ptr<uchar>(y), area.width,
                     mask.ptr<uchar>(y));
  }

 private:
  static constexpr std::uint16_t kMost = 65535;

  // The depths, in units, that pixels of each cell used may have: those of the cells of the region
  // around it, and a little more.
  void find_bounds(const RegionCells& cells) {
    lo_.create(cells.used.size()), hi_.create(cells.used.size());
    for (int y = 0; y < lo_.rows; ++y)
      for (int x = 0; x < lo_.cols; ++x) {
        const cv::Point cell = cells.used.tl() + cv::Point(x, y);
        int in_region = 0;
        float low = 1e9f, high = 0;
        for (int v = cell.y - 1; v <= cell.y + 1; ++v) {
          const CellState* state = cells.state_row(v) + cell.x;
          const float* z = cells.z_row(v) + cell.x;
          for (int u = -1; u <= 1; ++u) {
            const bool in = state[u] == CellState::kRegion;
            in_region += in;
            low = std::min(low, in ? z[u] : 1e9f), high = std::max(high, in ? z[u] : 0);
          }
        }
        lo_(y, x) = 1, hi_(y, x) = 0;  // no pixel
        if (in_region == 9) {
          lo_(y, x) = 0, hi_(y, x) = kMost;  // all, measured or not
        } else if (in_region > 0) {
          const float slack = 0.03f + 0.01f * low;
          const int first = std::max(1, cells.depth().first_units(low - slack));
          const int last = cells.depth().last_units(high + slack);
          lo_(y, x) = static_cast<std::uint16_t>(first);
          hi_(y, x) = static_cast<std::uint16_t>(std::max(first, last));
        }
      }
  }

  // The bounds of a row of cells, for each pixel.
  void spread_row(int row, int cell_px) {
    const std::size_t cell = static_cast<std::size_t>(cell_px);
    lo_row_.resize(static_cast<std::size_t>(lo_.cols) * cell);
    hi_row_.resize(lo_row_.size());
    for (int x = 0; x < lo_.cols; ++x) {
      const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(x) * cell_px;
      std::fill_n(lo_row_.begin() + at, cell, lo_(row, x));
      std::fill_n(hi_row_.begin() + at, cell, hi_(row, x));
    }
  }

  // Without branches, as loops of vector instructions.
  void in_bounds(const std::uint16_t* z, int n, uchar* STILLPOINT_RESTRICT out) const {
    const std::uint16_t *lo = lo_row_.data(), *hi = hi_row_.data();
    for (int x = 0; x < n; ++x) out[x] = ((z[x] >= lo[x]) & (z[x] <= hi[x])) ? 255 : 0;
  }

  // Adds the pixels of `among` that have no depth.
  static void add_unmeasured(const std::uint16_t* z, const uchar* among, int n,
                             uchar* STILLPOINT_RESTRICT out) {
    for (int x = 0; x < n; ++x) out[x] = ((z[x] == 0) & (among[x] != 0)) ? 255 : out[x];
  }

  cv::Mat_<std::uint16_t> lo_, hi_;  // of the cells used
  std::vector<std::uint16_t> lo_row_, hi_row_;
  cv::Mat_<uchar> wide_;  // of the image
};

}  // namespace stillpoint
