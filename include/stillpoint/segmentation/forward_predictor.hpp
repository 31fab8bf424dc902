// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "stillpoint/core/camera.hpp"
#include "stillpoint/core/depth_view.hpp"
#include "stillpoint/core/frame.hpp"
#include "stillpoint/core/frame_context.hpp"
#include "stillpoint/core/image_scale.hpp"
#include "stillpoint/core/instance.hpp"
#include "stillpoint/core/mask_pool.hpp"
#include "stillpoint/core/status.hpp"
#include "stillpoint/segmentation/frame_history.hpp"
#include "stillpoint/segmentation/late_segmentation_settings.hpp"
#include "stillpoint/segmentation/object_locator.hpp"
#include "stillpoint/segmentation/remembered_object.hpp"
#include "stillpoint/segmentation/segmentation_compensator_settings.hpp"

namespace stillpoint {

/// Carries the masks of a late segmentation forward, from its frame to the newest one: by the
/// camera's motion since, by the motion that the tracked object had since, and onto the depth that
/// is found there.
///
/// Per frame: forward(), then remember() with the objects that the compensator remembers. For a
/// segmenter that is late it keeps copies of the depth images of the last max_age_s; one that
/// gives each frame its result costs nothing. Not thread-safe.
class ForwardPredictor {
 public:
  ForwardPredictor(const LateSegmentationSettings& settings,
                   const SegmentationCompensatorSettings& compensation, const Camera& camera)
      : settings_(settings),
        compensation_(compensation),
        camera_(camera),
        locator_(compensation),
        frames_(settings.max_age_s) {
    settings.check();
  }

  /// If `segmentation` is of an earlier frame, puts its instances where they must be in `frame`;
  /// those that are not found there are left out. One that is too old becomes `available = false`.
  /// O(pixels) for the copy of the depth, O(pixels of the boxes) for a late result.
  void forward(const FrameContext& context, Segmentation& segmentation) {
    const RgbdFrame& frame = context.frame;
    status_ = kOk, age_s_ = 0;
    const bool late =
        segmentation.available && result_time(segmentation, frame.timestamp) < frame.timestamp;
    was_late_ = was_late_ || late;
    // A frame without a result may get one later.
    if (!was_late_ && segmentation.available) return frames_.keep(0);
    frames_.add(frame, context.T_current_last);
    if (!late) return;
    age_s_ = frame.timestamp - segmentation.timestamp;
    const std::size_t then = frames_.index_of(segmentation.timestamp);
    if (then == frames_.size() || age_s_ > settings_.max_age_s) {
      segmentation.available = false;
      segmentation.instances.clear();
      status_ = kMaskStale;
    } else {
      for (Instance& instance : segmentation.instances) instance.late_s = age_s_;
      if (settings_.predict) carry(context, then, segmentation);
    }
  }

  /// Takes note of where the compensator's objects were found in the frame of forward().
  void remember(const std::vector<RememberedObject>& objects) { frames_.remember(objects); }

  /// Tells the camera's motion to the frame of forward(), once it is known better.
  void set_motion(const std::optional<Eigen::Isometry3d>& T_current_last) {
    frames_.set_newest_motion(T_current_last);
  }

  /// How much older than its frame the last segmentation was, seconds.
  double age_s() const { return age_s_; }
  /// kMaskStale if the last segmentation was too old, else kOk.
  std::uint32_t status() const { return status_; }

 private:
  static constexpr int kMostReachPx = 200;  // of the search for who may have gone far, at 640 wide

  // An object's own displacement: in the image (pixels), and away from the camera (metres).
  struct Displacement {
    cv::Point2d place;
    float depth_m;
  };
  struct Seen {
    cv::Rect box;
    cv::Point2d center;
    float z;
  };

  void carry(const FrameContext& context, std::size_t then, Segmentation& segmentation) {
    const RgbdFrame& frame = context.frame;
    RgbdFrame old;
    old.color = frame.color;  // looked at only without depth
    old.depth = frames_[then].depth;
    old.depth_units_per_m = frames_[then].units_per_m;
    const bool has_depth = compensation_.use_depth && context.depth.any_measured() &&
                           old.depth.size() == frame.depth.size();
    if (!has_depth) old.depth.release();
    old_depth_.set(old, camera_);
    static const DepthView no_depth;
    const DepthView& depth = has_depth ? context.depth : no_depth;
    const std::optional<Eigen::Isometry3d> T_now_then = frames_.motion_since(then);
    std::size_t kept = 0;
    seen_.clear();
    for (Instance& instance : segmentation.instances)
      if (carry_one(context, depth, then, T_now_then, instance))
        std::swap(segmentation.instances[kept++], instance);
    segmentation.instances.resize(kept);
    last_seen_s_ = frames_[then].timestamp;
    std::swap(last_seen_, seen_);
  }

  // Where a static point of an earlier frame is seen now.
  cv::Point2d transfer(const cv::Point2d& p, float z,
                       const std::optional<Eigen::Isometry3d>& T) const {
    if (!T || !camera_.valid()) return p;
    const Eigen::Vector2d q =
        RememberedObject::transfer(old_depth_.lens(), *T, static_cast<double>(z), {p.x, p.y});
    return {q.x(), q.y()};
  }

  double depth_of(const cv::Point2d& p, float z, const std::optional<Eigen::Isometry3d>& T) const {
    if (!T || !camera_.valid()) return z;
    const Eigen::Vector2f ray =
        old_depth_.lens().ray(static_cast<float>(p.x), static_cast<float>(p.y));
    return (*T * (z * ray.homogeneous()).cast<double>()).z();
  }

  // The object's own displacement since frame `then`, without the camera's motion: along its track
  // up to the last frame, and on at the same speed.
  std::optional<Displacement> tracked_motion(const Instance& instance, std::size_t then) const {
    if (then + 2 > frames_.size()) return std::nullopt;
    const FrameHistory::Track* start = nullptr;
    double best = 0.3;
    for (const FrameHistory::Track& track : frames_[then].tracks) {
      const double both = (track.box & instance.box).area();
      const double overlap = both / (track.box.area() + instance.box.area() - both);
      if (overlap > best) best = overlap, start = &track;
    }
    if (!start) return std::nullopt;
    for (std::size_t last = frames_.size() - 1; --last > then;)
      for (const FrameHistory::Track& track : frames_[last].tracks) {
        if (track.id != start->id) continue;
        const double seconds = frames_[last].timestamp - frames_[then].timestamp;
        const double on = (frames_.newest().timestamp - frames_[then].timestamp) / seconds;
        const auto T_then = frames_.motion_since(then), T_last = frames_.motion_since(last);
        const cv::Point2d from = transfer(start->center, start->z, T_then);
        const cv::Point2d to = transfer(track.center, track.z, T_last);
        const double nearer = start->z > 0 && track.z > 0
                                  ? depth_of(track.center, track.z, T_last) -
                                        depth_of(start->center, start->z, T_then)
                                  : 0;
        return Displacement{(to - from) * on, static_cast<float>(nearer * on)};
      }
    return std::nullopt;
  }

  // The same, at the speed from the last result to this one (the newest of seen_).
  std::optional<Displacement> motion_between_results(std::size_t then) const {
    const Seen& now = seen_.back();
    const double since = frames_[then].timestamp - last_seen_s_;
    const std::size_t before = frames_.index_of(last_seen_s_);
    if (!(since > 0) || before >= then) return std::nullopt;
    const std::optional<Eigen::Isometry3d> T = frames_.motion(before, then);
    std::optional<Displacement> own;
    double best = 0.3;
    for (const Seen& old : last_seen_) {
      const cv::Point2d still = transfer(old.center, old.z, T);
      const cv::Point shift(static_cast<int>(still.x - old.center.x),
                            static_cast<int>(still.y - old.center.y));
      const double both = ((old.box + shift) & now.box).area();
      const double overlap = both / (old.box.area() + now.box.area() - both);
      if (overlap > best) best = overlap, own = Displacement{now.center - still, 0};
    }
    if (own) own->place *= (frames_.newest().timestamp - frames_[then].timestamp) / since;
    return own;
  }

  // In a bare box the object is in the middle columns.
  Instance middle_of(const Instance& instance) {
    Instance middle = instance;
    central_.assign(static_cast<std::size_t>(instance.box.area()), 0);
    middle.mask = cv::Mat(instance.box.size(), CV_8UC1, central_.data());
    const int width = instance.box.width;
    middle.mask.colRange(width * 5 / 16, std::max(width * 5 / 16 + 1, width * 11 / 16)).setTo(255);
    return middle;
  }

  // Moves object_ from where it would be seen had it stood still to where it is; false if it is not
  // there any more.
  bool find(const FrameContext& context, const DepthView& depth, const Instance& instance,
            std::size_t then, bool can_look) {
    // With depth, the track is more reliable than the displacement between two results; without
    // depth, less.
    const std::optional<Displacement> tracked = tracked_motion(instance, then);
    const std::optional<Displacement> between = motion_between_results(then);
    if (!can_look) {
      if (between || tracked) move(between ? *between : *tracked);
      return true;
    }
    // A copy of the place, as a search that fails has moved it.
    const RememberedObject::Place still = object_.place();
    for (const std::optional<Displacement>& own : {tracked, between}) {
      if (!own) continue;
      object_.set_place(still);
      move(*own);
      if (locator_.locate(context, depth, object_)) return true;
    }
    const double px_per_m = depth.focal_px() / object_.depth_m();
    const double seconds = frames_.newest().timestamp - frames_[then].timestamp;
    const double most_px = scaled_px(kMostReachPx, context.size());
    const int reach =
        static_cast<int>(std::min(most_px, compensation_.max_speed_m_s * px_per_m * seconds));
    const int search_px = scaled_px(compensation_.search_px, context.size());
    const float step =
        static_cast<float>(std::min(0.5, 0.5 * compensation_.max_speed_m_s * seconds));
    for (const float away : {0.0f, -step, step}) {
      object_.set_place(still);
      object_.shift_depth(away);
      if (locator_.locate_far(depth, std::max(reach, search_px), object_)) return true;
    }
    // Where depth measures hardly anything of it, it is taken to have stayed.
    object_.set_place(still);
    return locator_.is_unmeasured(depth, object_);
  }

  void move(const Displacement& own) {
    object_.shift_depth(own.depth_m);
    object_.shift_prediction(
        {static_cast<int>(std::lround(own.place.x)), static_cast<int>(std::lround(own.place.y))});
  }

  bool carry_one(const FrameContext& context, const DepthView& depth, std::size_t then,
                 const std::optional<Eigen::Isometry3d>& T_now_then, Instance& instance) {
    object_.forget_past();
    if (instance.mask.empty())
      object_.observe(context, old_depth_, middle_of(instance), nullptr);
    else
      object_.observe(context, old_depth_, instance, nullptr);
    object_.predict(context.frame.timestamp, old_depth_.lens(),
                    camera_.valid() ? T_now_then : std::nullopt, 0);
    const bool can_look = !depth.empty() && object_.depth_m() > 0;
    seen_.push_back({instance.box, object_.center(), object_.depth_m()});
    if (!find(context, depth, instance, then, can_look)) return false;
    const cv::Rect area = object_.predicted_box(context.size());
    if (area.empty()) return false;
    if (can_look) instance.depth_m = object_.predicted_depth_m();
    instance.predicted = true;
    if (!instance.mask.empty()) {
      instance.mask = masks_.zeros(area.size());
      object_.draw_predicted(area, instance.mask);
    }
    instance.box = area;
    return true;
  }

  LateSegmentationSettings settings_;
  SegmentationCompensatorSettings compensation_;
  Camera camera_;
  ObjectLocator locator_;
  FrameHistory frames_;
  RememberedObject object_;
  DepthView old_depth_;
  detail::MaskPool masks_;
  std::vector<uchar> central_;
  std::vector<Seen> seen_, last_seen_;  // of this result, and of the one before
  double last_seen_s_ = 0;
  bool was_late_ = false;
  double age_s_ = 0;
  std::uint32_t status_ = kOk;
};

}  // namespace stillpoint
