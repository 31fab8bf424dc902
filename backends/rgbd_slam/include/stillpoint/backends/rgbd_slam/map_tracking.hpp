// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "stillpoint/backends/rgbd_slam/local_map.hpp"
#include "stillpoint/backends/rgbd_slam/pnp.hpp"
#include "stillpoint/backends/rgbd_slam/pose_history.hpp"
#include "stillpoint/backends/rgbd_slam/relocalizer.hpp"
#include "stillpoint/backends/rgbd_slam/tracked_frame.hpp"

namespace stillpoint::rgbd_slam {

/// Follows the camera in the map, frame by frame, and decides on keyframes.
///
/// The predicted pose projects the local map into the frame; matches near the projections give the
/// pose; then the local map is gathered anew around them, matched closely, and the pose refined; a
/// pose that too few of the matches agree on is contested. If that fails, wider, then anywhere in
/// the map; so, too, where few matches tell of a leap. A frame that finds too few is lost; after a
/// leap the next one is looked for from the last good one. The caller holds the map's lock.
class MapTracking {
 public:
  struct Settings {
    /// Fewer agreeing matches than this: lost; and the number that a relocalisation needs.
    int min_inliers = 20, min_relocalized = 30;
    /// Keypoints with depth that the first frame needs.
    int min_start_points = 80;
    /// A keyframe is due when the matches fall below this share of those of the reference
    /// keyframe's points, or below `fallen_ratio` of those right after the newest keyframe; at the
    /// latest after so many seconds; at the earliest after `min`.
    double keyframe_ratio = 0.95, fallen_ratio = 0.7;
    double max_keyframe_gap_s = 0.5, min_keyframe_gap_s = 1.0 / 15;
    /// The map is started anew when it is lost for so long with fewer keyframes than that.
    double restart_after_s = 1;
    std::size_t restart_keyframes = 4;
    std::size_t max_local_keyframes = 40;
  };

  /// What happened to the last frame. Without keypoints (a black image, or all of it masked) it
  /// is lost; without depth it is tracked on what the map knows.
  struct Stats {
    int keypoints = 0, with_depth = 0;
    int matches = 0, inliers = 0, local_points = 0;
    bool keyframe = false, recovered = false, restart_due = false;
  };

  MapTracking(const CameraModel& model, const Settings& settings)
      : model_(model), settings_(settings) {}

  /// Tracks a frame; false: lost. With `mapper_busy` a keyframe waits if it can.
  bool track(Map& map, PlaceIndex& index, KeypointFrame frame, const ImagePyramid& pyramid,
             bool mapper_busy) {
    // A host without timestamps, or one whose clock was set back, still gets its keyframes.
    now_s_ += frame.timestamp > last_s_ ? frame.timestamp - last_s_ : 1.0 / 30;
    last_s_ = frame.timestamp;
    std::vector<PointId> last_seen;
    for (const PointId id : current_.points)
      if (id) last_seen.push_back(id);
    current_ = TrackedFrame(std::move(frame));
    pyramid_ = &pyramid;
    after_keyframe_ = stats_.keyframe;
    stats_ = Stats();
    stats_.keypoints = static_cast<int>(current_.frame.size());
    for (const FrameKeypoint& k : current_.frame.keypoints) stats_.with_depth += k.depth_m > 0;
    bool ok = false, leaps = false;
    if (map.keyframe_count() == 0) {
      ok = start(map);
    } else {
      if (tracking_) {
        const Eigen::Isometry3d predicted =
            history_.motion_until(current_.frame.timestamp) * history_.last_pose(map);
        ok = follow(map, last_seen, predicted) && follow_local_map(map);
        leaps = ok && is_leap_from(predicted);
      }
      if (!ok || leaps)
        ok = find_anywhere(map, index, leaps ? kSureInliers : settings_.min_relocalized);
      if (ok) count_sightings(map);
      if (ok && inliers_after_keyframe_ == 0) inliers_after_keyframe_ = stats_.inliers;
      if (ok && keyframe_due(map, mapper_busy)) insert_keyframe(map);
    }
    if (ok) {
      history_.add(map, stats_.keyframe ? newest_keyframe_ : local_.reference,
                   current_.frame.timestamp, current_.T_camera_world, tracking_);
      lost_since_s_.reset();
      tracked_s_ = now_s_;
    } else {
      if (!leaps) history_.forget_motion();
      if (!lost_since_s_) lost_since_s_ = now_s_;
      stats_.restart_due = passed(*lost_since_s_, settings_.restart_after_s) &&
                           map.keyframe_count() > 0 &&
                           map.keyframe_end() < settings_.restart_keyframes;
    }
    tracking_ = ok || leaps;
    return ok;
  }

  const TrackedFrame& current() const { return current_; }
  const Stats& stats() const { return stats_; }
  /// The newest keyframe: the last frame's if stats().keyframe.
  KeyframeId newest_keyframe() const { return newest_keyframe_; }
  PoseHistory& history() { return history_; }

 private:
  // With so many the camera is sure to be where it was predicted.
  static constexpr int kSureInliers = 60;
  // With the mapper behind, keyframes wait so long.
  static constexpr double kBusyGapS = 1.0 / 6;
  // No camera in a hand or on a robot changes its speed by so much from frame to frame.
  static constexpr double kMostSpeedChangeM_s = 3;
  // Images whose stamps come in bursts, as of arrival, are as far apart as others.
  static constexpr double kLeastStepS = 0.02;

  // Whether so much time has passed, but for the jitter of timestamps: less than a frame at 90 Hz.
  bool passed(double since_s, double wanted_s) const { return now_s_ - since_s > wanted_s - 0.01; }

  bool start(Map& map) {
    if (stats_.with_depth < settings_.min_start_points) return false;
    insert_keyframe(map);
    return true;
  }

  // First the points of the last frame; all of the local map only if these do not do.
  bool follow(Map& map, const std::vector<PointId>& last_seen, const Eigen::Isometry3d& predicted) {
    const Eigen::Isometry3d last = history_.last_pose(map);
    match_from(map, last_seen, predicted, 10);
    if (stats_.inliers >= kSureInliers) return true;
    // The camera rotates faster or slower than before: search wider, around the prediction and the
    // last pose; the one with more inliers wins.
    Stats best = stats_;
    TrackedFrame found = current_;
    for (const Eigen::Isometry3d& from : {predicted, last}) {
      match_from(map, local_.points, from, 40);
      if (stats_.inliers > best.inliers) best = stats_, found = current_;
    }
    stats_ = best;
    current_ = std::move(found);
    return stats_.inliers >= settings_.min_inliers / 2;
  }

  bool find_anywhere(Map& map, const PlaceIndex& index, int min_inliers) {
    const int inliers = relocalize(model_, map, index, min_inliers, current_);
    stats_.recovered = inliers > 0 && follow_local_map(map) && stats_.inliers >= min_inliers;
    return stats_.recovered;
  }

  // Fills stats_.matches and stats_.inliers.
  void match_from(const Map& map, const std::vector<PointId>& candidates,
                  const Eigen::Isometry3d& T, double radius_px) {
    current_.points.assign(current_.frame.size(), PointId());
    current_.T_camera_world = T;
    stats_.matches = match_projections(model_, map, candidates, radius_px, current_);
    stats_.inliers = 0;
    if (stats_.matches >= settings_.min_inliers)
      stats_.inliers = refine_pose(model_, map, current_);
  }

  bool follow_local_map(Map& map) {
    local_ = gather_local_map(map, current_.points, settings_.max_local_keyframes);
    stats_.local_points = static_cast<int>(local_.points.size());
    if (!local_.reference) return false;
    // Those matched already are in view; the others are looked for.
    in_view_.clear();
    std::vector<char> matched(map.point_end(), 0);
    for (const PointId id : current_.points)
      if (id) matched[id.index()] = 1, in_view_.push_back(id);
    std::vector<PointId> others;
    others.reserve(local_.points.size());
    for (const PointId id : local_.points)
      if (!matched[id.index()]) others.push_back(id);
    match_projections(model_, map, others, 4, current_, &in_view_);
    stats_.matches = current_.matches();
    stats_.inliers = refine_pose(model_, map, current_);
    if (stats_.inliers >= settings_.min_inliers / 2) {
      align_matches(model_, map, *pyramid_, current_);
      refine_aligned(map);
    }
    return stats_.inliers >= settings_.min_inliers;
  }

  void count_sightings(Map& map) {
    for (const PointId id : in_view_) ++map.point(id)->visible;
    for (const PointId id : current_.points)
      if (id) ++map.point(id)->found;
  }

  // Aligned matches of the static world fit within a fraction of a pixel. Where many do not, the
  // pose may be a compromise with people whom no mask covers yet: it gives way to one that more
  // matches agree on, and no fewer of the confirmed ones, if there is one.
  void refine_aligned(const Map& map) {
    constexpr double kUsualShare = 0.8;
    const std::vector<PointId> matched = current_.points;
    const int matches = current_.matches();
    stats_.inliers = refine_pose(model_, map, current_);
    if (stats_.inliers >= kUsualShare * matches) return;
    TrackedFrame other = current_;
    other.points = matched;
    std::vector<PoseObservation> observations = pose_observations(model_, map, other);
    const auto T = solve_pnp_ransac(model_.camera, model_.noise, observations,
                                    settings_.min_inliers, 300, 1.0);
    if (!T) return;
    other.T_camera_world = *T;
    const int inliers = refine_pose(model_, map, other, 4);
    if (inliers <= stats_.inliers ||
        count_confirmed(map, other.points) < count_confirmed(map, current_.points))
      return;
    stats_.inliers = inliers;
    current_ = std::move(other);
  }

  // Where people fill the image, the best of the wrong poses may have just enough matches; or the
  // prediction is wrong, as the last pose was such a one.
  bool is_leap_from(const Eigen::Isometry3d& predicted) const {
    const Eigen::Isometry3d T_predicted_now = predicted * current_.T_camera_world.inverse();
    return stats_.inliers < kSureInliers &&
           T_predicted_now.translation().norm() >
               kMostSpeedChangeM_s * std::max(now_s_ - tracked_s_, kLeastStepS);
  }

  bool keyframe_due(const Map& map, bool mapper_busy) const {
    // However slow the camera, never two frames in a row: the second would be judged by nothing but
    // what the first, which may be wrong, has put into the map.
    if (after_keyframe_ || !passed(keyframe_s_, settings_.min_keyframe_gap_s)) return false;
    // Points of the reference that are worth finding: seen more than once, once there was time.
    const int min_observations = map.keyframe_count() <= 2 ? 1 : 2;
    int reference_points = 0;
    for (const PointId id : map.keyframe(local_.reference)->points)
      if (const MapPoint* p = map.point(id))
        reference_points += static_cast<int>(p->observations.size()) >= min_observations;
    // A reference that knows little, as one from a start among people, never calls for another.
    const bool weak = stats_.inliers < settings_.keyframe_ratio * reference_points ||
                      stats_.inliers < settings_.fallen_ratio * inliers_after_keyframe_;
    const bool very_weak = stats_.inliers < 0.3 * reference_points || stats_.inliers < 60;
    if (mapper_busy) return very_weak && passed(keyframe_s_, kBusyGapS);
    return weak || very_weak || passed(keyframe_s_, settings_.max_keyframe_gap_s);
  }

  void insert_keyframe(Map& map) {
    Keyframe& k = map.add_keyframe(current_.frame, current_.T_camera_world);
    const Eigen::Isometry3d T_world_camera = current_.T_camera_world.inverse();
    for (std::size_t i = 0; i < current_.points.size(); ++i) {
      if (MapPoint* p = map.point(current_.points[i])) {
        map.observe(*p, k, i);
        continue;
      }
      FrameKeypoint& f = k.frame.keypoints[i];
      if (f.depth_m <= 0) continue;
      const Eigen::Vector3d p = model_.camera.unproject(f.x, f.y, f.depth_m);
      MapPoint& added = map.add_point(T_world_camera * p, k, i);
      added.patch = cut_patch(*pyramid_, model_.camera, f.pixel(), f.octave,
                              current_.T_camera_world.linear(), f.depth_m);
      // What the patch shows is the point: here it is where it is.
      f.refined = !added.patch.empty();
      current_.points[i] = added.id;
      local_.points.push_back(added.id);
    }
    map.update_connections(k.id);
    newest_keyframe_ = k.id;
    keyframe_s_ = now_s_;
    inliers_after_keyframe_ = 0;
    stats_.keyframe = true;
  }

  CameraModel model_;
  Settings settings_;
  const ImagePyramid* pyramid_ = nullptr;  // of the frame that is tracked now
  TrackedFrame current_;
  LocalMap local_;
  std::vector<PointId> in_view_;  // those of the local map that the current frame should see
  PoseHistory history_;
  Stats stats_;
  KeyframeId newest_keyframe_;
  bool tracking_ = false, after_keyframe_ = false;
  double now_s_ = 0, last_s_ = 0;       // this frame's time: our own, and its timestamp
  double tracked_s_ = 0;                // when a frame was tracked last
  double keyframe_s_ = 0;               // when the newest keyframe was made
  int inliers_after_keyframe_ = 0;      // of the first frame tracked since then; 0: none yet
  std::optional<double> lost_since_s_;  // the first lost frame's
};

}  // namespace stillpoint::rgbd_slam
