// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cstdint>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

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
    for (int y = 0; y < area.height; ++y) {
      const std::uint16_t* z = depth.ptr<std::uint16_t>(y);
      find_in_bounds(z, lo_[y / cell_px], hi_[y / cell_px], area.width, mask.ptr<uchar>(y));
      if (!instance.mask.empty() && y >= box.y && y < box.br().y)
        add_unmeasured(z + box.x, instance.mask.ptr<uchar>(y - box.y), box.width,
                       mask.ptr<uchar>(y) + box.x);
    }
    // At outlines cameras measure nothing. Isolated: in memory other masks lie beside this one.
    wide_.create(region.samples().depth().size());
    cv::Mat wide = wide_(area);
    cv::dilate(mask, wide, cv::Mat(), {-1, -1}, 1, cv::BORDER_CONSTANT | cv::BORDER_ISOLATED);
    for (int y = 0; y < area.height; ++y)
      add_unmeasured(depth.ptr<std::uint16_t>(y), wide.ptr<uchar>(y), area.width,
                     mask.ptr<uchar>(y));
  }

 private:
  static constexpr int kMost = 65535;

  // The depths, in units, that pixels of the cells used may have: those of the cells of the region
  // around each, and a little more. A row for each row of cells, a column for each pixel.
  void find_bounds(const ObjectRegion& region) {
    const cv::Mat units = region.samples().units()(region.used());
    cv::compare(region.states()(region.used()), static_cast<int>(kRegion), region_, cv::CMP_EQ);
    least_.create(units.size()), most_.create(units.size());
    least_.setTo(kMost), most_.setTo(0);
    units.copyTo(least_, region_);
    units.copyTo(most_, region_);
    const cv::Mat around;  // 3 x 3 cells
    cv::erode(least_, least_, around);
    cv::dilate(most_, most_, around);
    cv::erode(region_, region_, around, {-1, -1}, 1, cv::BORDER_CONSTANT, 0);
    const DepthView& depth = region.samples().depth();
    for (int y = 0; y < units.rows; ++y)
      for (int x = 0; x < units.cols; ++x) {
        const float near_m = depth.to_m(least_(y, x)), far_m = depth.to_m(most_(y, x));
        const float slack_m = 0.03f + 0.01f * near_m;
        int lo = 1, hi = 0;  // no pixel
        if (region_(y, x) != 0) {
          lo = 0, hi = kMost;  // all, measured or not
        } else if (far_m > 0) {
          lo = std::max(1, depth.first_units(near_m - slack_m));
          hi = std::max(lo, depth.last_units(far_m + slack_m));
        }
        least_(y, x) = static_cast<std::uint16_t>(lo), most_(y, x) = static_cast<std::uint16_t>(hi);
      }
    const cv::Size wide(units.cols * region.samples().cell_px(), units.rows);
    cv::resize(least_, lo_, wide, 0, 0, cv::INTER_NEAREST);
    cv::resize(most_, hi_, wide, 0, 0, cv::INTER_NEAREST);
  }

  // These two without branches, as loops of vector instructions.
  static void find_in_bounds(const std::uint16_t* z, const std::uint16_t* lo,
                             const std::uint16_t* hi, int n, uchar* STILLPOINT_RESTRICT out) {
    for (int x = 0; x < n; ++x) out[x] = ((z[x] >= lo[x]) & (z[x] <= hi[x])) ? 255 : 0;
  }
  static void add_unmeasured(const std::uint16_t* z, const uchar* among, int n,
                             uchar* STILLPOINT_RESTRICT out) {
    for (int x = 0; x < n; ++x) out[x] = ((z[x] == 0) & (among[x] != 0)) ? 255 : out[x];
  }

  cv::Mat_<uchar> region_;                // of the cells used
  cv::Mat_<std::uint16_t> least_, most_;  // of the cells used, units
  cv::Mat_<std::uint16_t> lo_, hi_;       // of a row of cells, for each column of pixels
  cv::Mat_<uchar> wide_;                  // of the image
};

}  // namespace stillpoint
