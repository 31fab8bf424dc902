// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "stillpoint/core/config.hpp"
#include "stillpoint/core/depth_view.hpp"
#include "stillpoint/core/instance.hpp"
#include "stillpoint/depth/object_region.hpp"

namespace stillpoint {

/// Which pixels are the object's, from the cells of its region: all pixels of a cell amid the
/// region; of a cell at its rim those with a depth that the cells around it have; and what the
/// camera did not measure, on the mask or right beside the object.
class RegionPixels {
 public:
  /// Writes the mask, CV_8UC1 of the size of `area`, the pixels of the cells used. O(pixels).
  void find(const ObjectRegion& region, const Instance& instance, const cv::Rect& area,
            cv::Mat& mask) {
    find_bounds(region);
    const cv::Mat depth = region.samples().depth().image()(area);
    const int cell_px = region.samples().cell_px();
    const cv::Rect box = instance.box - area.tl();
    // With a pixel around, so that each has neighbors; of the image's size, to be allocated once.
    known_.create(region.samples().depth().size() + cv::Size(2, 2));
    for (const int y : {0, area.height + 1}) std::fill_n(known_[y], area.width + 2, uchar{0});
    for (int y = 0; y < area.height; ++y) {
      const std::uint16_t* z = depth.ptr<std::uint16_t>(y);
      uchar* known = known_.ptr(y + 1);
      known[0] = known[area.width + 1] = 0;
      find_in_bounds(z, lo_[y / cell_px], hi_[y / cell_px], area.width, known + 1);
      if (!instance.mask.empty() && y >= box.y && y < box.br().y)
        add_unmeasured(z + box.x, instance.mask.ptr<uchar>(y - box.y), box.width,
                       known + 1 + box.x);
    }
    column_.resize(static_cast<std::size_t>(area.width) + 2);
    for (int y = 0; y < area.height; ++y) {
      join(known_[y], known_[y + 1], known_[y + 2], area.width + 2, column_.data());
      add_unmeasured_beside(depth.ptr<std::uint16_t>(y), known_[y + 1], column_.data(), area.width,
                            mask.ptr<uchar>(y));
    }
  }

 private:
  static constexpr std::uint16_t kMost = 65535;

  // The depths, in units, that pixels of the cells used may have: those of the cells of the region
  // around each, and a little more. A row for each row of cells, a column for each pixel.
  void find_bounds(const ObjectRegion& region) {
    const cv::Rect& used = region.used();
    const int cell_px = region.samples().cell_px();
    lo_.create(used.height, used.width * cell_px), hi_.create(lo_.size());
    const std::size_t n = static_cast<std::size_t>(used.width);
    for (int y = 0; y < used.height; ++y) {
      look_around(region, used.y + y);
      std::uint16_t *lo = lo_[y], *hi = hi_[y];
      for (std::size_t x = 0; x < n; ++x) {
        Bounds bounds{1, 0};  // no pixel
        const int around = count_[x] + count_[x + 1] + count_[x + 2];
        if (around == 9)
          bounds = {0, kMost};  // all, measured or not
        else if (around > 0)
          bounds = widened(region.samples().depth(),
                           {std::min({least_[x], least_[x + 1], least_[x + 2]}),
                            std::max({most_[x], most_[x + 1], most_[x + 2]})});
        for (int k = 0; k < cell_px; ++k) *lo++ = bounds.lo, *hi++ = bounds.hi;
      }
    }
  }

  struct Bounds {
    std::uint16_t lo, hi;
  };

  // Of each column of three used cells around a row, those of the region: how many there are, their
  // least and their greatest depth. A column before the first and one behind the last have none.
  void look_around(const ObjectRegion& region, int y) {
    const cv::Rect& used = region.used();
    const std::size_t n = static_cast<std::size_t>(used.width);
    count_.assign(n + 2, 0), least_.assign(n + 2, kMost), most_.assign(n + 2, 0);
    for (int row = std::max(y - 1, used.y); row < std::min(y + 2, used.br().y); ++row)
      add_row(region.states()[row] + used.x, region.samples().units()[row] + used.x, n, &count_[1],
              &least_[1], &most_[1]);
  }

  static Bounds widened(const DepthView& depth, const Bounds& bounds) {
    const float near_m = depth.to_m(bounds.lo), far_m = depth.to_m(bounds.hi);
    const float slack_m = 0.03f + 0.01f * near_m;
    const int lo = std::max(1, depth.first_units(near_m - slack_m));
    const int hi = std::max(lo, depth.last_units(far_m + slack_m));
    return {static_cast<std::uint16_t>(lo), static_cast<std::uint16_t>(hi)};
  }

  // These without branches, as loops of vector instructions.
  STILLPOINT_ROW_LOOP static void add_row(const std::uint8_t* state, const std::uint16_t* units,
                                          std::size_t n, std::uint16_t* STILLPOINT_RESTRICT count,
                                          std::uint16_t* STILLPOINT_RESTRICT least,
                                          std::uint16_t* STILLPOINT_RESTRICT most) {
    for (std::size_t x = 0; x < n; ++x) {
      const std::uint16_t in = state[x] == kRegion ? kMost : 0;
      const std::uint16_t z = units[x] & in, far = units[x] | static_cast<std::uint16_t>(~in);
      count[x] = static_cast<std::uint16_t>(count[x] + (in & 1));
      least[x] = far < least[x] ? far : least[x];
      most[x] = z > most[x] ? z : most[x];
    }
  }
  STILLPOINT_ROW_LOOP static void find_in_bounds(const std::uint16_t* z, const std::uint16_t* lo,
                                                 const std::uint16_t* hi, int n,
                                                 uchar* STILLPOINT_RESTRICT out) {
    for (int x = 0; x < n; ++x) out[x] = ((z[x] >= lo[x]) & (z[x] <= hi[x])) ? 255 : 0;
  }
  STILLPOINT_ROW_LOOP static void add_unmeasured(const std::uint16_t* z, const uchar* among, int n,
                                                 uchar* STILLPOINT_RESTRICT out) {
    for (int x = 0; x < n; ++x) out[x] = ((z[x] == 0) & (among[x] != 0)) ? 255 : out[x];
  }
  STILLPOINT_ROW_LOOP static void join(const uchar* above, const uchar* here, const uchar* below,
                                       int n, uchar* STILLPOINT_RESTRICT column) {
    for (int x = 0; x < n; ++x) column[x] = above[x] | here[x] | below[x];
  }
  // At outlines cameras measure nothing: such pixels join the object right beside them. `known` and
  // `column`, which joins it with the rows above and below, begin a pixel before the others.
  STILLPOINT_ROW_LOOP static void add_unmeasured_beside(const std::uint16_t* z, const uchar* known,
                                                        const uchar* column, int n,
                                                        uchar* STILLPOINT_RESTRICT out) {
    for (int x = 0; x < n; ++x) {
      const int beside = column[x] | column[x + 1] | column[x + 2];
      out[x] = static_cast<uchar>(known[x + 1] | (z[x] == 0 ? beside : 0));
    }
  }

  std::vector<std::uint16_t> count_, least_, most_;  // see look_around()
  cv::Mat_<std::uint16_t> lo_, hi_;                  // of a row of cells, for each column of pixels
  cv::Mat_<uchar> known_;      // the object's pixels before those right beside it
  std::vector<uchar> column_;  // see add_unmeasured_beside()
};

}  // namespace stillpoint
