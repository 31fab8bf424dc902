// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "stillpoint/core/blur.hpp"
#include "stillpoint/core/camera.hpp"
#include "stillpoint/core/depth_view.hpp"
#include "stillpoint/core/frame.hpp"
#include "stillpoint/core/frame_context.hpp"
#include "stillpoint/core/image_scale.hpp"
#include "stillpoint/core/instance.hpp"
#include "stillpoint/core/mask_pool.hpp"
#include "stillpoint/core/status.hpp"
#include "stillpoint/segmentation/object_locator.hpp"
#include "stillpoint/segmentation/remembered_object.hpp"
#include "stillpoint/segmentation/segmentation_compensator_settings.hpp"

namespace stillpoint {

/// Mends what a segmenter misses: objects seen in the last frames and missing, wholly or partly, in
/// this one are put back where they must be now (paper section 3.1).
///
/// Each object is remembered with its mask, depth and last places. It is carried into the new frame
/// by the camera's motion, if the caller knows it, and along the least-squares line through its
/// last places at their real timestamps. What the segmenter shows of it is compared with that
/// prediction; what is missing is looked for near the predicted place (by depth where there is
/// depth, else by template matching), and restored only if it is found there. One that left is not
/// restored. A frame without a result (`available = false`) is a frame in which every object is
/// missing. Frames may be dropped; restoring is bounded in number and in time.
///
/// Any number of objects, of any class. Cost: O(objects x instances), and O(pixels of the box) for
/// each restored object. Not thread-safe; one object per camera.
class SegmentationCompensator {
 public:
  using Settings = SegmentationCompensatorSettings;

  /// `camera` is needed only to use camera motion.
  explicit SegmentationCompensator(const Settings& settings = {}, const Camera& camera = {})
      : settings_(settings), camera_(camera), locator_(settings) {
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
  /// remember() for the same frame before the next mend().
  /// What the context knows is used: the camera's motion; the blur, which tells how much a result
  /// says of what it misses, and which is filled in for each instance; and the labels of the cells:
  /// where a static surface is known, the mask of an object with a name is false, and is neither
  /// carried along nor, but for its rim, taken. An object without a name was found by its motion,
  /// which is the better evidence, but is not carried along there.
  const Segmentation& mend(const FrameContext& context, const Segmentation& segmentation) {
    const cv::Size size = context.size();
    check_segmentation(segmentation, size);
    begin(context, segmentation);
    const std::optional<Eigen::Isometry3d> T =
        camera_.valid() ? context.T_current_last : std::nullopt;
    for (Instance& s : output_.instances) trim(context, s);
    for (RememberedObject& object : objects_)
      object.predict(context.frame.timestamp, context.depth.lens(), T, max_speed_px(object, size));
    if (segmentation.available) {
      newest_result_s_ = context.frame.timestamp - age_s_;
      last_result_at_s_ = context.frame.timestamp;
      late_ = age_s_ > 0;
    }
    associate(size);
    for (std::size_t i = 0; i < given_; ++i) {
      Instance& s = output_.instances[i];
      s.blur = owner_[i] < 0 ? context.blur.in(s.box)
                             : blur_of(context, static_cast<std::size_t>(owner_[i]), s.box);
    }
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
    detail::check(refined.size() == owner_.size(), [&] {
      return "remember: expected one instance for each of mend(), " +
             std::to_string(owner_.size()) + ", found " + std::to_string(refined.size());
    });
    last_area_ = 0;
    for (std::size_t i = 0; i < owner_.size(); ++i) {
      if (settings_.trigger == Settings::Trigger::kGlobal)
        last_area_ += area_of(output_.instances[i]);
      if (owner_[i] >= 0) continue;
      owner_[i] = static_cast<int>(objects_.size());
      objects_.emplace_back();
      objects_.back().id = next_id_++;
      objects_.back().seen_s = context.frame.timestamp;
    }
    ids_.resize(owner_.size());
    for (std::size_t i = 0; i < owner_.size(); ++i) {
      RememberedObject& object = objects_[static_cast<std::size_t>(owner_[i])];
      ids_[i] = object.id;
      if (!object.alive) continue;
      object.observe(context.gray(), depth, refined[i], &output_.instances[i]);
      if (object.inside().size() >= kFewestPoints)
        object.add_place(context.frame.timestamp, settings_.corner_history, history());
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
  double age_s() const { return age_s_; }
  /// Bits of the last mend() or compensate(): kNoSegmentation, kNeverSegmented, kMaskStale,
  /// kRestored, kTimestampOrder.
  std::uint32_t status() const { return status_; }
  /// Forgets everything (a cut in the sequence).
  void reset() {
    objects_.clear();
    last_s_ = newest_result_s_ = last_result_at_s_ = -std::numeric_limits<double>::infinity();
    late_ = false;
    last_area_ = 0;
  }

 private:
  static constexpr std::size_t kFewestPoints = 4;
  static constexpr float kSurelyMovedM = 0.15f;
  static constexpr double kGapS = 0.1;  // between two frames that count as seen in a row

  std::size_t history() const { return static_cast<std::size_t>(settings_.history); }

  void begin(const FrameContext& context, const Segmentation& segmentation) {
    const RgbdFrame& frame = context.frame;
    detail::check_time_is_set(last_s_, frame.timestamp);
    status_ = kOk;
    restored_ = 0;
    // A depth image that is black all over tells no more than none at all.
    has_depth_ = settings_.use_depth && !context.depth.empty() &&
                 context.depth.any_measured(segmentation.instances);
    if (frame.timestamp <= last_s_) {
      reset();
      status_ |= kTimestampOrder;
    }
    last_s_ = frame.timestamp;
    output_.available = segmentation.available;
    output_.timestamp = frame.timestamp;
    output_.instances.clear();
    output_.instances.insert(output_.instances.end(), segmentation.instances.begin(),
                             segmentation.instances.end());
    given_ = output_.instances.size();
    owner_.assign(given_, -1);
    instance_of_.assign(objects_.size(), -1);
    // A result may be an earlier frame's, predicted forward (see ForwardPredictor).
    age_s_ = frame.timestamp - newest_result_s_;
    if (segmentation.available)
      age_s_ =
          segmentation.timestamp < frame.timestamp ? frame.timestamp - segmentation.timestamp : 0;
    if (!segmentation.available) status_ |= kNoSegmentation;
    if (!segmentation.available && std::isinf(age_s_)) status_ |= kNeverSegmented;
  }

  // The frame's depth, or an empty one where it is not to be used.
  const DepthView& depth_of(const FrameContext& context) const {
    static const DepthView none;
    return has_depth_ ? context.depth : none;
  }

  // Clears what is known to be static from a given mask.
  void trim(const FrameContext& context, Instance& s) {
    if (context.labels.empty() || s.class_name.empty() || s.mask.empty()) return;
    cv::Mat mask = masks_.take(s.box.size());
    s.mask.copyTo(mask);
    context.labels.clear_static(s.box, mask, true);
    s.mask = mask;
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

  // Gives each instance to the object whose predicted points it holds most of.
  void associate(const cv::Size& size) {
    pairs_.clear();
    for (std::size_t j = 0; j < objects_.size(); ++j) {
      const cv::Rect box = objects_[j].predicted_box(size);
      for (std::size_t i = 0; i < given_; ++i) {
        if ((box & output_.instances[i].box).empty()) continue;
        const double share = locator_.share_in(objects_[j], output_.instances[i]);
        if (share >= 0.25) pairs_.push_back({share, j, i});
      }
    }
    std::sort(pairs_.begin(), pairs_.end(), [](const Pair& a, const Pair& b) {
      if (a.share != b.share) return a.share > b.share;
      return a.object != b.object ? a.object < b.object : a.instance < b.instance;
    });
    for (const Pair& pair : pairs_) {
      if (instance_of_[pair.object] >= 0 || owner_[pair.instance] >= 0) continue;
      instance_of_[pair.object] = static_cast<int>(pair.instance);
      owner_[pair.instance] = static_cast<int>(pair.object);
      if (settings_.use_depth)
        output_.instances[pair.instance].depth_m = objects_[pair.object].predicted_depth_m();
    }
  }

  // Decides what becomes of a remembered object in this frame.
  void judge(const FrameContext& context, std::size_t j, bool look) {
    const RgbdFrame& frame = context.frame;
    const cv::Size size = context.size();
    const DepthView& depth = depth_of(context);
    RememberedObject& object = objects_[j];
    const bool seen = instance_of_[j] >= 0;
    if (seen) {
      object.seen_for_s += std::min(frame.timestamp - object.seen_s, kGapS);
      object.seen_s = frame.timestamp;
      ++object.times_seen;
      object.forget_depth_motion();
    } else if (std::abs(object.depth_motion_m()) > kSurelyMovedM) {
      // Who walks away is not where it was seen free before, yet goes on moving.
      object.seen_s = frame.timestamp;
      object.forget_depth_motion();
    }
    // A late segmenter gives few results: one that misses the object must not end it.
    const double known_s = late_ ? std::max(object.seen_s, last_result_at_s_) : object.seen_s;
    const bool too_old = frame.timestamp - known_s > bound_s(object);
    if (!seen && too_old) {
      object.alive = false;
      status_ |= kMaskStale;
      return;
    }
    if (!look) {
      object.alive = seen;
      object.mended = 0;
      return;
    }
    if (!seen && !locator_.locate(context, depth, object)) {
      object.alive = false;
      return;
    }
    if (seen && settings_.trigger == Settings::Trigger::kGlobal) {
      object.mended = 0;  // the paper restores whole objects only
      return;
    }
    if (seen && (depth.empty() || object.depth_m() == 0))
      locator_.align_to(output_.instances[static_cast<std::size_t>(instance_of_[j])], size, object);
    const double missing = locator_.missing_share(depth, size, object, output_.instances, given_);
    if (missing <= 1 - settings_.area_ratio) {
      object.alive = seen;  // what is left of it is in another object's mask
      object.mended = 0;
      return;
    }
    // A segmenter says nothing of what it has no name for: only time ends that.
    if (output_.available && !object.class_name.empty() &&
        (object.mended += weight_of_miss(context, j)) > bound_misses(object, seen)) {
      object.alive = seen;
      object.mended = 0;
      return;
    }
    restore(context, j);
  }

  // How many results in a row may miss an object. What was seen once or twice only may be a piece
  // of the wall that looked like a person.
  int bound_misses(const RememberedObject& object, bool seen) const {
    const bool known = seen || settings_.trigger == Settings::Trigger::kGlobal;
    return known ? settings_.max_restored_frames
                 : std::min(settings_.max_restored_frames, 3 * object.times_seen - 1);
  }

  // How long an object is carried along without being seen. Without a class, it is trusted longer
  // the longer it was seen: what the motion check finds only once may be nothing.
  double bound_s(const RememberedObject& object) const {
    if (!object.class_name.empty()) return settings_.max_prediction_s;
    const double longer = settings_.max_prediction_s + 3 * object.seen_for_s;
    return std::max(settings_.max_prediction_s, std::min(settings_.max_unnamed_s, longer));
  }

  // Writes the object's predicted mask as an instance, or unites it with what was seen of it.
  void restore(const FrameContext& context, std::size_t j) {
    const cv::Size size = context.size();
    RememberedObject& object = objects_[j];
    const cv::Rect predicted = object.predicted_box(size);
    if (predicted.empty()) {
      object.alive = instance_of_[j] >= 0;
      return;
    }
    Instance* instance = nullptr;
    cv::Rect area = predicted;
    if (instance_of_[j] >= 0) {
      instance = &output_.instances[static_cast<std::size_t>(instance_of_[j])];
      if (instance->mask.empty()) return;  // a bare box: the depth fusion finds what is in it
      area |= instance->box;
    }
    cv::Mat mask = masks_.take(area.size());
    std::memset(mask.data, 0, mask.total());
    object.draw_predicted(area, mask);
    if (!context.labels.empty()) {
      context.labels.clear_static(area, mask, object.class_name.empty());
      if (!instance && cv::countNonZero(mask) == 0) {
        object.alive = false;
        return;
      }
    }
    if (instance) {
      cv::Mat part = mask(instance->box - area.tl());
      cv::bitwise_or(part, instance->mask, part);
    } else {
      output_.instances.emplace_back();
      owner_.push_back(static_cast<int>(j));
      instance_of_[j] = static_cast<int>(output_.instances.size()) - 1;
      instance = &output_.instances.back();
      instance->class_name = object.class_name;
      instance->score = object.score;
      instance->depth_m = settings_.use_depth ? object.predicted_depth_m() : 0;
      instance->predicted = true;
    }
    instance->box = area;
    instance->mask = mask;
    instance->blur = blur_of(context, j, area);
    ++restored_;
    status_ |= kRestored;
  }

  // Who is missed in a sharp picture is not there, more likely than in a blurred one.
  int weight_of_miss(const FrameContext& context, std::size_t j) const {
    const cv::Size size = context.size();
    const bool sharp = instance_of_[j] < 0 && settings_.sharp_px > 0 &&
                       blur_of(context, j, objects_[j].predicted_box(size))
                           .is_sharp(settings_.sharp_px * pixel_scale(size));
    return sharp ? 2 : 1;
  }

  // Of a remembered object that is in `box`.
  Blur blur_of(const FrameContext& context, std::size_t object, const cv::Rect& box) const {
    return context.blur.in(box, objects_[object].displacement_px());
  }

  static double area_of(const Instance& s) {
    return s.mask.empty() ? s.box.area() : cv::countNonZero(s.mask);
  }

  void forget_dead() {
    std::size_t n = 0;
    for (std::size_t j = 0; j < objects_.size(); ++j) {
      if (!objects_[j].alive) continue;
      if (n != j) std::swap(objects_[n], objects_[j]);
      ++n;
    }
    objects_.resize(n);
  }

  struct Pair {
    double share;
    std::size_t object, instance;
  };

  Settings settings_;
  Camera camera_;
  FrameContext own_context_;
  bool has_depth_ = false;  // the frame of mend() has depth that is to be used
  ObjectLocator locator_;
  std::vector<RememberedObject> objects_;
  Segmentation output_;
  std::size_t given_ = 0;
  std::vector<int> owner_;        // instance -> object
  std::vector<int> ids_;          // instance -> id of its object
  std::vector<int> instance_of_;  // object -> instance
  std::vector<Pair> pairs_;
  detail::MaskPool masks_;
  double last_s_ = -std::numeric_limits<double>::infinity();
  double newest_result_s_ = -std::numeric_limits<double>::infinity();
  double last_result_at_s_ = -std::numeric_limits<double>::infinity();
  bool late_ = false;
  double age_s_ = std::numeric_limits<double>::infinity();
  double last_area_ = 0;
  int next_id_ = 0;
  int restored_ = 0;
  std::uint32_t status_ = kOk;
};

}  // namespace stillpoint
