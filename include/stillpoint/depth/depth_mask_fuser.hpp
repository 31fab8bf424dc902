// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "stillpoint/core/camera.hpp"
#include "stillpoint/core/depth_view.hpp"
#include "stillpoint/core/frame.hpp"
#include "stillpoint/core/instance.hpp"
#include "stillpoint/core/mask.hpp"
#include "stillpoint/core/status.hpp"
#include "stillpoint/depth/depth_mask_fuser_settings.hpp"
#include "stillpoint/depth/dilate.hpp"
#include "stillpoint/depth/instance_region.hpp"

namespace stillpoint {

/// Makes the dynamic mask of a frame from its instances and its depth (paper section 3.2).
///
/// Paper preset: per box the mean of stratified depth samples gives a range; the box's pixels in
/// that range join the mask. Default preset: the samples on the instance's own mask give the range;
/// the mask loses what lies clearly behind or before the person, and grows into what is connected
/// with it in depth, but not into the floor (see InstanceRegion). Then both are dilated.
///
/// 16-bit depth is read as it is with the frame's scale, CV_32FC1 as metres; 0 and NaN are "no
/// measurement". Deterministic for a seed. Cost: O(pixels of the boxes) and one dilation of their
/// union. No allocation after the largest picture and number of instances were seen. Not
/// thread-safe.
class DepthMaskFuser {
 public:
  using Settings = DepthMaskFuserSettings;

  /// `camera` tells the focal length for the reach of the growth and for the floor; without it
  /// 0.9 times the picture's width is assumed.
  explicit DepthMaskFuser(const Settings& settings = {}, const Camera& camera = {})
      : settings_(settings), camera_(camera), region_(settings) {
    settings.check();
  }

  const Settings& settings() const { return settings_; }

  /// Fuses one frame. Without depth, or with `use_depth` false, the mask is the union of the
  /// instances' masks (of their boxes, where they have none), and status() says kNoDepth. Throws
  /// Error if instances do not fit the picture. `widening_px` is added to the dilation.
  const DynamicMask& fuse(const RgbdFrame& frame, const Segmentation& segmentation,
                          bool use_depth = true, int widening_px = 0) {
    check_frame(frame);
    const cv::Size size = frame.color.size();
    check_segmentation(segmentation, size);
    begin(frame);
    dilation_px_ = settings_.dilation_px + std::max(0, widening_px);
    const std::size_t n = segmentation.instances.size();
    const bool has_depth = use_depth && !frame.depth.empty();
    status_ = frame.depth.empty() ? kNoDepth : kOk;
    if (has_depth) {
      depth_.set(frame, camera_);
      if (!any_measured(depth_)) status_ = kNoDepth;
      region_.begin_frame(depth_, segmentation.instances);
    }
    fused_.resize(n);
    if (buffers_.size() < n) buffers_.resize(n);
    for (std::size_t i = 0; i < n; ++i) {
      if (has_depth)
        region_.fuse(depth_, segmentation.instances[i], buffers_[i], fused_[i]);
      else
        fused_[i] = segmentation.instances[i];
      unite(fused_[i]);
      regions_.push_back(fused_[i].box);
    }
    dilate_rects(undilated_, regions_, dilation_px_, mask_.image, dilation_buffer_);
    return mask_;
  }

  /// The mask of the last fuse() before dilation: H x W, CV_8UC1, 255 = dynamic.
  const cv::Mat& undilated() const { return undilated_; }
  /// The instances of the last fuse() with their new masks (before dilation), in the order given.
  /// Their masks are overwritten by the next fuse().
  const std::vector<Instance>& instances() const { return fused_; }
  /// Share of the picture that the dilated mask of the last fuse() covers. O(pixels of the
  /// regions).
  double mask_share() const {
    cv::Rect all;
    for (const cv::Rect& r : regions_) all |= r;
    if (all.empty()) return 0;
    all = grow_rect(all, dilation_px_, mask_.image.size());
    return cv::countNonZero(mask_.image(all)) / static_cast<double>(mask_.image.total());
  }
  /// kNoDepth or kOk, of the last fuse().
  std::uint32_t status() const { return status_; }

 private:
  void begin(const RgbdFrame& frame) {
    const cv::Size size = frame.color.size();
    if (undilated_.size() != size) {
      undilated_ = cv::Mat::zeros(size, CV_8UC1);
      mask_.image = cv::Mat::zeros(size, CV_8UC1);
    } else {
      // Only what the last frame wrote needs to be cleared.
      for (const cv::Rect& r : regions_) {
        clear(undilated_, r);
        clear(mask_.image, grow_rect(r, dilation_px_, size));
      }
    }
    regions_.clear();
    mask_.timestamp = frame.timestamp;
    mask_.age_s = 0;
  }

  // O(1) unless the picture is black: ends at the first measurement.
  static bool any_measured(const DepthView& depth) {
    for (int y = 0; y < depth.size().height; ++y) {
      const std::uint16_t* row = depth.row(y);
      for (int x = 0; x < depth.size().width; ++x)
        if (row[x] != 0) return true;
    }
    return false;
  }

  static void clear(cv::Mat& image, const cv::Rect& r) {
    for (int y = r.y; y < r.y + r.height; ++y)
      std::memset(image.ptr<uchar>(y) + r.x, 0, static_cast<std::size_t>(r.width));
  }

  void unite(const Instance& instance) {
    for (int y = 0; y < instance.box.height; ++y) {
      uchar* out = undilated_.ptr<uchar>(instance.box.y + y) + instance.box.x;
      if (instance.mask.empty()) {
        std::memset(out, 255, static_cast<std::size_t>(instance.box.width));
        continue;
      }
      const uchar* in = instance.mask.ptr<uchar>(y);
      detail::or_into(in, static_cast<std::size_t>(instance.box.width), out);
    }
  }

  Settings settings_;
  Camera camera_;
  DepthView depth_;
  InstanceRegion region_;
  cv::Mat undilated_;
  DynamicMask mask_;
  std::vector<Instance> fused_;
  std::vector<std::vector<uchar>> buffers_;
  std::vector<cv::Rect> regions_;
  int dilation_px_ = 0;  // of the last frame
  DilationBuffer dilation_buffer_;
  std::uint32_t status_ = kOk;
};

}  // namespace stillpoint
