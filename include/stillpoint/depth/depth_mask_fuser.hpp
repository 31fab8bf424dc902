// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cstdint>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <vector>

#include "stillpoint/core/frame_context.hpp"
#include "stillpoint/core/image_scale.hpp"
#include "stillpoint/core/instance.hpp"
#include "stillpoint/core/mask.hpp"
#include "stillpoint/core/mask_pool.hpp"
#include "stillpoint/core/status.hpp"
#include "stillpoint/depth/depth_mask_fuser_settings.hpp"
#include "stillpoint/depth/depth_samples.hpp"
#include "stillpoint/depth/floor_plane.hpp"
#include "stillpoint/depth/mask_dilation.hpp"
#include "stillpoint/depth/object_depth_range.hpp"
#include "stillpoint/depth/object_region.hpp"
#include "stillpoint/depth/region_pixels.hpp"

namespace stillpoint {

/// Makes the dynamic mask of a frame from its instances and its depth (paper section 3.2).
///
/// Paper preset: per box the mean of stratified depth samples gives a range; the box's pixels in
/// that range join the mask. Default preset: the samples on the instance's own mask give the range;
/// the mask loses what lies clearly behind or before the person, and grows into what is connected
/// with it in depth, but not into the floor. Which depth range an object has (ObjectDepthRange),
/// which other parts of the mask belong to it and how far it grows (ObjectRegion) is decided on
/// cells with one depth sample each; what is at its rim on pixels (RegionPixels). Then both are
/// dilated.
///
/// 16-bit depth is read as it is with the frame's scale, CV_32FC1 as metres; 0 and NaN are "no
/// measurement". Deterministic for a seed. Cost: O(pixels of the boxes) and one dilation of their
/// union. Keeps its images: after the first frames only OpenCV's filters allocate, a few rows. Not
/// thread-safe.
class DepthMaskFuser {
 public:
  using Settings = DepthMaskFuserSettings;

  /// `camera` tells the focal length for the reach of the growth and for the floor; without it
  /// 0.9 times the image's width is assumed.
  explicit DepthMaskFuser(const Settings& settings = {}, const Camera& camera = {})
      : settings_(settings), camera_(camera), samples_(settings.cell_px, settings.seed) {
    settings.check();
  }

  const Settings& settings() const { return settings_; }

  /// Fuses one frame. Without depth, which status() tells by kNoDepth, or with `use_depth` false,
  /// the mask is the union of the instances' masks (of their boxes, where they have none). Throws
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
  /// box finds nothing of an object there. What the labels say is too near to be measured joins the
  /// mask; it is no instance.
  const DynamicMask& fuse(const FrameContext& context, const Segmentation& segmentation,
                          bool use_depth = true, int widening_px = 0) {
    check_segmentation(segmentation, context.frame);
    widening_px = std::max(0, widening_px);
    mask_.timestamp = context.frame.timestamp;
    mask_.age_s = 0;
    find_instances(context, segmentation, use_depth);
    dilate(context.size(), widening_px);
    add_near(context.labels);
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
    status_ = depth.any_measured(segmentation.instances) ? kOk : kNoDepth;
    use_depth = use_depth && !depth.empty();
    carry_floor(context.T_current_last);
    if (use_depth) begin_depth(depth, segmentation.instances);
    undilated_.create(context.size(), CV_8UC1);
    undilated_.setTo(0);
    fused_ = segmentation.instances;
    for (const bool movers : {false, true})
      for (Instance& s : fused_) {
        if (s.class_name.empty() != movers) continue;
        if (use_depth && movers && take_what_was_found(s)) continue;
        if (use_depth) find_mask(context.labels, s);
        detail::add_to_mask(s, undilated_);
      }
  }

  // Most movers are people whom the segmenter has seen, too. Of one that is nearly covered by what
  // was found of the objects before it, that is its mask; nothing else needs to be found.
  bool take_what_was_found(Instance& mover) {
    if (mover.mask.empty()) return false;
    cv::Mat both = masks_.take(mover.box.size());
    cv::bitwise_and(mover.mask, undilated_(mover.box), both);
    if (cv::countNonZero(both) < kNearlyAll * cv::countNonZero(mover.mask)) return false;
    mover.mask = both;
    return true;
  }

  // The floor of an earlier frame is known as long as every motion since is.
  void carry_floor(const std::optional<Eigen::Isometry3d>& T_current_last) {
    floor_carried_ = floor_carried_ && T_current_last;
    if (T_current_last) floor_ = floor_.moved(*T_current_last);
  }

  // Takes the samples and finds the floor.
  void begin_depth(const DepthView& depth, const std::vector<Instance>& instances) {
    const int cell_px = std::max(settings_.cell_px, scaled_px(settings_.cell_px, depth.size()));
    if (cell_px != samples_.cell_px()) samples_ = DepthSamples(cell_px, settings_.seed);
    if (instances.empty()) return;
    samples_.begin(depth);
    if (settings_.method == Settings::Method::kPaper) return;
    collect_floor_samples(depth, instances, floor_samples_);
    floor_ = find_floor(floor_samples_, floor_, settings_.seed, floor_carried_);
    floor_carried_ = true;
  }

  // Turns the mask of an instance, or its bare box, into what is the object's in depth.
  void find_mask(const CellLabels& labels, Instance& instance) {
    const bool paper = settings_.method == Settings::Method::kPaper;
    DepthRange range;
    if (!paper && ranges_.find_on_mask(samples_, instance, labels, states_, range))
      return find_connected(labels, range, instance);
    const bool in_box =
        paper && ranges_.find_in_box(samples_, instance.box, settings_.range_m, range);
    const cv::Mat own = instance.mask;
    instance.mask = masks_.take(instance.box.size());
    // Without depth to judge by, a mask stays as it is, and a bare box is full.
    if (own.empty())
      instance.mask.setTo(in_box ? 0 : 255);
    else
      own.copyTo(instance.mask);
    if (!in_box) return;
    // The paper's: every pixel of the box whose depth is in the range.
    const DepthView& depth = samples_.depth();
    in_range_.create(depth.size(), CV_8UC1);  // of the image's size, to be allocated once
    cv::Mat in_range = in_range_(instance.box);
    cv::inRange(depth.image()(instance.box), std::max(1, depth.first_units(range.lo_m)),
                depth.last_units(range.hi_m), in_range);
    cv::bitwise_or(instance.mask, in_range, instance.mask);
  }

  // The default: what is connected in depth with the samples on the mask. The box may become
  // larger.
  void find_connected(const CellLabels& labels, const DepthRange& range, Instance& instance) {
    const DepthView& depth = samples_.depth();
    const int cell_px = samples_.cell_px();
    const float cells_per_m = depth.focal_px() / range.middle_m / static_cast<float>(cell_px);
    const int reach = std::max(1, static_cast<int>(settings_.growth_m * cells_per_m + 0.5f));
    const bool bare = instance.mask.empty();
    region_.begin(samples_, floor_, instance.box, (bare ? 1 : reach + 1) * cell_px, range, states_);
    if (!bare) {
      const float slack_m = instance.predicted ? kPredictedSlackM : 0;
      region_.keep_parts(static_cast<int>(slack_m * cells_per_m + 0.5f));
    }
    // What has no name was found by its motion, the better evidence: the part of a person that is
    // held still is taken for static, too.
    region_.grow(range, settings_.range_m, reach, labels, instance.class_name.empty());
    const cv::Rect area = cv::Rect(region_.used().tl() * cell_px, region_.used().size() * cell_px) &
                          cv::Rect(cv::Point(), depth.size());
    cv::Mat mask = masks_.take(area.size());
    pixels_.find(region_, instance, area, mask);
    instance.box = area, instance.mask = mask;
  }

  // All instances at once, and those once more that are dilated more than the others.
  void dilate(const cv::Size& size, int widening_px) {
    const int least_px = scaled_px(settings_.dilation_px + widening_px, size);
    cv::Rect region;
    for (const Instance& s : fused_) region |= s.box;
    dilation_.begin(size);
    dilation_.add(undilated_(region), region, least_px);
    for (const Instance& s : fused_) {
      Blur blur = s.blur;
      blur.motion_px /= pixel_scale(size);  // the settings' pixels are those of an image 640 wide
      const int px = scaled_px(settings_.dilation_of(blur) + widening_px, size);
      if (px <= least_px) continue;
      dilation_.add(s.mask.empty() ? cv::Mat(s.box.size(), CV_8UC1, cv::Scalar(255)) : s.mask,
                    s.box, px);
    }
    if (detail::MaskPool::held_elsewhere(mask_.image)) mask_.image.release();
    mask_.image.create(size, CV_8UC1);
    mask_share_ = dilation_.write(mask_.image) / static_cast<double>(size.area());
  }

  // Not dilated: what is too near for the sensor is a hole in its depth that is wider than the
  // body.
  void add_near(const CellLabels& labels) {
    if (!labels.add_near(undilated_)) return;
    labels.add_near(mask_.image);
    mask_share_ = cv::countNonZero(mask_.image) / static_cast<double>(mask_.image.size().area());
  }

  static constexpr double kNearlyAll = 0.9;
  static constexpr float kPredictedSlackM = 0.06f;  // how far off a predicted mask may be

  Settings settings_;
  Camera camera_;
  FrameContext own_context_;
  DepthSamples samples_;
  std::vector<InverseSample> floor_samples_;
  InversePlane floor_;
  bool floor_carried_ = false;  // from the frame that it was found in to the last one
  ObjectDepthRange ranges_;
  CellStates states_;
  ObjectRegion region_;
  RegionPixels pixels_;
  DynamicMask mask_;
  std::vector<Instance> fused_;
  detail::MaskPool masks_;  // of fused_
  cv::Mat undilated_;
  cv::Mat in_range_;
  MaskDilation dilation_;
  double mask_share_ = 0;
  std::uint32_t status_ = kOk;
};

}  // namespace stillpoint
