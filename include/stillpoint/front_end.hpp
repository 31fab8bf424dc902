// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "stillpoint/core/camera.hpp"
#include "stillpoint/core/frame.hpp"
#include "stillpoint/core/frame_stats.hpp"
#include "stillpoint/core/image_scale.hpp"
#include "stillpoint/core/instance.hpp"
#include "stillpoint/core/mask.hpp"
#include "stillpoint/core/object.hpp"
#include "stillpoint/core/selection.hpp"
#include "stillpoint/core/status.hpp"
#include "stillpoint/core/stopwatch.hpp"
#include "stillpoint/front_end_settings.hpp"
#include "stillpoint/keypoints/probabilistic_keypoint_filter.hpp"
#include "stillpoint/keypoints/tracked_points.hpp"
#include "stillpoint/segmentation/segmenter.hpp"

namespace stillpoint {

class EgoMotion;

namespace detail {
class FrontEndPipeline;

// Part of a name that the linker sees: Eigen's types lie in memory as the vector instructions of
// the compiler's flags ask. Programs and stillpoint::compiled must agree, or do not link.
template <int kBytes>
struct EigenAlignment {};
using EigenAlignmentHere = EigenAlignment<EIGEN_MAX_ALIGN_BYTES>;
}  // namespace detail

/// The paper's Figure 2 in a row: segmenter, missed-segmentation compensation (3.1), depth-semantic
/// fusion (3.2), probability-based keypoint filter (3.3).
///
/// Two calls per frame: compute_mask(), then select() on the host's keypoints. Without a segmenter
/// the caller brings the segmentation. Not thread-safe; one object per camera; nothing but
/// destruction and assignment after it was moved from. Without the motion check it allocates no
/// image after the first few frames, only rows and coarse grids; with it, some of the frame's size.
///
/// Where its code is compiled: here, in each file that includes this header (some 30 s), or once,
/// for programs that link stillpoint::compiled (some 3 s). The results are the same.
class FrontEnd {
 public:
  using Settings = FrontEndSettings;

  /// `camera` may be left out (see DepthMaskFuser and SegmentationCompensator); `segmenter` is not
  /// owned and may be null. Throws Error if a setting or the camera makes no sense, or a dynamic
  /// class is none of the segmenter's.
  explicit FrontEnd(const Settings& settings = {}, const Camera& camera = {},
                    Segmenter* segmenter = nullptr)
      : FrontEnd(settings, camera, segmenter, detail::EigenAlignmentHere()) {}
  ~FrontEnd();

  // Its parts refer to each other's masks: one object, one camera.
  FrontEnd(FrontEnd&&) noexcept;
  FrontEnd& operator=(FrontEnd&&) noexcept;

  const Settings& settings() const;

  /// Asks the segmenter, then computes the frame's dynamic mask. A segmenter that throws counts as
  /// one without a result. `T_current_last` maps points of the last frame's camera into this one's,
  /// if the host can predict it. Throws Error if the frame is not as RgbdFrame says.
  const DynamicMask& compute_mask(
      const RgbdFrame& frame,
      const std::optional<Eigen::Isometry3d>& T_current_last = std::nullopt);

  /// The same with a segmentation that the caller brings. Throws Error if it does not fit the
  /// frame. Its masks are shared, not copied: leave them as they are until the next frame, or what
  /// instances() and objects() return may change with them.
  const DynamicMask& compute_mask(
      const RgbdFrame& frame, const Segmentation& segmentation,
      const std::optional<Eigen::Isometry3d>& T_current_last = std::nullopt);

  /// Tells the pose that the host tracked for the last frame, for the motion check and for late
  /// segmentations. The origin is the host's own; a jump (loop closing, relocalisation) is noticed.
  /// A pose that is not finite, or no rigid motion, is refused: kPoseRefused.
  void correct_pose(const Eigen::Isometry3d& T_world_camera);

  /// Judges the host's keypoints against the last mask; see ProbabilisticKeypointFilter::filter().
  template <class Keypoints>
  const Selection& select(const Keypoints& keypoints) {
    Stopwatch stopwatch;
    const Selection& selection = filter_.filter(keypoints, mask(), settings().use_probability);
    FrameStats& stats = stats_of_frame();
    stats.probability_ms = stopwatch.lap_ms();
    constexpr std::uint32_t kOfTheFilter = kNoKeypoints | kKeypointFloor;
    stats.status = (stats.status & ~kOfTheFilter) | filter_.status();
    stats.keypoints = static_cast<int>(selection.size());
    stats.kept = static_cast<int>(selection.kept.size());
    return selection;
  }

  /// The same for points that are tracked from image to image (KLT): `before[i]`, in pixels, is
  /// where the point now[i] was in the last frame, NaN if it is new. Drops a point also one frame
  /// before it is in the mask (KeypointReason::kEntering): a tracker drags points along there.
  /// Throws Error unless there is one point before for each now.
  template <class Keypoints, class Before>
  const Selection& select_tracked(const Keypoints& now, const Before& before) {
    tracked_ = select(now);
    const int reach = scaled_px(kReachPx, mask().image.size());
    parts_.clear();
    for (const DynamicObject& o : objects())
      parts_.push_back(
          {{o.box.x - reach, o.box.y - reach, o.box.width + 2 * reach, o.box.height + 2 * reach},
           o.shift_px});
    drop_entering(now, before, mask(), parts_, settings().probability.min_kept, tracked_);
    stats_of_frame().kept = static_cast<int>(tracked_.kept.size());
    return tracked_;
  }

  /// The dynamic mask of the last frame.
  const DynamicMask& mask() const;
  // The mask on its way, for evaluation and images: unions of masks, H x W, CV_8UC1, 255 =
  // dynamic. O(pixels).
  /// The segmenter's own, of dynamic classes.
  cv::Mat raw_mask() const;
  /// What the motion check found.
  cv::Mat movers_mask() const;
  /// Both, mended by the compensation.
  cv::Mat mended_mask() const;
  /// The mask after compensation and depth fusion, before dilation.
  cv::Mat undilated_mask() const;
  /// Where the camera is by all that is known, and how it moves. Its header: motion/ego_motion.hpp.
  const EgoMotion& ego_motion() const;
  /// The objects of the last frame with their final masks, before dilation, and their blur.
  const std::vector<Instance>& instances() const;
  /// The objects of the last frame with ids, places and velocities. Ask after correct_pose(), which
  /// makes the places better. An instance without a name that lies on another is none of its own.
  /// With what compute_mask() does for it, it costs a hundredth of the extraction of 3000 ORB
  /// keypoints (BM_Objects). The reference stays valid until the next frame.
  const std::vector<DynamicObject>& objects() const;
  /// What was done with the last frame.
  const FrameStats& stats() const;

 private:
  // How far a mask usually reaches beyond its object, in an image 640 wide.
  static constexpr int kReachPx = 30;

  FrontEnd(const Settings& settings, const Camera& camera, Segmenter* segmenter,
           detail::EigenAlignmentHere);
  FrameStats& stats_of_frame();

  std::unique_ptr<detail::FrontEndPipeline> pipeline_;
  ProbabilisticKeypointFilter<> filter_;
  Selection tracked_;
  std::vector<MaskMotion> parts_;
};

}  // namespace stillpoint

#ifndef STILLPOINT_COMPILED
#include "stillpoint/front_end_pipeline.hpp"
#endif
