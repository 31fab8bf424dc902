// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <mutex>
#include <optional>
#include <utility>
#include <vector>

#include "stillpoint/backends/rgbd_slam/fair_mutex.hpp"
#include "stillpoint/backends/rgbd_slam/frame_clock.hpp"
#include "stillpoint/backends/rgbd_slam/frame_record.hpp"
#include "stillpoint/backends/rgbd_slam/local_map.hpp"
#include "stillpoint/backends/rgbd_slam/pnp.hpp"
#include "stillpoint/backends/rgbd_slam/relocalizer.hpp"
#include "stillpoint/backends/rgbd_slam/start_review.hpp"
#include "stillpoint/backends/rgbd_slam/tracked_frame.hpp"
#include "stillpoint/core/trajectory.hpp"

namespace stillpoint::rgbd_slam {

/// Follows the camera in the map, frame by frame, and decides on keyframes.
///
/// The predicted pose projects the local map into the frame; matches near the projections give the
/// pose; then the local map is gathered anew around them, matched closely, and the pose refined; a
/// pose that too few of the matches agree on is contested. If that fails, wider, then anywhere in
/// the map. A frame that finds too few is lost, and said to be. Poses are kept relative to
/// keyframes, so that corrections of these carry them along. Knows no thread: the caller holds the
/// map's lock.
class MapTracking {
 public:
  struct Settings {
    /// Fewer agreeing matches than this: lost; and the number that a relocalisation needs.
    int min_inliers = 20, min_relocalized = 30;
    /// Keypoints with depth that the first frame needs.
    int min_start_points = 80;
    /// A keyframe is due when the matches fall below this share of those of the reference
    /// keyframe's points, at the latest after so many seconds; at the earliest after `min`.
    double keyframe_ratio = 0.95;
    double max_keyframe_gap_s = 0.5, min_keyframe_gap_s = 1.0 / 15;
    /// The map is started anew when it is lost for so long with fewer keyframes than that.
    double restart_after_s = 1;
    int restart_keyframes = 4;
    std::size_t max_local_keyframes = 40;
  };

  /// What happened to the last frame. Without keypoints (a black image, or all of it masked) it
  /// is lost; without depth it is tracked on what the map knows.
  struct Stats {
    int keypoints = 0, with_depth = 0;
    int matches = 0, inliers = 0, local_points = 0;
    bool keyframe = false, recovered = false, restart_due = false;
  };

  MapTracking(const Optics& optics, const Settings& settings)
      : optics_(optics), settings_(settings) {}

  /// Tracks a frame; false: lost. With `mapper_busy` a keyframe waits if it can.
  bool track(Map& map, PlaceIndex& index, KeypointFrame frame, const ImagePyramid& pyramid,
             bool mapper_busy) {
    clock_.advance(frame.timestamp);
    const bool at_start = StartReview::wants(records_, frame.timestamp);
    KeypointFrame kept = at_start ? frame : KeypointFrame();
    current_ = TrackedFrame(std::move(frame));
    pyramid_ = &pyramid;
    stats_ = Stats();
    stats_.keypoints = static_cast<int>(current_.frame.size());
    for (const FrameKeypoint& k : current_.frame.keypoints) stats_.with_depth += k.depth_m > 0;
    after_keyframe_ = new_keyframe_ != kNone;
    new_keyframe_ = kNone;
    bool ok = false;
    if (map.keyframe_count() == 0) {
      ok = start(map);
    } else {
      if (tracking_) ok = follow(map);
      if (!ok) {
        stats_.inliers = relocalize(optics_, map, index, settings_.min_relocalized, current_);
        ok = stats_.recovered = stats_.inliers > 0;
        if (ok) local_ = gather_local_map(map, current_.points, settings_.max_local_keyframes);
      }
      if (ok) ok = follow_local_map(map);
      if (ok) accept(map, mapper_busy);
    }
    if (ok) {
      lost_since_s_.reset();
      if (at_start)
        start_.keep(std::move(kept), pyramid.image(0), records_.size() - 1, new_keyframe_ != kNone);
    } else {
      stats_.recovered = false;
      motion_.reset();
      if (!lost_since_s_) lost_since_s_ = clock_.now_s();
      stats_.restart_due = clock_.reached_since(*lost_since_s_, settings_.restart_after_s) &&
                           map.keyframe_count() > 0 &&
                           static_cast<int>(map.keyframe_count()) < settings_.restart_keyframes;
    }
    tracking_ = ok;
    return ok;
  }

  const TrackedFrame& current() const { return current_; }
  const Stats& stats() const { return stats_; }
  /// The keyframe made of the last frame, or kNone.
  KeyframeId new_keyframe() const { return new_keyframe_; }
  bool tracking() const { return tracking_; }

  /// Judges the first frames again once enough is known (see StartReview); `lock` is the map's.
  void review_start(Map& map, FairMutex& lock) { start_.run(optics_, map, lock, records_); }

  /// Refines the poses of those frames that are old enough for the map around them to be known well
  /// (`all`: of all that are left); see FrameRecord::settle(). `lock` is the map's, held for one
  /// frame (about 0.3 ms) at a time.
  void settle(const Map& map, FairMutex& lock, bool all = false) {
    for (;;) {
      const std::lock_guard<FairMutex> guard(lock);
      if (!(all ? settled_ < records_.size() : settle_due())) return;
      records_[settled_++].settle(optics_, map);
    }
  }

  /// How many of the tracked frames, the first ones, are settled.
  std::size_t settled() const { return settled_; }

  /// Forgets everything, the trajectory too: for a map that is started anew.
  void reset() {
    records_.clear();
    settled_ = 0;
    start_.reset();
    local_ = LocalMap();
    motion_.reset();
    lost_since_s_.reset();
    tracking_ = false;
  }

  /// T_next_last, if the last two frames were tracked.
  const std::optional<Eigen::Isometry3d>& motion() const { return motion_; }

  /// Poses of all tracked frames by the keyframes' present poses. O(frames).
  Trajectory trajectory(const Map& map) const {
    Trajectory trajectory;
    trajectory.reserve(records_.size());
    for (const FrameRecord& r : records_)
      trajectory.push_back({r.timestamp(), r.pose(map).inverse()});
    return trajectory;
  }

 private:
  // With so many the camera is sure to be where it was predicted.
  static constexpr int kSureInliers = 60;
  // After which those points that a frame saw are known as well as they will be.
  static constexpr double kSettleAfterS = 3;
  // That wait to be settled, each with what it saw (about 40 KB): the frames of 3 s at 120 Hz.
  static constexpr std::size_t kMostUnsettled = 360;
  // With the mapper behind, keyframes wait so long.
  static constexpr double kBusyGapS = 1.0 / 6;

  bool settle_due() const {
    if (settled_ >= records_.size()) return false;
    const double age_s = records_.back().timestamp() - records_[settled_].timestamp();
    return FrameClock::reached(age_s, kSettleAfterS) || records_.size() - settled_ > kMostUnsettled;
  }

  bool start(Map& map) {
    if (stats_.with_depth < settings_.min_start_points) return false;
    insert_keyframe(map);
    record(map);
    return true;
  }

  Eigen::Isometry3d last_pose(const Map& map) const { return records_.back().pose(map); }

  // The last motion stretched by the real time between frames: frames may be dropped.
  Eigen::Isometry3d stretched_motion() const {
    if (!motion_) return Eigen::Isometry3d::Identity();
    const double dt = current_.frame.timestamp - records_.back().timestamp();
    const double ratio = motion_dt_ > 0 && dt > 0 ? std::min(dt / motion_dt_, 10.0) : 1;
    const Eigen::AngleAxisd turn(motion_->linear());
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.linear() = Eigen::AngleAxisd(turn.angle() * ratio, turn.axis()).toRotationMatrix();
    T.translation() = motion_->translation() * ratio;
    return T;
  }

  bool follow(Map& map) {
    const Eigen::Isometry3d last = last_pose(map), predicted = stretched_motion() * last;
    match_from(map, predicted, 10);
    if (stats_.inliers >= kSureInliers) return true;
    // A camera that turns faster or slower than before: from farther, and most agreement wins.
    Stats best = stats_;
    TrackedFrame found = current_;
    for (const Eigen::Isometry3d& from : {predicted, last}) {
      match_from(map, from, 40);
      if (stats_.inliers > best.inliers) best = stats_, found = current_;
    }
    stats_ = best;
    current_ = std::move(found);
    return stats_.inliers >= settings_.min_inliers / 2;
  }

  // Fills stats_.matches and stats_.inliers.
  void match_from(const Map& map, const Eigen::Isometry3d& T, double radius_px) {
    current_.points.assign(current_.frame.size(), kNone);
    current_.T_camera_world = T;
    stats_.matches =
        match_projections(optics_, map, local_.points, radius_px, MatchLimits(), current_);
    stats_.inliers = 0;
    if (stats_.matches >= settings_.min_inliers)
      stats_.inliers = refine_pose(optics_, map, current_);
  }

  bool follow_local_map(Map& map) {
    local_ = gather_local_map(map, current_.points, settings_.max_local_keyframes);
    stats_.local_points = static_cast<int>(local_.points.size());
    if (local_.reference == kNone) return false;
    // Those matched already are in view; the others are looked for.
    std::vector<PointId> in_view;
    std::vector<char> matched(static_cast<std::size_t>(map.point_end()), 0);
    for (const PointId id : current_.points)
      if (id != kNone) matched[static_cast<std::size_t>(id)] = 1, in_view.push_back(id);
    std::vector<PointId> others;
    others.reserve(local_.points.size());
    for (const PointId id : local_.points)
      if (!matched[static_cast<std::size_t>(id)]) others.push_back(id);
    match_projections(optics_, map, others, 4, MatchLimits(), current_, &in_view);
    stats_.matches = current_.matches();
    stats_.inliers = refine_pose(optics_, map, current_);
    if (stats_.inliers >= settings_.min_inliers / 2) {
      align_matches(optics_, map, *pyramid_, current_);
      refine_aligned(map);
    }
    for (const PointId id : in_view) ++map.point(id)->visible;
    for (const PointId id : current_.points)
      if (id != kNone) ++map.point(id)->found;
    return stats_.inliers >= (stats_.recovered ? settings_.min_relocalized : settings_.min_inliers);
  }

  // Aligned matches of the static world fit within a fraction of a pixel. Where many do not, the
  // pose may be a compromise with people whom no mask covers yet: it gives way to one that more
  // matches agree on, if there is one.
  void refine_aligned(const Map& map) {
    constexpr double kUsualShare = 0.8;
    const std::vector<PointId> matched = current_.points;
    const int matches = current_.matches();
    stats_.inliers = refine_pose(optics_, map, current_);
    if (stats_.inliers >= kUsualShare * matches) return;
    TrackedFrame other = current_;
    other.points = matched;
    std::vector<PoseObservation> observations = pose_observations(optics_, map, other);
    const auto T = solve_pnp_ransac(optics_.camera, optics_.noise, observations,
                                    settings_.min_inliers, 300, 1.0);
    if (!T) return;
    other.T_camera_world = *T;
    const int inliers = refine_pose(optics_, map, other, 4);
    if (inliers <= stats_.inliers) return;
    stats_.inliers = inliers;
    current_ = std::move(other);
  }

  void accept(Map& map, bool mapper_busy) {
    if (keyframe_due(map, mapper_busy)) insert_keyframe(map);
    record(map);
  }

  void record(const Map& map) {
    const KeyframeId reference = new_keyframe_ != kNone ? new_keyframe_ : local_.reference;
    if (tracking_ && !records_.empty()) {
      motion_ = current_.T_camera_world * last_pose(map).inverse();
      motion_dt_ = current_.frame.timestamp - records_.back().timestamp();
    } else {
      motion_.reset();
    }
    records_.emplace_back(map, reference, current_);
  }

  bool keyframe_due(const Map& map, bool mapper_busy) const {
    // However slow the camera, never two frames in a row: the second would be judged by nothing but
    // what the first, which may be wrong, has put into the map.
    if (after_keyframe_ || !clock_.reached_since(keyframe_s_, settings_.min_keyframe_gap_s))
      return false;
    // Points of the reference that are worth finding: seen more than once, once there was time.
    const int min_observations = map.keyframe_count() <= 2 ? 1 : 2;
    int reference_points = 0;
    for (const PointId id : map.keyframe(local_.reference)->points)
      if (const MapPoint* p = map.point(id))
        reference_points += static_cast<int>(p->observations.size()) >= min_observations;
    const bool weak = stats_.inliers < settings_.keyframe_ratio * reference_points;
    const bool very_weak = stats_.inliers < 0.3 * reference_points || stats_.inliers < 60;
    if (mapper_busy) return very_weak && clock_.reached_since(keyframe_s_, kBusyGapS);
    return weak || very_weak || clock_.reached_since(keyframe_s_, settings_.max_keyframe_gap_s);
  }

  void insert_keyframe(Map& map) {
    Keyframe& k = map.add_keyframe(current_.frame, current_.T_camera_world);
    const Eigen::Isometry3d T_world_camera = current_.T_camera_world.inverse();
    for (std::size_t i = 0; i < current_.points.size(); ++i) {
      if (MapPoint* p = map.point(current_.points[i])) {
        map.observe(*p, k, static_cast<int>(i));
        continue;
      }
      FrameKeypoint& f = k.frame.keypoints[i];
      if (f.depth_m <= 0) continue;
      const Eigen::Vector3d p = optics_.camera.unproject(f.x, f.y, f.depth_m);
      MapPoint& added = map.add_point(T_world_camera * p, k, static_cast<int>(i));
      added.patch = cut_patch(*pyramid_, optics_.camera, f.pixel(), f.octave,
                              current_.T_camera_world.linear(), f.depth_m);
      // What the patch shows is the point: here it is where it is.
      f.refined = !added.patch.empty();
      current_.points[i] = added.id;
      local_.points.push_back(current_.points[i]);
    }
    map.update_connections(k.id);
    new_keyframe_ = k.id;
    keyframe_s_ = clock_.now_s();
    stats_.keyframe = true;
  }

  Optics optics_;
  Settings settings_;
  const ImagePyramid* pyramid_ = nullptr;  // of the frame that is tracked now
  TrackedFrame current_;
  LocalMap local_;
  std::vector<FrameRecord> records_;
  std::size_t settled_ = 0;  // records_ before
  StartReview start_;
  Stats stats_;
  KeyframeId new_keyframe_ = kNone;
  std::optional<Eigen::Isometry3d> motion_;
  double motion_dt_ = 0;
  bool tracking_ = false, after_keyframe_ = false;
  FrameClock clock_;
  double keyframe_s_ = 0;               // when the last keyframe was made
  std::optional<double> lost_since_s_;  // the first lost frame's
};

}  // namespace stillpoint::rgbd_slam
