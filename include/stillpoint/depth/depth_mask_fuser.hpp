// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "stillpoint/core/bit_mask.hpp"
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
  /// Error if instances do not fit the picture. Strongly blurred instances are dilated more;
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

  /// The same for a frame of which more is known: an object with a name does not grow into what
  /// `context.labels` knows to be static, and finds nothing of itself there if it is a bare box.
  const DynamicMask& fuse(const FrameContext& context, const Segmentation& segmentation,
                          bool use_depth = true, int widening_px = 0) {
    const DepthView& depth = context.depth;
    check_segmentation(segmentation, context.size());
    mask_.timestamp = context.frame.timestamp;
    mask_.age_s = 0;
    union_.reset(context.size());
    widening_px = std::max(0, widening_px);
    const std::size_t n = segmentation.instances.size();
    const bool has_depth = use_depth && !depth.empty();
    status_ = depth.empty() ? kNoDepth : kOk;
    if (has_depth) {
      if (!depth.any_measured(segmentation.instances)) status_ = kNoDepth;
      region_.begin_frame(depth, segmentation.instances, context.T_current_last);
    }
    fused_.resize(n);
    for (Instance& s : fused_) s.mask.release();
    cv::Rect region;
    for (std::size_t i = 0; i < n; ++i) {
      if (has_depth) {
        region_.fuse(depth, segmentation.instances[i], context.labels, masks_, fused_[i], union_);
      } else {
        fused_[i] = segmentation.instances[i];
        union_.add(fused_[i].mask, fused_[i].box);
      }
      region |= fused_[i].box;
    }
    const int dilation_px = scaled_px(settings_.dilation_px + widening_px, context.size());
    write(region, dilation_px);
    for (const Instance& s : fused_)
      if (const int wider_px = dilation_of(s.blur, widening_px, context.size());
          wider_px > dilation_px)
        widen(s, wider_px);
    detail::copy_apart(written_, mask_.image);
    return mask_;
  }

  /// The mask of the last fuse() before dilation: H x W, CV_8UC1, 255 = dynamic. The first call
  /// after a fuse() writes it, O(pixels of the boxes), and the next fuse() overwrites it.
  const cv::Mat& undilated() const {
    if (undilated_up_to_date_) return undilated_;
    undilated_up_to_date_ = true;
    if (undilated_.size() != union_.size()) {
      undilated_ = cv::Mat::zeros(union_.size(), CV_8UC1);
    } else {
      clear(undilated_, undilated_px_, region_px_);
    }
    undilated_px_ = region_px_;
    const cv::Rect& r = region_px_;
    for (int y = r.y; y < r.y + r.height; ++y)
      detail::unpack(union_.row(y), static_cast<std::size_t>(r.x),
                     static_cast<std::size_t>(r.width), undilated_.ptr<uchar>(y) + r.x);
    return undilated_;
  }
  /// The instances of the last fuse() with their new masks (before dilation), in the order given.
  const std::vector<Instance>& instances() const { return fused_; }
  /// Share of the picture that the dilated mask of the last fuse() covers.
  double mask_share() const {
    return mask_.image.empty() ? 0 : covered_px_ / static_cast<double>(mask_.image.total());
  }
  /// kNoDepth or kOk, of the last fuse().
  std::uint32_t status() const { return status_; }

 private:
  // Of an instance, in pixels of the image: the settings' are those of one 640 wide.
  int dilation_of(Blur blur, int widening_px, const cv::Size& size) const {
    blur.motion_px /= pixel_scale(size);
    return scaled_px(settings_.dilation_of(blur) + widening_px, size);
  }

  // Writes the dilated union of the instances, all of which lie in `region`, as bytes.
  void write(const cv::Rect& region, int dilation_px) {
    const cv::Size size = union_.size();
    const cv::Rect grown = region.empty() ? region : grow_rect(region, dilation_px, size);
    if (written_.size() != size)
      written_ = cv::Mat::zeros(size, CV_8UC1);
    else
      clear(written_, grown_px_, grown);
    region_px_ = region, grown_px_ = grown;
    undilated_up_to_date_ = false;
    covered_px_ = 0;
    dilation_.run(union_, region, dilation_px, [&](int y, const std::uint64_t* row) {
      uchar* to = written_.ptr<uchar>(y);
      for (int x = dilation_.left(); x < grown.x + grown.width; x += 64, ++row) {
        const int n = std::min(64, size.width - x);
        detail::unpack_word(*row, static_cast<std::size_t>(n), to + x);
        covered_px_ += ~*row == 0 ? 64 : *row == 0 ? 0 : detail::count_bits(*row);
      }
    });
  }

  // Adds an instance that is dilated more than the others.
  void widen(const Instance& instance, int dilation_px) {
    one_.reset(union_.size());
    one_.add(instance.mask, instance.box);
    const cv::Rect grown = grow_rect(instance.box, dilation_px, one_.size());
    grown_px_ |= grown;
    dilation_.run(one_, instance.box, dilation_px, [&](int y, const std::uint64_t* row) {
      uchar* to = written_.ptr<uchar>(y);
      for (int x = dilation_.left(); x < grown.x + grown.width; x += 64, ++row) {
        if (*row == 0) continue;
        const std::size_t n = static_cast<std::size_t>(std::min(64, one_.size().width - x));
        const std::uint64_t before = detail::pack_word(to + x, n);
        const std::uint64_t added = *row & ~before;
        if (added == 0) continue;
        detail::unpack_word(before | added, n, to + x);
        covered_px_ += detail::count_bits(added);
      }
    });
  }

  // Only what the last frame wrote, and this one does not write, needs to be cleared.
  static void clear(cv::Mat& image, const cv::Rect& written, const cv::Rect& next) {
    for (int y = written.y; y < written.y + written.height; ++y) {
      const auto zero = [&](int x0, int x1) {
        if (x0 < x1) std::memset(image.ptr<uchar>(y) + x0, 0, static_cast<std::size_t>(x1 - x0));
      };
      const int end = written.x + written.width;
      if (y < next.y || y >= next.y + next.height) {
        zero(written.x, end);
      } else {
        zero(written.x, std::min(end, next.x));
        zero(std::max(written.x, next.x + next.width), end);
      }
    }
  }

  Settings settings_;
  Camera camera_;
  FrameContext own_context_;
  InstanceRegion region_;
  DynamicMask mask_;
  std::vector<Instance> fused_;
  detail::MaskPool masks_;         // of fused_
  cv::Mat written_;                // the dilated mask; the caller gets a copy
  detail::BitMask union_, one_;    // of the instances, and of one of them
  cv::Rect region_px_, grown_px_;  // what the last fuse() found, and what it wrote dilated
  // Not everyone asks for it.
  mutable cv::Mat undilated_;
  mutable cv::Rect undilated_px_;  // what is written there
  mutable bool undilated_up_to_date_ = true;
  int covered_px_ = 0;
  detail::Dilation dilation_;
  std::uint32_t status_ = kOk;
};

}  // namespace stillpoint
