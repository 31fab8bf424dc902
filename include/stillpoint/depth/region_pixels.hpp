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
    for (int y = 0; y < cells.used.height; ++y) add_row_of_cells(cells, y, cell_px, area, mask);
    const DepthView& depth = cells.depth();
    if (!instance.mask.empty())
      for (int y = 0; y < instance.box.height; ++y)
        add_unmeasured(depth.row(instance.box.y + y) + instance.box.x, instance.mask.ptr<uchar>(y),
                       instance.box.width,
                       mask.ptr<uchar>(instance.box.y + y - area.y) + instance.box.x - area.x);
    // At outlines cameras measure nothing.
    wide_.create(depth.size());
    cv::Mat wide = wide_(area);
    detail::dilate_square(mask, 1, wide);
    for (int y = 0; y < area.height; ++y)
      add_unmeasured(depth.row(area.y + y) + area.x, wide.ptr<uchar>(y), area.width,
                     mask.ptr<uchar>(y));
  }

 private:
  void add_row_of_cells(const RegionCells& cells, int row, int cell_px, const cv::Rect& area,
                        cv::Mat& mask) {
    count_region(cells, row);
    // Amid the region all pixels, measured or not, elsewhere none.
    full_row_.assign(static_cast<std::size_t>(cells.used.width * cell_px), 0);
    for (std::size_t x = 0; x < in_region_.size(); ++x)
      if (in_region_[x] == 9)
        std::fill_n(&full_row_[x * static_cast<std::size_t>(cell_px)], cell_px, uchar{255});
    const int end = std::min((row + 1) * cell_px, area.height);
    for (int y = row * cell_px; y < end; ++y)
      std::copy_n(full_row_.begin(), area.width, mask.ptr<uchar>(y));
    for (int x = 0; x < cells.used.width; ++x) {
      const int in_region = in_region_[static_cast<std::size_t>(x)];
      if (in_region == 0 || in_region == 9) continue;
      const cv::Rect cell(x * cell_px, row * cell_px, cell_px, cell_px);
      add_rim(cells, cells.used.tl() + cv::Point(x, row), cell & cv::Rect({}, area.size()),
              area.tl(), mask);
    }
  }

  // How many of the nine cells around each cell of a row are of the region.
  void count_region(const RegionCells& cells, int row) {
    in_region_.assign(static_cast<std::size_t>(cells.used.width), 0);
    for (int y = cells.used.y + row - 1; y <= cells.used.y + row + 1; ++y) {
      const CellState* state = cells.state_row(y) + cells.used.x;
      for (std::size_t x = 0; x < in_region_.size(); ++x, ++state)
        for (const int beside : {-1, 0, 1})
          in_region_[x] = static_cast<uchar>(in_region_[x] + (state[beside] == CellState::kRegion));
    }
  }

  // The pixels of a cell, `part` of the mask, whose depth the cells of the region around it have,
  // or nearly so.
  static void add_rim(const RegionCells& cells, const cv::Point& cell, const cv::Rect& part,
                      const cv::Point& origin, cv::Mat& mask) {
    float low = 1e9f, high = 0;
    for (int y = cell.y - 1; y <= cell.y + 1; ++y)
      for (int x = cell.x - 1; x <= cell.x + 1; ++x)
        if (cells.state({x, y}) == CellState::kRegion)
          low = std::min(low, cells.z({x, y})), high = std::max(high, cells.z({x, y}));
    const DepthView& depth = cells.depth();
    const float slack = 0.03f + 0.01f * low;
    const int first = std::max(1, depth.first_units(low - slack));
    const int last = std::max(first, depth.last_units(high + slack));
    for (int y = part.y; y < part.y + part.height; ++y) {
      const std::uint16_t* z = depth.row(origin.y + y) + origin.x;
      uchar* out = mask.ptr<uchar>(y);
      for (int x = part.x; x < part.x + part.width; ++x)
        out[x] = ((z[x] >= first) & (z[x] <= last)) ? 255 : 0;
    }
  }

  // Adds the pixels of `among` that have no depth. Without branches, as vector instructions.
  static void add_unmeasured(const std::uint16_t* z, const uchar* among, int n,
                             uchar* STILLPOINT_RESTRICT out) {
    for (int x = 0; x < n; ++x) out[x] = ((z[x] == 0) & (among[x] != 0)) ? 255 : out[x];
  }

  std::vector<uchar> in_region_;  // of nine cells, in a row of cells
  std::vector<uchar> full_row_;   // of pixels
  cv::Mat_<uchar> wide_;          // of the image
};

}  // namespace stillpoint
