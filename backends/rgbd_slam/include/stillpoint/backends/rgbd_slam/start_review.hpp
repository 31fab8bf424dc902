// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cstddef>
#include <mutex>
#include <opencv2/core.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "stillpoint/backends/rgbd_slam/fair_mutex.hpp"
#include "stillpoint/backends/rgbd_slam/frame_record.hpp"
#include "stillpoint/backends/rgbd_slam/image_pyramid.hpp"
#include "stillpoint/backends/rgbd_slam/map.hpp"
#include "stillpoint/backends/rgbd_slam/tracked_frame.hpp"

namespace stillpoint::rgbd_slam {

/// Judges the first frames of a map again, once it is settled.
///
/// At the start nobody may know yet who moves: where people fill half of the picture and no mask
/// covers them, the first frames go with them, and when the masks come the rest of the way has a
/// wrong beginning. So the first frames are kept, and tracked anew: those of the first second after
/// one and a half, those of the first two after three, the last first, by those points only that
/// keyframes of a while later see, and later than the last frame that was wrong. Where the old pose
/// loses some of these, the new one takes its place; a keyframe forgets what it had seen from
/// there. Frames that were right (nearly all) stay as they are.
class StartReview {
 public:
  /// Whether a frame that follows `records` is one of the first, to be kept (about 0.4 MB at 640 x
  /// 480) until it has been judged twice.
  static bool wants(const std::vector<FrameRecord>& records, double timestamp) {
    return records.empty() || (records.size() < kMostFrames &&
                               timestamp - records.front().timestamp() < kRounds.back().judged_s);
  }

  /// Keeps the next tracked frame, one that it wants(), as it was before its keypoints were
  /// aligned.
  void keep(KeypointFrame frame, const cv::Mat& gray) {
    kept_.push_back({std::move(frame), gray.clone()});
  }

  void reset() {
    kept_.clear();
    round_ = right_ = 0;
  }

  /// Judges the frames kept, which are the first ones of `records`, if it is time. No other thread
  /// may change the map's keyframes meanwhile, or reset this; `lock`, the map's, is held for one
  /// frame (about 5 ms) at a time.
  void run(const Optics& optics, Map& map, FairMutex& lock, std::vector<FrameRecord>& records) {
    std::size_t judged = 0;
    {
      const std::lock_guard<FairMutex> guard(lock);
      if (round_ == kRounds.size() || records.size() < 3) return;
      const double start_s = records.front().timestamp();
      if (records.back().timestamp() - start_s < kRounds[round_].settled_s) return;
      // Two frames after the last one are looked at, too.
      const std::size_t most = std::min(kept_.size(), records.size() - 2);
      while (judged < most && records[judged].timestamp() - start_s < kRounds[round_].judged_s)
        ++judged;
    }
    for (std::size_t i = judged; i-- > 0;) {
      const std::lock_guard<FairMutex> guard(lock);
      const double later_s =
          std::max(records[i].timestamp() + kLaterS, records[right_].timestamp());
      std::optional<TrackedFrame> found = track_again(optics, map, records, i, later_s, kept_[i]);
      if (!found) break;  // earlier frames are still farther from what is known
      if (fits(optics, map, *found, records[i].pose(map))) continue;
      right_ = std::max(right_, i + 1);
      const KeyframeId later = first_keyframe_after(map, later_s);
      if (later == kNone) break;
      if (Keyframe* own = keyframe_of(map, records[i].timestamp()))
        mend(map, *own, *found, records, later);
      records[i] = FrameRecord(map, later, *found);
    }
    const std::lock_guard<FairMutex> guard(lock);
    if (++round_ == kRounds.size()) std::vector<Kept>().swap(kept_);
  }

 private:
  static constexpr std::size_t kMostFrames = 60;

  // Frames of the first seconds are judged, once so much later ones were tracked: a little less
  // than 1, 1.5, 2 and 3 s, so that 30 Hz gives 30, 45, 60 and 90 frames whatever the rounding.
  struct Round {
    double judged_s, settled_s;
  };
  static constexpr std::array<Round, 2> kRounds{{{0.98, 1.45}, {1.98, 2.95}}};

  static constexpr int kFewestInliers = 25;
  // After which a keyframe may speak: the next ones may be wrong in the same way.
  static constexpr double kLaterS = 0.34;
  // Of the points that are found again. Many fit a wrong pose, too: what is far hardly tells a step
  // from a turn.
  static constexpr double kFits = 0.93;

  struct Kept {
    KeypointFrame frame;
    cv::Mat gray;
  };

  // The frame's pose by the points that keyframes after `later_s` see; none if these are too few.
  static std::optional<TrackedFrame> track_again(const Optics& optics, const Map& map,
                                                 const std::vector<FrameRecord>& records,
                                                 std::size_t i, double later_s, const Kept& kept) {
    const std::vector<PointId> points = points_seen_after(map, later_s);
    // As it went on afterwards it may have come, or it was right before.
    const Eigen::Isometry3d next = records[i + 1].pose(map);
    const Eigen::Isometry3d after = records[i + 2].pose(map);
    std::optional<TrackedFrame> best;
    int most = 0;
    for (const Eigen::Isometry3d& guess : {records[i].pose(map), next * after.inverse() * next}) {
      TrackedFrame f(kept.frame);
      f.T_camera_world = guess;
      match_projections(optics, map, points, 15, MatchLimits(), f);
      const int inliers = refine_pose(optics, map, f);
      if (inliers > most) most = inliers, best = std::move(f);
    }
    if (most < kFewestInliers) return std::nullopt;
    ImagePyramid pyramid;
    pyramid.build(kept.gray, optics.levels, optics.scale_factor);
    match_projections(optics, map, points, 4, MatchLimits(), *best);
    refine_pose(optics, map, *best);
    align_matches(optics, map, pyramid, *best);
    if (refine_pose(optics, map, *best) < kFewestInliers) return std::nullopt;
    return best;
  }

  // Whether the matches fit a pose as well.
  static bool fits(const Optics& optics, const Map& map, const TrackedFrame& f,
                   const Eigen::Isometry3d& T_camera_world) {
    int matches = 0, fitting = 0;
    for (std::size_t k = 0; k < f.points.size(); ++k) {
      const MapPoint* point = map.point(f.points[k]);
      if (!point) continue;
      ++matches;
      const Eigen::Vector3d p = T_camera_world * point->position;
      const FrameKeypoint& keypoint = f.frame.keypoints[k];
      fitting += p.z() > 0.1 && (optics.camera.project(p) - keypoint.pixel()).norm() <
                                    3 * optics.sigma_px(keypoint);
    }
    return fitting >= kFits * matches;
  }

  static std::vector<PointId> points_seen_after(const Map& map, double timestamp) {
    std::vector<PointId> points;
    for (PointId id = 0; id < map.point_end(); ++id) {
      const MapPoint* p = map.point(id);
      if (!p) continue;
      for (const Observation& o : p->observations)
        if (map.keyframe(o.keyframe)->timestamp() > timestamp) {
          points.push_back(id);
          break;
        }
    }
    return points;
  }

  static KeyframeId first_keyframe_after(const Map& map, double timestamp) {
    for (KeyframeId id = 0; id < map.keyframe_end(); ++id)
      if (const Keyframe* k = map.keyframe(id); k && k->timestamp() > timestamp) return id;
    return kNone;
  }

  static Keyframe* keyframe_of(Map& map, double timestamp) {
    for (KeyframeId id = 0; id < map.keyframe_end(); ++id)
      if (Keyframe* k = map.keyframe(id); k && k->timestamp() == timestamp) return k;
    return nullptr;
  }

  // Gives a keyframe the pose and the points of `found`; it forgets all others. Frames that are
  // known relative to it stay where they are, relative to keyframe `later`.
  static void mend(Map& map, Keyframe& keyframe, const TrackedFrame& found,
                   std::vector<FrameRecord>& records, KeyframeId later) {
    std::vector<Eigen::Isometry3d> poses;
    for (const FrameRecord& r : records) poses.push_back(r.pose(map));
    for (std::size_t k = 0; k < keyframe.points.size(); ++k)
      if (const PointId id = keyframe.points[k]; id != kNone && id != found.points[k])
        map.forget(id, keyframe.id);
    keyframe.T_camera_world = found.T_camera_world;
    for (std::size_t k = 0; k < found.points.size(); ++k) {
      MapPoint* p = map.point(found.points[k]);
      if (!p) continue;
      keyframe.frame.keypoints[k] = found.frame.keypoints[k];
      map.observe(*p, keyframe, static_cast<int>(k));
      map.refresh(*p);
    }
    map.update_connections(keyframe.id);
    for (std::size_t r = 0; r < records.size(); ++r)
      if (!records[r].pose(map).isApprox(poses[r])) records[r].hang_on(map, later, poses[r]);
  }

  std::vector<Kept> kept_;
  std::size_t round_ = 0;
  std::size_t right_ = 0;  // no frame from here on was wrong
};

}  // namespace stillpoint::rgbd_slam
