// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "stillpoint/core/blur.hpp"
#include "stillpoint/core/camera.hpp"
#include "stillpoint/core/depth_view.hpp"
#include "stillpoint/core/frame.hpp"
#include "stillpoint/core/frame_context.hpp"
#include "stillpoint/core/instance.hpp"
#include "stillpoint/core/status.hpp"
#include "stillpoint/segmentation/memory_limits.hpp"
#include "stillpoint/segmentation/object_association.hpp"
#include "stillpoint/segmentation/object_locator.hpp"
#include "stillpoint/segmentation/object_masks.hpp"
#include "stillpoint/segmentation/remembered_object.hpp"
#include "stillpoint/segmentation/segmentation_age.hpp"
#include "stillpoint/segmentation/segmentation_compensator_settings.hpp"

namespace stillpoint {

/// Mends what a segmenter misses: objects seen in the last frames and missing, wholly or partly, in
/// this one are put back where they must be now (paper section 3.1).
///
/// Each object is remembered with its mask, depth and last places. It is carried into the new frame
/// by the camera's motion, if the caller knows it, and along the least-squares line through its
/// last places at their real timestamps. What the segmenter shows of it is compared with that
/// prediction; what is missing is looked for near the predicted place (by depth where there is
/// depth, else by template matching), and restored only if it is found there, or where depth cannot
/// tell. One that left is not restored. A frame without a result (`available = false`) is a frame
/// in which every object is missing. Frames may be dropped; restoring is bounded in number and in
/// time. Cost: O(objects x instances), and O(pixels of the box) for each object. Not thread-safe;
/// one object per camera.
class SegmentationCompensator {
 public:
  using Settings = SegmentationCompensatorSettings;

  /// `camera` is needed only to use camera motion.
  explicit SegmentationCompensator(const Settings& settings = {}, const Camera& camera = {})
      : settings_(settings), camera_(camera), locator_(settings), limits_(settings) {
    settings.check();
  }

  const Settings& settings() const { return settings_; }

  /// Returns the segmentation of `frame` with missed objects restored: the given instances, in
  /// order, some of them enlarged, then the wholly restored ones. `T_current_last` maps points of
  /// the last frame's camera into this one's. The reference stays valid until the next call; masks
  /// that are copied out of it stay as they are.
  const Segmentation& compensate(
      const RgbdFrame& frame, const Segmentation& segmentation,
      const std::optional<Eigen::Isometry3d>& T_current_last = std::nullopt) {
    own_context_.begin(frame, camera_);
    own_context_.T_current_last = T_current_last;
    mend(own_context_, segmentation);
    remember(own_context_, output_.instances);
    return output_;
  }

  /// The first half of compensate(), for callers that have better masks to remember: call
  /// remember() for the same frame before the next mend(). Beyond the camera's motion the context
  /// tells the blur, which is filled in for each instance (a miss in a sharp image counts more),
  /// and which cells are static: nothing is carried along there, and the mask of an object with a
  /// name is cleared there but for its rim.
  const Segmentation& mend(const FrameContext& context, const Segmentation& segmentation) {
    const cv::Size size = context.size();
    check_segmentation(segmentation, context.frame);
    begin(context, segmentation);
    const std::optional<Eigen::Isometry3d> T =
        camera_.valid() ? context.T_current_last : std::nullopt;
    for (Instance& s : output_.instances) masks_.trim(context, s);
    for (RememberedObject& object : objects_)
      object.predict(context.frame.timestamp, context.depth.lens(), T, max_speed_px(object, size));
    associate(size);
    for (std::size_t i = 0; i < given_; ++i)
      output_.instances[i].blur = blur_of(context, pairs_.object_of(i), output_.instances[i].box);
    const bool look = settings_.trigger == Settings::Trigger::kPerObject ||
                      !segmentation.available || area_dropped();
    for (std::size_t j = 0; j < objects_.size(); ++j) judge(context, j, look);
    return output_;
  }

  /// What the last mend() or compensate() returned.
  const Segmentation& mended() const { return output_; }

  /// The second half of compensate(): remembers the instances that mend() returned, trimmed to
  /// `refined`, the same instances in the same order after depth fusion (bare boxes take its masks
  /// over). What the fusion added is not remembered: it would flow on into the furniture beside it.
  void remember(const FrameContext& context, const std::vector<Instance>& refined) {
    const DepthView& depth = depth_of(context);
    const std::size_t n = pairs_.instances();
    detail::check(refined.size() == n, [&] {
      return "remember: expected one instance for each of mend(), " + std::to_string(n) +
             ", found " + std::to_string(refined.size());
    });
    last_area_ = 0;
    for (std::size_t i = 0; i < n; ++i) {
      if (settings_.trigger == Settings::Trigger::kGlobal)
        last_area_ += area_of(output_.instances[i]);
      if (pairs_.object_of(i) >= 0) continue;
      pairs_.set(objects_.size(), i);
      RememberedObject& object = objects_.emplace_back();
      object.id = next_id_++, object.shown_s = object.seen_s = context.frame.timestamp;
    }
    ids_.resize(n);
    for (std::size_t i = 0; i < n; ++i) {
      RememberedObject& object = objects_[static_cast<std::size_t>(pairs_.object_of(i))];
      ids_[i] = object.id;
      if (!object.alive) continue;
      if (i < given_) object.once_s = once_s_;
      const float farther_m = object.observe(context, depth, refined[i], &output_.instances[i]);
      const bool elsewhere = i >= given_ && std::abs(farther_m) > kOtherSurfaceM;
      if (!elsewhere && object.inside().size() >= kFewestPoints)
        object.add_place(context.frame.timestamp, settings_.corner_history,
                         static_cast<std::size_t>(settings_.history));
      else
        object.alive = false;
    }
    forget_dead();
  }

  /// The id of the object that each instance of the last mend() is, in their order, since
  /// remember().
  const std::vector<int>& ids() const { return ids_; }
  /// The objects that are remembered, as they were in the last frame.
  const std::vector<RememberedObject>& objects() const { return objects_; }
  /// How many objects the last mend() or compensate() restored, wholly or partly.
  int restored() const { return restored_; }
  /// Age of the newest result of the segmenter at the last frame, seconds; infinity before the
  /// first.
  double age_s() const { return age_.age_s(); }
  /// Bits of the last mend() or compensate(): kNoSegmentation, kNeverSegmented, kMaskStale,
  /// kRestored, kTimestampOrder.
  std::uint32_t status() const { return status_; }
  /// Forgets everything (a cut in the sequence).
  void reset() {
    objects_.clear();
    last_s_ = -std::numeric_limits<double>::infinity();
    age_ = SegmentationAge();
    last_area_ = 0;
  }

 private:
  static constexpr std::size_t kFewestPoints = 4;
  static constexpr float kOtherSurfaceM = 0.7f;  // farther off than an arm reaches

  void begin(const FrameContext& context, const Segmentation& segmentation) {
    const RgbdFrame& frame = context.frame;
    detail::check_time_is_set(last_s_, frame.timestamp);
    status_ = kOk, restored_ = 0;
    // A depth image that is black all over tells no more than none at all.
    has_depth_ = settings_.use_depth && context.depth.any_measured(segmentation.instances);
    if (frame.timestamp <= last_s_) reset(), status_ |= kTimestampOrder;
    once_s_ = limits_.unnamed_once_s(context, last_s_);
    last_s_ = frame.timestamp;
    age_.add(frame.timestamp, segmentation);
    status_ |= age_.status();
    output_ = segmentation;
    output_.timestamp = frame.timestamp;
    given_ = output_.instances.size();
  }

  // The frame's depth, or an empty one where it is not to be used.
  const DepthView& depth_of(const FrameContext& context) const {
    static const DepthView none;
    return has_depth_ ? context.depth : none;
  }

  double max_speed_px(const RememberedObject& object, const cv::Size& size) const {
    const double focal = camera_.valid() ? camera_.fx : 0.9 * size.width;
    const double z = object.depth_m() > 0 ? object.depth_m() : 2;
    return settings_.max_speed_m_s * focal / z;
  }

  // The paper's trigger r = A_c / A_{c-1} < 0.9.
  bool area_dropped() {
    double area = 0;
    for (std::size_t i = 0; i < given_; ++i) area += area_of(output_.instances[i]);
    return last_area_ > 0 && area < settings_.area_ratio * last_area_;
  }

  // Finds which instance shows which object, and tells the instance how far away it is expected.
  void associate(const cv::Size& size) {
    pairs_.find(objects_, output_.instances, size, locator_);
    if (!settings_.use_depth) return;
    for (std::size_t i = 0; i < given_; ++i)
      if (const int object = pairs_.object_of(i); object >= 0)
        output_.instances[i].depth_m =
            objects_[static_cast<std::size_t>(object)].predicted_depth_m();
  }

  // Decides what becomes of a remembered object in this frame. `look`: whether what is missing of
  // it is to be restored.
  void judge(const FrameContext& context, std::size_t j, bool look) {
    RememberedObject& object = objects_[j];
    const bool seen = pairs_.instance_of(j) >= 0;
    const double now_s = context.frame.timestamp;
    MemoryLimits::note_sight(now_s, seen, object);
    if (!seen && limits_.too_old(now_s, age_, object)) {
      object.alive = false;
      status_ |= kMaskStale;
      return;
    }
    if (!look) return leave(seen, object);
    const DepthView& depth = depth_of(context);
    if (!seen && !locator_.locate(context, depth, object)) {
      object.alive = false;
      return;
    }
    // The paper restores whole objects only.
    if (seen && settings_.trigger == Settings::Trigger::kGlobal) return leave(seen, object);
    const cv::Size size = context.size();
    if (seen && (depth.empty() || !object.measurable()))
      locator_.align_to(output_.instances[static_cast<std::size_t>(pairs_.instance_of(j))], size,
                        object);
    // What is missing of it may be in another object's mask.
    const double missing = locator_.missing_share(depth, size, object, output_.instances, given_);
    if (missing <= 1 - settings_.area_ratio) return leave(seen, object);
    const Blur blur = blur_of(context, static_cast<int>(j), object.predicted_box(size));
    if (output_.available && !limits_.count_miss(seen, blur, size, object))
      return leave(seen, object);
    restore(context, j);
  }

  // Restores nothing of an object: what is seen of it is all there is.
  static void leave(bool seen, RememberedObject& object) {
    object.alive = seen;
    object.mended = 0;
  }

  // Writes the object's predicted mask as an instance, or unites it with what was seen of it.
  void restore(const FrameContext& context, std::size_t j) {
    RememberedObject& object = objects_[j];
    const int shown_by = pairs_.instance_of(j);
    Instance restored;
    Instance& instance =
        shown_by >= 0 ? output_.instances[static_cast<std::size_t>(shown_by)] : restored;
    // A bare box is left to the depth fusion, which finds what is in it.
    if (shown_by >= 0 && instance.mask.empty()) return;
    if (!masks_.restore(context, object, instance)) {
      object.alive = shown_by >= 0;
      return;
    }
    instance.blur = blur_of(context, static_cast<int>(j), instance.box);
    ++restored_;
    status_ |= kRestored;
    if (shown_by >= 0) return;
    restored.class_name = object.class_name;
    restored.score = object.score;
    restored.depth_m = settings_.use_depth ? object.predicted_depth_m() : 0;
    restored.predicted = true;
    pairs_.set(j, output_.instances.size());
    output_.instances.push_back(restored);
  }

  // Of what is in `box`: a remembered object, or (-1) something new.
  Blur blur_of(const FrameContext& context, int object, const cv::Rect& box) const {
    if (object < 0) return context.blur.in(box);
    return context.blur.in(box, objects_[static_cast<std::size_t>(object)].displacement_px());
  }

  static double area_of(const Instance& s) {
    return s.mask.empty() ? s.box.area() : cv::countNonZero(s.mask);
  }

  void forget_dead() {
    const auto dead = [](const RememberedObject& object) { return !object.alive; };
    objects_.erase(std::remove_if(objects_.begin(), objects_.end(), dead), objects_.end());
  }

  Settings settings_;
  Camera camera_;
  FrameContext own_context_;
  bool has_depth_ = false;  // the frame of mend() has depth that is to be used
  ObjectLocator locator_;
  MemoryLimits limits_;
  std::vector<RememberedObject> objects_;
  Segmentation output_;
  std::size_t given_ = 0;
  double once_s_ = 0;  // MemoryLimits::unnamed_once_s() of this frame
  ObjectAssociation pairs_;
  std::vector<int> ids_;  // of the object of each instance
  ObjectMasks masks_;
  SegmentationAge age_;
  double last_s_ = -std::numeric_limits<double>::infinity();
  double last_area_ = 0;
  int next_id_ = 0;
  int restored_ = 0;
  std::uint32_t status_ = kOk;
};

}  // namespace stillpoint
