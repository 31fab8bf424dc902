// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cstdint>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

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
    const cv::Mat z = cells.depth().image()(area);
    const cv::Mat lo =
        pixels_of(lo_, cell_px, cells.depth().size(), lo_px_)(cv::Rect({}, area.size()));
    const cv::Mat hi =
        pixels_of(hi_, cell_px, cells.depth().size(), hi_px_)(cv::Rect({}, area.size()));
    cv::inRange(z, lo, hi, mask);

    unmeasured_.create(cells.depth().size());
    cv::Mat unmeasured = unmeasured_(area);
    cv::compare(z, 0, unmeasured, cv::CMP_EQ);
    if (!instance.mask.empty()) {
      const cv::Rect common = instance.box & area;
      on_mask_.create(cells.depth().size());
      cv::Mat on_mask = on_mask_(common);
      cv::bitwise_and(unmeasured_(common), instance.mask(common - instance.box.tl()), on_mask);
      mask(common - area.tl()).setTo(255, on_mask);
    }
    // At outlines cameras measure nothing.
    wide_.create(cells.depth().size());
    cv::Mat wide = wide_(area);
    detail::dilate_square(mask, 1, wide);
    cv::bitwise_or(mask, wide, mask, unmeasured);
  }

 private:
  static constexpr std::uint16_t kMost = 65535;

  // The value of each cell for all its pixels, in a buffer for the whole image.
  static cv::Mat pixels_of(const cv::Mat& of_cells, int cell_px, const cv::Size& image,
                           cv::Mat& buffer) {
    buffer.create(image + cv::Size(cell_px, cell_px), CV_16UC1);
    cv::Mat pixels = buffer(cv::Rect({}, of_cells.size() * cell_px));
    cv::resize(of_cells, pixels, pixels.size(), 0, 0, cv::INTER_NEAREST);
    return pixels;
  }

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

  cv::Mat_<std::uint16_t> lo_, hi_;              // of the cells used
  cv::Mat_<std::uint16_t> lo_px_, hi_px_;        // of their pixels
  cv::Mat_<uchar> unmeasured_, on_mask_, wide_;  // of the image
};

}  // namespace stillpoint
