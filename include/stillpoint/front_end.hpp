// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <exception>
#include <limits>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "stillpoint/core/blur.hpp"
#include "stillpoint/core/camera.hpp"
#include "stillpoint/core/frame.hpp"
#include "stillpoint/core/frame_context.hpp"
#include "stillpoint/core/frame_stats.hpp"
#include "stillpoint/core/instance.hpp"
#include "stillpoint/core/mask.hpp"
#include "stillpoint/core/selection.hpp"
#include "stillpoint/core/status.hpp"
#include "stillpoint/depth/depth_mask_fuser.hpp"
#include "stillpoint/front_end_settings.hpp"
#include "stillpoint/keypoints/grid_neighbor_search.hpp"
#include "stillpoint/keypoints/probabilistic_keypoint_filter.hpp"
#include "stillpoint/motion/blur_meter.hpp"
#include "stillpoint/motion/ego_motion.hpp"
#include "stillpoint/motion/motion_check.hpp"
#include "stillpoint/segmentation/dynamic_class.hpp"
#include "stillpoint/segmentation/forward_predictor.hpp"
#include "stillpoint/segmentation/segmentation_compensator.hpp"
#include "stillpoint/segmentation/segmenter.hpp"
#include "stillpoint/segmentation/sudden_object_filter.hpp"
#include "stillpoint/sensor/sensor_model.hpp"

namespace stillpoint {

/// The paper's Figure 2 in a row: segmenter, missed-segmentation compensation (3.1), depth-semantic
/// fusion (3.2), probability-based keypoint filter (3.3).
///
/// Two calls per frame: compute_mask(), then select() on the host's keypoints. Without a segmenter
/// the caller brings the segmentation. Not thread-safe; one object per camera. After the first few
/// frames it does not allocate.
template <class NeighborSearch = GridNeighborSearch>
class BasicFrontEnd {
 public:
  using Settings = FrontEndSettings;

  /// `camera` may be left out (see DepthMaskFuser and SegmentationCompensator); `segmenter` is not
  /// owned and may be null. Throws Error if a setting makes no sense, or a dynamic class is none of
  /// the segmenter's.
  explicit BasicFrontEnd(const Settings& settings = {}, const Camera& camera = {},
                         Segmenter* segmenter = nullptr)
      : settings_(settings),
        segmenter_(segmenter),
        camera_(camera),
        ego_(ego_settings(settings)),
        motion_(settings.motion, settings.sensor),
        blur_(settings.blur, camera),
        predictor_(settings.late, settings.compensation, camera),
        sudden_(settings.compensation),
        compensator_(settings.compensation, camera),
        fuser_(settings.depth, camera),
        filter_(settings.probability) {
    check_dynamic_classes(settings.dynamic_classes,
                          segmenter ? segmenter->classes() : std::vector<std::string>());
  }

  // Its parts refer to each other's masks: one object, one camera.
  BasicFrontEnd(const BasicFrontEnd&) = delete;
  BasicFrontEnd& operator=(const BasicFrontEnd&) = delete;
  BasicFrontEnd(BasicFrontEnd&&) = default;
  BasicFrontEnd& operator=(BasicFrontEnd&&) = default;

  const Settings& settings() const { return settings_; }

  /// Asks the segmenter, then computes the frame's dynamic mask. A segmenter that throws counts as
  /// one without a result. `T_current_last` maps points of the last frame's camera into this one's,
  /// if the host can predict it.
  const DynamicMask& compute_mask(
      const RgbdFrame& frame,
      const std::optional<Eigen::Isometry3d>& T_current_last = std::nullopt) {
    const Clock::time_point start = Clock::now();
    stats_.segmenter_error.clear();
    check_frame(frame);
    std::uint32_t failed = kOk;
    if (segmenter_) {
      try {
        segmented_ = segmenter_->segment(frame);
        check_segmentation(segmented_, frame.color.size());
      } catch (const std::exception& error) {
        segmented_ = Segmentation();
        stats_.segmenter_error = error.what();
        failed = kSegmenterFailed;
      } catch (...) {
        segmented_ = Segmentation();
        stats_.segmenter_error = "an exception that is not a std::exception";
        failed = kSegmenterFailed;
      }
    } else {
      segmented_ = Segmentation();
    }
    const double ms = milliseconds_since(start);
    process(frame, segmented_, T_current_last);
    stats_.segmentation_ms = ms;
    stats_.status |= failed;
    return mask();
  }

  /// The same with a segmentation that the caller brings. Throws Error if it does not fit the
  /// frame.
  const DynamicMask& compute_mask(
      const RgbdFrame& frame, const Segmentation& segmentation,
      const std::optional<Eigen::Isometry3d>& T_current_last = std::nullopt) {
    stats_.segmenter_error.clear();
    stats_.segmentation_ms = 0;
    process(frame, segmentation, T_current_last);
    return mask();
  }

  /// Tells the pose that the host tracked for the last frame, for the motion check and for late
  /// segmentations. The origin is the host's own; a jump (loop closing, relocalisation) is noticed.
  /// A pose that is not finite, or no rigid motion, is refused: kPoseRefused.
  void correct_pose(const Eigen::Isometry3d& T_world_camera) {
    ego_.correct(T_world_camera);
    stats_.status |= ego_.status();
    predictor_.set_motion(ego_.motion());
    if (settings_.use_motion) motion_.correct(ego_);
  }

  /// Judges the host's keypoints against the last mask; see ProbabilisticKeypointFilter::filter().
  template <class Keypoints>
  const Selection& select(const Keypoints& keypoints) {
    const Clock::time_point start = Clock::now();
    const Selection& selection = filter_.filter(keypoints, mask(), settings_.use_probability);
    stats_.probability_ms = milliseconds_since(start);
    stats_.status |= filter_.status();
    stats_.keypoints = static_cast<int>(selection.size());
    stats_.kept = static_cast<int>(selection.kept.size());
    return selection;
  }

  /// The dynamic mask of the last frame.
  const DynamicMask& mask() const { return mask_; }
  // The mask on its way, for evaluation and pictures: unions of masks, H x W, CV_8UC1, 255 =
  // dynamic. O(pixels).
  /// The segmenter's own, of dynamic classes.
  cv::Mat raw_mask() const { return union_of(raw_instances_); }
  /// What the motion check found.
  cv::Mat movers_mask() const { return union_of(motion_.found()); }
  /// Both, mended by the compensation.
  cv::Mat mended_mask() const {
    return union_of((settings_.use_compensation ? compensator_.mended() : dynamic_).instances);
  }
  /// The mask after compensation and depth fusion, before dilation.
  cv::Mat undilated_mask() const { return fuser_.undilated().clone(); }
  /// Where the camera is by all that is known, and how it moves.
  const EgoMotion& ego_motion() const { return ego_; }
  /// The objects of the last frame with their final masks, before dilation, and their blur.
  const std::vector<Instance>& instances() const { return fuser_.instances(); }
  /// What was done with the last frame.
  const FrameStats& stats() const { return stats_; }

 private:
  using Clock = std::chrono::steady_clock;

  static double milliseconds_since(Clock::time_point start) {
    return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
  }

  cv::Mat union_of(const std::vector<Instance>& instances) const {
    return mask_from_instances(instances, mask_.image.size());
  }

  void process(const RgbdFrame& frame, const Segmentation& segmentation,
               const std::optional<Eigen::Isometry3d>& T_current_last) {
    check_frame(frame);
    check_segmentation(segmentation, frame.color.size());
    Clock::time_point start = Clock::now();
    context_.begin(frame, camera_);
    ego_.track(context_, T_current_last);
    if (settings_.use_motion) motion_.find(context_, ego_);
    stats_.motion_ms = milliseconds_since(start);

    start = Clock::now();
    blur_.measure(context_);
    keep_dynamic(segmentation);
    const Segmentation* instances = &dynamic_;  // the segmenter's and the movers
    if (settings_.use_compensation)
      instances = &compensator_.mend(context_, dynamic_);
    else
      for (Instance& s : dynamic_.instances) s.blur = context_.blur.in(s.box);
    stats_.compensation_ms = milliseconds_since(start);

    start = Clock::now();
    mask_.image.release();  // for the fuser to use it again, unless the caller holds it
    const DynamicMask& fused =
        fuser_.fuse(context_, *instances, settings_.use_depth, settings_.late.widening_px(age_s_));
    if (settings_.use_compensation)
      compensator_.remember(
          context_, settings_.compensation.use_depth ? fuser_.instances() : instances->instances);
    stats_.depth_ms = milliseconds_since(start);

    if (settings_.use_motion) {
      start = Clock::now();
      motion_.remember(fuser_.undilated());
      ego_.remember(fuser_.undilated());
      stats_.motion_ms += milliseconds_since(start);
    }

    mask_.image = fused.image;
    mask_.timestamp = frame.timestamp;
    mask_.age_s = age_s_;
    predictor_.remember(compensator_.objects());
    report(instances->instances.size());
  }

  // Of the segmentation, predicted forward if it is late, what is dynamic, and the movers.
  void keep_dynamic(const Segmentation& segmentation) {
    dynamic_.available = segmentation.available;
    dynamic_.timestamp = segmentation.timestamp;
    dynamic_.instances.clear();
    if (segmentation.available)
      for (const Instance& s : segmentation.instances)
        if (is_dynamic(s, settings_.dynamic_classes)) dynamic_.instances.push_back(s);
    raw_instances_ = dynamic_.instances;
    // Without a segmenter, nothing can come late.
    if (segmenter_ || &segmentation != &segmented_) predictor_.forward(context_, dynamic_);
    const std::vector<Instance>& movers = motion_.found();
    doubted_ = settings_.use_compensation && segmentation.available
                   ? sudden_.filter(dynamic_.timestamp, context_.size(), compensator_.objects(),
                                    movers, dynamic_.instances)
                   : 0;
    dynamic_.instances.insert(dynamic_.instances.end(), movers.begin(), movers.end());
    if (ego_.status() & kTimestampOrder)
      newest_result_s_ = -std::numeric_limits<double>::infinity();
    const double now_s = context_.frame.timestamp;
    if (dynamic_.available)
      newest_result_s_ = dynamic_.timestamp < now_s ? dynamic_.timestamp : now_s;
    age_s_ = now_s - newest_result_s_;
  }

  static EgoMotionSettings ego_settings(const Settings& settings) {
    EgoMotionSettings ego = settings.ego;
    ego.measure = ego.measure && settings.use_motion;
    return ego;
  }

  void report(std::size_t instances) {
    stats_.timestamp = context_.frame.timestamp;
    stats_.blur = context_.blur.whole;
    stats_.status = fuser_.status() | predictor_.status() | ego_.status();
    if (doubted_ > 0) stats_.status |= kObjectDoubted;
    stats_.moving = static_cast<int>(motion_.found().size());
    stats_.restored = 0;
    if (!dynamic_.available) stats_.status |= kNoSegmentation;
    if (std::isinf(age_s_)) stats_.status |= kNeverSegmented;
    if (settings_.use_compensation) {
      stats_.status |= compensator_.status();
      stats_.restored = compensator_.restored();
    }
    stats_.instances = static_cast<int>(instances);
    stats_.mask_age_s = mask_.age_s;
    stats_.mask_share = fuser_.mask_share();
    if (stats_.mask_share > settings_.large_mask_share) stats_.status |= kMaskTooLarge;
    stats_.keypoints = stats_.kept = 0;
    stats_.probability_ms = 0;
  }

  Settings settings_;
  Segmenter* segmenter_;
  Camera camera_;
  FrameContext context_;
  EgoMotion ego_;
  MotionCheck motion_;
  BlurMeter blur_;
  ForwardPredictor predictor_;
  SuddenObjectFilter sudden_;
  SegmentationCompensator compensator_;
  DepthMaskFuser fuser_;
  ProbabilisticKeypointFilter<NeighborSearch> filter_;
  Segmentation segmented_, dynamic_;
  std::vector<Instance> raw_instances_;
  DynamicMask mask_;
  int doubted_ = 0;  // instances of the last frame
  double newest_result_s_ = -std::numeric_limits<double>::infinity();
  double age_s_ = std::numeric_limits<double>::infinity();  // of it, at the last frame
  FrameStats stats_;
};

/// The front end with the library's own neighbor search.
using FrontEnd = BasicFrontEnd<>;

}  // namespace stillpoint
