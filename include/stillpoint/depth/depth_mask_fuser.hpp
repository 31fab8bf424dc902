// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "stillpoint/core/camera.hpp"
#include "stillpoint/core/depth_view.hpp"
#include "stillpoint/core/frame.hpp"
#include "stillpoint/core/frame_context.hpp"
#include "stillpoint/core/image_scale.hpp"
#include "stillpoint/core/instance.hpp"
#include "stillpoint/core/mask.hpp"
#include "stillpoint/core/mask_pool.hpp"
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
/// measurement". Deterministic for a seed. Cost: O(pixels of the boxes) and one dilation of
/// their union.
/// Keeps its images: after the first frames only OpenCV's filters allocate, a few rows. Not
/// thread-safe.
class DepthMaskFuser {
 public:
  using Settings = DepthMaskFuserSettings;

  /// `camera` tells the focal length for the reach of the growth and for the floor; without it
  /// 0.9 times the image's width is assumed.
  explicit DepthMaskFuser(const Settings& settings = {}, const Camera& camera = {})
      : settings_(settings), camera_(camera), region_(settings) {
    settings.check();
  }

  const Settings& settings() const { return settings_; }

  /// Fuses one frame. Without depth, or with `use_depth` false, the mask is the union of the
  /// instances' masks (of their boxes, where they have none), and status() says kNoDepth. Throws
  /// Error if instances do not fit the image. Strongly blurred instances are dilated more;
  /// `widening_px` is added to all. `T_current_last` maps points of the last frame's camera into
  /// this one's, if it is known: it keeps the floor in mind where people hide it. The mask is the
  /// caller's: what becomes of it changes nothing here.
  const DynamicMask& fuse(const RgbdFrame& frame, const Segmentation& segmentation,
                          bool use_depth = true, int widening_px = 0,
                          const std::optional<Eigen::Isometry3d>& T_current_last = std::nullopt) {
    own_context_.begin(frame, camera_);
    own_context_.T_current_last = T_current_last;
    return fuse(own_context_, segmentation, use_depth, widening_px);
  }

  /// The same for a frame of which more is known: an object does not grow into what
  /// `context.labels` knows to be static, one without a name only if that stood alone; and a bare
  /// box finds nothing of an object there.
  const DynamicMask& fuse(const FrameContext& context, const Segmentation& segmentation,
                          bool use_depth = true, int widening_px = 0) {
    check_segmentation(segmentation, context.size());
    widening_px = std::max(0, widening_px);
    mask_.timestamp = context.frame.timestamp;
    mask_.age_s = 0;
    find_instances(context, segmentation, use_depth);
    dilate(context.size(), widening_px);
    return mask_;
  }

  /// The mask of the last fuse() before dilation: H x W, CV_8UC1, 255 = dynamic. The next fuse()
  /// overwrites it.
  const cv::Mat& undilated() const { return undilated_; }
  /// The instances of the last fuse() with their new masks (before dilation), in the order given.
  const std::vector<Instance>& instances() const { return fused_; }
  /// Share of the image that the dilated mask of the last fuse() covers.
  double mask_share() const { return mask_share_; }
  /// kNoDepth or kOk, of the last fuse().
  std::uint32_t status() const { return status_; }

 private:
  void find_instances(const FrameContext& context, const Segmentation& segmentation,
                      bool use_depth) {
    const DepthView& depth = context.depth;
    const std::size_t n = segmentation.instances.size();
    const bool has_depth = use_depth && !depth.empty();
    status_ = depth.empty() ? kNoDepth : kOk;
    if (has_depth) {
      if (!depth.any_measured(segmentation.instances)) status_ = kNoDepth;
      region_.begin_frame(depth, segmentation.instances, context.T_current_last);
    }
    detail::clear_mask(context.size(), undilated_);
    fused_.resize(n);
    for (Instance& s : fused_) s.mask.release();
    for (std::size_t i = 0; i < n; ++i) {
      if (has_depth)
        region_.fuse(depth, segmentation.instances[i], context.labels, masks_, fused_[i]);
      else
        fused_[i] = segmentation.instances[i];
      detail::add_to_mask(fused_[i].mask, fused_[i].box, undilated_);
    }
  }

  // All instances at once, and those once more that are dilated more than the others.
  void dilate(const cv::Size& size, int widening_px) {
    if (detail::MaskPool::held_elsewhere(mask_.image)) mask_.image.release();
    detail::clear_mask(size, mask_.image);
    dilated_.create(size, CV_8UC1);
    const int least_px = scaled_px(settings_.dilation_px + widening_px, size);
    cv::Rect region;
    for (const Instance& s : fused_) region |= s.box;
    if (!region.empty()) {
      const cv::Rect grown = grow_rect(region, least_px, size);
      cv::Mat all = mask_.image(grown);
      detail::dilate_square(undilated_(grown), least_px, all);
    }
    for (const Instance& s : fused_) {
      const int px = dilation_of(s.blur, widening_px, size);
      if (px <= least_px) continue;
      const cv::Rect grown = grow_rect(s.box, px, size);
      one_.create(size, CV_8UC1);
      one_(grown).setTo(0);
      detail::add_to_mask(s.mask, s.box, one_);
      cv::Mat dilated = dilated_(grown), all = mask_.image(grown);
      detail::dilate_square(one_(grown), px, dilated);
      cv::bitwise_or(all, dilated, all);
    }
    mask_share_ = mask_.coverage();
  }

  // Of an instance, in pixels of the image: the settings' are those of one 640 wide.
  int dilation_of(Blur blur, int widening_px, const cv::Size& size) const {
    blur.motion_px /= pixel_scale(size);
    return scaled_px(settings_.dilation_of(blur) + widening_px, size);
  }

  Settings settings_;
  Camera camera_;
  FrameContext own_context_;
  InstanceRegion region_;
  DynamicMask mask_;
  std::vector<Instance> fused_;
  detail::MaskPool masks_;  // of fused_
  cv::Mat undilated_;
  cv::Mat one_, dilated_;  // an instance; what becomes of a mask
  double mask_share_ = 0;
  std::uint32_t status_ = kOk;
};

}  // namespace stillpoint
