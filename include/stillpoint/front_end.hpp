// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "stillpoint/core/camera.hpp"
#include "stillpoint/core/frame.hpp"
#include "stillpoint/core/frame_context.hpp"
#include "stillpoint/core/frame_stats.hpp"
#include "stillpoint/core/image_scale.hpp"
#include "stillpoint/core/instance.hpp"
#include "stillpoint/core/mask.hpp"
#include "stillpoint/core/object.hpp"
#include "stillpoint/core/selection.hpp"
#include "stillpoint/core/status.hpp"
#include "stillpoint/core/stopwatch.hpp"
#include "stillpoint/depth/depth_mask_fuser.hpp"
#include "stillpoint/front_end_settings.hpp"
#include "stillpoint/keypoints/grid_neighbor_search.hpp"
#include "stillpoint/keypoints/probabilistic_keypoint_filter.hpp"
#include "stillpoint/keypoints/tracked_points.hpp"
#include "stillpoint/motion/blur_meter.hpp"
#include "stillpoint/motion/ego_motion.hpp"
#include "stillpoint/motion/motion_check.hpp"
#include "stillpoint/objects/object_tracker.hpp"
#include "stillpoint/segmentation/dynamic_class.hpp"
#include "stillpoint/segmentation/segmentation_compensator.hpp"
#include "stillpoint/segmentation/segmentation_intake.hpp"
#include "stillpoint/segmentation/segmenter.hpp"

namespace stillpoint {

/// The paper's Figure 2 in a row: segmenter, missed-segmentation compensation (3.1), depth-semantic
/// fusion (3.2), probability-based keypoint filter (3.3).
///
/// Two calls per frame: compute_mask(), then select() on the host's keypoints. Without a segmenter
/// the caller brings the segmentation. Not thread-safe; one object per camera. Without the motion
/// check it allocates no image after the first few frames, only rows and coarse grids; with it,
/// some of the frame's size.
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
        ego_(ego_settings(settings), settings.sensor),
        motion_(settings.motion, settings.sensor),
        blur_(settings.blur, camera),
        intake_(settings.dynamic_classes, settings.late, settings.compensation,
                settings.use_compensation, camera),
        compensator_(settings.compensation, camera),
        tracker_(settings.objects, settings.sensor),
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
    check_frame(frame);
    Stopwatch stopwatch;
    const Segmentation& segmentation = intake_.ask(segmenter_, frame);
    const double ms = stopwatch.lap_ms();
    process(frame, segmentation, T_current_last);
    stats_.segmentation_ms = ms;
    return mask();
  }

  /// The same with a segmentation that the caller brings. Throws Error if it does not fit the
  /// frame.
  const DynamicMask& compute_mask(
      const RgbdFrame& frame, const Segmentation& segmentation,
      const std::optional<Eigen::Isometry3d>& T_current_last = std::nullopt) {
    stats_.segmentation_ms = 0;
    intake_.ask_nobody();
    process(frame, segmentation, T_current_last);
    return mask();
  }

  /// Tells the pose that the host tracked for the last frame, for the motion check and for late
  /// segmentations. The origin is the host's own; a jump (loop closing, relocalisation) is noticed.
  /// A pose that is not finite, or no rigid motion, is refused: kPoseRefused.
  void correct_pose(const Eigen::Isometry3d& T_world_camera) {
    ego_.correct(T_world_camera);
    stats_.status |= ego_.status();
    tracker_.place_changed();
    intake_.set_motion(ego_.motion());
    if (settings_.use_motion) motion_.correct(ego_);
  }

  /// Judges the host's keypoints against the last mask; see ProbabilisticKeypointFilter::filter().
  template <class Keypoints>
  const Selection& select(const Keypoints& keypoints) {
    Stopwatch stopwatch;
    const Selection& selection = filter_.filter(keypoints, mask(), settings_.use_probability);
    stats_.probability_ms = stopwatch.lap_ms();
    stats_.status |= filter_.status();
    stats_.keypoints = static_cast<int>(selection.size());
    stats_.kept = static_cast<int>(selection.kept.size());
    return selection;
  }

  /// The same for points that are tracked from image to image (KLT): `before[i]`, in pixels, is
  /// where the point now[i] was in the last frame, NaN if it is new. Drops a point also one frame
  /// before it is in the mask (KeypointReason::kEntering): a tracker drags points along there.
  /// Throws Error unless there is one point before for each now.
  template <class Keypoints, class Before>
  const Selection& select_tracked(const Keypoints& now, const Before& before) {
    tracked_ = select(now);
    const int reach = scaled_px(kReachPx, mask_.image.size());
    parts_.clear();
    for (const DynamicObject& o : objects())
      parts_.push_back(
          {{o.box.x - reach, o.box.y - reach, o.box.width + 2 * reach, o.box.height + 2 * reach},
           o.shift_px});
    drop_entering(now, before, mask(), parts_, settings_.probability.min_kept, tracked_);
    stats_.kept = static_cast<int>(tracked_.kept.size());
    return tracked_;
  }

  /// The dynamic mask of the last frame.
  const DynamicMask& mask() const { return mask_; }
  // The mask on its way, for evaluation and images: unions of masks, H x W, CV_8UC1, 255 =
  // dynamic. O(pixels).
  /// The segmenter's own, of dynamic classes.
  cv::Mat raw_mask() const { return union_of(intake_.raw()); }
  /// What the motion check found.
  cv::Mat movers_mask() const { return union_of(motion_.found()); }
  /// Both, mended by the compensation.
  cv::Mat mended_mask() const {
    return union_of(
        (settings_.use_compensation ? compensator_.mended() : intake_.taken()).instances);
  }
  /// The mask after compensation and depth fusion, before dilation.
  cv::Mat undilated_mask() const { return fuser_.undilated().clone(); }
  /// Where the camera is by all that is known, and how it moves.
  const EgoMotion& ego_motion() const { return ego_; }
  /// The objects of the last frame with their final masks, before dilation, and their blur.
  const std::vector<Instance>& instances() const { return fuser_.instances(); }
  /// The objects of the last frame with ids, places and velocities. Ask after correct_pose(), which
  /// makes the places better. An instance without a name that lies on another is none of its own.
  /// With what compute_mask() does for it, it costs a hundredth of the extraction of 3000 ORB
  /// keypoints (BM_Objects). The reference stays valid until the next frame.
  const std::vector<DynamicObject>& objects() const {
    return tracker_.objects(instances(), place());
  }
  /// What was done with the last frame.
  const FrameStats& stats() const { return stats_; }

 private:
  // How far a mask may reach beyond its object, in an image 640 wide.
  static constexpr int kReachPx = 30;

  cv::Mat union_of(const std::vector<Instance>& instances) const {
    return mask_from_instances(instances, mask_.image.size());
  }

  // The paper's Figure 2, with the motion check as a second source of instances; the keypoints
  // (3.3) follow in select().
  void process(const RgbdFrame& frame, const Segmentation& segmentation,
               const std::optional<Eigen::Isometry3d>& T_current_last) {
    check_frame(frame);
    check_segmentation(segmentation, frame.color.size());
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

  static EgoMotionSettings ego_settings(const Settings& settings) {
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
  SegmentationIntake intake_;
  SegmentationCompensator compensator_;
  mutable ObjectTracker tracker_;  // objects() is computed when it is asked for
  DepthMaskFuser fuser_;
  ProbabilisticKeypointFilter<NeighborSearch> filter_;
  DynamicMask mask_;
  Selection tracked_;
  std::vector<MaskMotion> parts_;
  FrameStats stats_;
};

/// The front end with the library's own neighbor search.
using FrontEnd = BasicFrontEnd<>;

}  // namespace stillpoint
