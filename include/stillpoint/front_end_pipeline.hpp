// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <limits>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "stillpoint/core/config.hpp"
#include "stillpoint/core/frame_context.hpp"
#include "stillpoint/core/stopwatch.hpp"
#include "stillpoint/depth/depth_mask_fuser.hpp"
#include "stillpoint/front_end.hpp"
#include "stillpoint/motion/blur_meter.hpp"
#include "stillpoint/motion/ego_motion.hpp"
#include "stillpoint/motion/motion_check.hpp"
#include "stillpoint/objects/object_tracker.hpp"
#include "stillpoint/segmentation/dynamic_class.hpp"
#include "stillpoint/segmentation/segmentation_compensator.hpp"
#include "stillpoint/segmentation/segmentation_intake.hpp"

namespace stillpoint {
namespace detail {

/// What FrontEnd does with a frame before the keypoints: all stages up to the mask, in a row.
class FrontEndPipeline {
 public:
  FrontEndPipeline(const FrontEndSettings& settings, const Camera& camera, Segmenter* segmenter)
      : settings_(settings),
        segmenter_(segmenter),
        camera_(camera),
        ego_(ego_settings(settings), settings.sensor),
        motion_(settings.motion, settings.sensor),
        blur_(settings.blur, camera),
        intake_(settings.dynamic_classes, settings.late, settings.compensation,
                settings.use_compensation, camera),
        compensator_(settings.compensation, camera),
        tracker_(settings.objects, settings.sensor),
        fuser_(settings.depth, camera) {
    settings.check();
    if (camera.fx != 0 || camera.fy != 0) check_camera("FrontEnd", camera);
    check_dynamic_classes(settings.dynamic_classes,
                          segmenter ? segmenter->classes() : std::vector<std::string>());
  }

  void compute(const RgbdFrame& frame, const std::optional<Eigen::Isometry3d>& T_current_last) {
    check_frame(frame, camera_);
    Stopwatch stopwatch;
    const Segmentation& segmentation = intake_.ask(segmenter_, frame);
    const double ms = stopwatch.lap_ms();
    process(frame, segmentation, T_current_last);
    stats_.segmentation_ms = ms;
  }

  void compute(const RgbdFrame& frame, const Segmentation& segmentation,
               const std::optional<Eigen::Isometry3d>& T_current_last) {
    stats_.segmentation_ms = 0;
    intake_.ask_nobody();
    process(frame, segmentation, T_current_last);
  }

  void correct_pose(const Eigen::Isometry3d& T_world_camera) {
    ego_.correct(T_world_camera);
    stats_.status |= ego_.status();
    tracker_.place_changed();
    intake_.set_motion(ego_.motion());
    if (settings_.use_motion) motion_.correct(ego_);
  }

  const FrontEndSettings& settings() const { return settings_; }
  const DynamicMask& mask() const { return mask_; }
  const EgoMotion& ego_motion() const { return ego_; }
  const std::vector<Instance>& instances() const { return fuser_.instances(); }
  const std::vector<DynamicObject>& objects() const {
    return tracker_.objects(instances(), place());
  }
  FrameStats& stats() { return stats_; }

  cv::Mat raw_mask() const { return union_of(intake_.raw()); }
  cv::Mat movers_mask() const { return union_of(motion_.found()); }
  cv::Mat mended_mask() const {
    return union_of(
        (settings_.use_compensation ? compensator_.mended() : intake_.taken()).instances);
  }
  cv::Mat undilated_mask() const { return fuser_.undilated().clone(); }

 private:
  cv::Mat union_of(const std::vector<Instance>& instances) const {
    return mask_from_instances(instances, mask_.image.size());
  }

  // The paper's Figure 2, with the motion check as a second source of instances; the keypoints
  // (3.3) follow in select().
  void process(const RgbdFrame& frame, const Segmentation& segmentation,
               const std::optional<Eigen::Isometry3d>& T_current_last) {
    check_frame(frame, camera_);
    check_segmentation(segmentation, frame);
    tracker_.finish(place());
    Stopwatch stopwatch;
    context_.begin(frame, camera_);
    ego_.track(context_, T_current_last);
    if (settings_.use_motion) motion_.find(context_, ego_);
    stats_.motion_ms = stopwatch.lap_ms();

    blur_.measure(context_);
    intake_.take(context_, segmentation, motion_.found(), compensator_.objects(),
                 (ego_.status() & kTimestampOrder) != 0);
    const Segmentation& instances = compensate();  // 3.1
    stats_.compensation_ms = stopwatch.lap_ms();

    fuse(instances);  // 3.2
    stats_.depth_ms = stopwatch.lap_ms();

    if (settings_.use_motion) {
      motion_.remember(fuser_.undilated());
      ego_.remember(fuser_.undilated());
    }
    stats_.motion_ms += stopwatch.lap_ms();
    intake_.remember(compensator_.objects());
    tracker_.observe(context_, fuser_.instances(), memory_ids());
    report(instances.instances.size());
  }

  const Segmentation& compensate() {
    if (settings_.use_compensation) return compensator_.mend(context_, intake_.taken());
    for (Instance& s : intake_.taken().instances) s.blur = context_.blur.in(s.box);
    return intake_.taken();
  }

  void fuse(const Segmentation& instances) {
    mask_.image.release();  // for the fuser to use it again, unless the caller holds it
    const DynamicMask& fused =
        fuser_.fuse(context_, instances, settings_.use_depth, intake_.widening_px());
    if (settings_.use_compensation)
      compensator_.remember(
          context_, settings_.compensation.use_depth ? fuser_.instances() : instances.instances);
    mask_.image = fused.image;
    mask_.timestamp = fused.timestamp;
    mask_.age_s = intake_.age_s();
  }

  const std::vector<int>& memory_ids() const {
    static const std::vector<int> none;
    return settings_.use_compensation ? compensator_.ids() : none;
  }

  CameraPlace place() const {
    return {ego_.pose(), ego_.pose_at(context_.frame.depth_time()), ego_.chain(),
            ego_.T_host_world()};
  }

  static EgoMotionSettings ego_settings(const FrontEndSettings& settings) {
    EgoMotionSettings ego = settings.ego;
    ego.measure = ego.measure && settings.use_motion;
    return ego;
  }

  void report(std::size_t instances) {
    stats_.timestamp = context_.frame.timestamp;
    stats_.blur = context_.blur.whole;
    stats_.segmenter_error = intake_.error();
    stats_.status = fuser_.status() | intake_.status() | ego_.status();
    stats_.moving = static_cast<int>(motion_.found().size());
    stats_.restored = 0;
    if (settings_.use_compensation) {
      stats_.status |= compensator_.status();
      stats_.restored = compensator_.restored();
    }
    stats_.instances = static_cast<int>(instances);
    stats_.mask_age_s = mask_.age_s;
    stats_.mask_share = fuser_.mask_share();
    if (stats_.mask_share > settings_.large_mask_share) stats_.status |= kMaskTooLarge;
    const DepthDelay& delay = motion_.delay();
    stats_.depth_delay_s = delay.known() ? delay.mean_s : std::numeric_limits<double>::quiet_NaN();
    const DepthReadout& readout = motion_.readout();
    stats_.depth_readout_s =
        readout.known() ? readout.mean_s : std::numeric_limits<double>::quiet_NaN();
    stats_.keypoints = stats_.kept = 0;
    stats_.probability_ms = 0;
  }

  FrontEndSettings settings_;
  Segmenter* segmenter_;
  Camera camera_;
  FrameContext context_;
  EgoMotion ego_;
  MotionCheck motion_;
  BlurMeter blur_;
  SegmentationIntake intake_;
  SegmentationCompensator compensator_;
  mutable ObjectTracker tracker_;  // objects() is computed when it is asked for
  DepthMaskFuser fuser_;
  DynamicMask mask_;
  FrameStats stats_;
};

}  // namespace detail

STILLPOINT_INLINE FrontEnd::FrontEnd(const Settings& settings, const Camera& camera,
                                     Segmenter* segmenter, detail::EigenAlignmentHere)
    : pipeline_(std::make_unique<detail::FrontEndPipeline>(settings, camera, segmenter)),
      filter_(settings.probability) {}
STILLPOINT_INLINE FrontEnd::~FrontEnd() = default;
STILLPOINT_INLINE FrontEnd::FrontEnd(FrontEnd&&) noexcept = default;
STILLPOINT_INLINE FrontEnd& FrontEnd::operator=(FrontEnd&&) noexcept = default;

STILLPOINT_INLINE const FrontEndSettings& FrontEnd::settings() const {
  return pipeline_->settings();
}

STILLPOINT_INLINE const DynamicMask& FrontEnd::compute_mask(
    const RgbdFrame& frame, const std::optional<Eigen::Isometry3d>& T_current_last) {
  pipeline_->compute(frame, T_current_last);
  return mask();
}

STILLPOINT_INLINE const DynamicMask& FrontEnd::compute_mask(
    const RgbdFrame& frame, const Segmentation& segmentation,
    const std::optional<Eigen::Isometry3d>& T_current_last) {
  pipeline_->compute(frame, segmentation, T_current_last);
  return mask();
}

STILLPOINT_INLINE void FrontEnd::correct_pose(const Eigen::Isometry3d& T_world_camera) {
  pipeline_->correct_pose(T_world_camera);
}

STILLPOINT_INLINE const DynamicMask& FrontEnd::mask() const { return pipeline_->mask(); }
STILLPOINT_INLINE cv::Mat FrontEnd::raw_mask() const { return pipeline_->raw_mask(); }
STILLPOINT_INLINE cv::Mat FrontEnd::movers_mask() const { return pipeline_->movers_mask(); }
STILLPOINT_INLINE cv::Mat FrontEnd::mended_mask() const { return pipeline_->mended_mask(); }
STILLPOINT_INLINE cv::Mat FrontEnd::undilated_mask() const { return pipeline_->undilated_mask(); }

STILLPOINT_INLINE const EgoMotion& FrontEnd::ego_motion() const { return pipeline_->ego_motion(); }
STILLPOINT_INLINE const std::vector<Instance>& FrontEnd::instances() const {
  return pipeline_->instances();
}
STILLPOINT_INLINE const std::vector<DynamicObject>& FrontEnd::objects() const {
  return pipeline_->objects();
}
STILLPOINT_INLINE const FrameStats& FrontEnd::stats() const { return pipeline_->stats(); }
STILLPOINT_INLINE FrameStats& FrontEnd::stats_of_frame() { return pipeline_->stats(); }

}  // namespace stillpoint
