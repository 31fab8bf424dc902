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

#include "stillpoint/backends/rgbd_slam/frame_record.hpp"
#include "stillpoint/backends/rgbd_slam/image_pyramid.hpp"
#include "stillpoint/backends/rgbd_slam/map.hpp"
#include "stillpoint/backends/rgbd_slam/threads.hpp"
#include "stillpoint/backends/rgbd_slam/tracked_frame.hpp"

namespace stillpoint::rgbd_slam {

/// Checks the first frames of a map again, once more of it is known.
///
/// At the start nobody may know yet who moves: where people fill half of the image and no mask
/// covers them, the first poses follow the people, and the trajectory begins wrong. So the first
/// frames are kept and tracked again: those of the first second after one and a half, those of the
/// first two after three; the last one first. Only those points count that keyframes see which are
/// later by a while, and later than the last frame that was wrong. A pose that loses some of these
/// points is replaced, and its keyframe forgets what it had seen from there. Right poses (nearly
/// all) stay as they are. Of a camera faster than 40 Hz not every frame is kept: the poses of those
/// between are interpolated.
class StartReview {
 public:
  /// Whether a frame that follows `records` is one of the first.
  static bool wants(const std::vector<FrameRecord>& records, double timestamp) {
    return records.empty() || timestamp - records.front().timestamp() < kRounds.back().judged_s;
  }

  /// Takes a tracked frame that it wants(), as it was before its keypoints were aligned; `record`:
  /// its place among the records. Kept (about 0.4 MB at 640 x 480) until it has been judged twice,
  /// unless it follows the last one too closely; a keyframe always is.
  void keep(KeypointFrame frame, const cv::Mat& gray, std::size_t record, bool keyframe) {
    if (kept_.size() == kMostFrames || round_ == kRounds.size()) return;
    if (!kept_.empty() && !keyframe && frame.timestamp - kept_.back().frame.timestamp < kSpacingS)
      return;
    kept_.push_back({std::move(frame), gray.clone(), record});
  }

  void reset() {
    kept_.clear();
    round_ = right_ = 0;
  }

  /// Judges the frames kept, which are the first ones of `records`, if it is time. No other thread
  /// may change the map's keyframes meanwhile, or reset this; `lock`, the map's, is held for one
  /// frame (about 5 ms) at a time.
  void run(const CameraModel& model, Map& map, FairMutex& lock, std::vector<FrameRecord>& records) {
    std::size_t judged = 0;
    {
      const std::lock_guard<FairMutex> guard(lock);
      if (round_ == kRounds.size() || records.size() < 3) return;
      const double start_s = records.front().timestamp();
      if (records.back().timestamp() - start_s < kRounds[round_].settled_s) return;
      // Two frames after the last one are looked at, too.
      while (judged < kept_.size() && kept_[judged].record + 2 < records.size() &&
             records[kept_[judged].record].timestamp() - start_s < kRounds[round_].judged_s)
        ++judged;
    }
    bool next_corrected = false;  // the frame kept after this one
    for (std::size_t n = judged; n-- > 0;) {
      const std::lock_guard<FairMutex> guard(lock);
      const std::size_t i = kept_[n].record;
      const std::size_t end = n + 1 < kept_.size() ? kept_[n + 1].record : next_record(records, i);
      const double later_s =
          std::max(records[i].timestamp() + kLaterS, records[right_].timestamp());
      std::optional<TrackedFrame> found = track_again(model, map, records, i, later_s, kept_[n]);
      if (!found) break;  // earlier frames are still farther from what is known
      const KeyframeId later = first_keyframe_after(map, later_s);
      const bool wrong = !fits(model, map, *found, records[i].pose(map));
      if (wrong) {
        right_ = std::max(right_, end);
        if (later == kNone) break;
        if (Keyframe* own = keyframe_of(map, records[i].timestamp()))
          correct(map, *own, *found, records, later);
        records[i] = FrameRecord(map, later, *found);
      }
      if (later != kNone && (wrong || next_corrected))
        interpolate_between(map, records, i, end, later);
      next_corrected = wrong;
    }
    const std::lock_guard<FairMutex> guard(lock);
    if (++round_ == kRounds.size()) std::vector<Kept>().swap(kept_);
  }

 private:
  // Every frame at 30 Hz, with the jitter of its timestamps, is kept, at 60 Hz every second and at
  // 90 Hz every third one.
  static constexpr double kSpacingS = 0.024;
  // Whatever the timestamps are: those of 2 s so far apart, and the keyframes between.
  static constexpr std::size_t kMostFrames = 120;

  // Frames of the first seconds are judged, once so much later ones were tracked: a little less
  // than 1, 1.5, 2 and 3 s, so that 30 Hz gives 30, 45, 60 and 90 frames whatever the rounding.
  struct Round {
    double judged_s, settled_s;
  };
  static constexpr std::array<Round, 2> kRounds{{{0.98, 1.45}, {1.98, 2.95}}};

  static constexpr int kFewestInliers = 25;
  // How much later a keyframe must be for its points to count: the next ones may be wrong, too.
  static constexpr double kLaterS = 0.34;
  // Share of the points found again that must fit. Many fit a wrong pose, too: far points hardly
  // tell a translation from a rotation.
  static constexpr double kFits = 0.93;

  struct Kept {
    KeypointFrame frame;
    cv::Mat gray;
    std::size_t record;
  };

  // The first record that is as long after record `i` as frames are kept; the last one if there is
  // none.
  static std::size_t next_record(const std::vector<FrameRecord>& records, std::size_t i) {
    std::size_t next = std::min(i + 1, records.size() - 1);
    while (next + 1 < records.size() &&
           records[next].timestamp() - records[i].timestamp() < kSpacingS)
      ++next;
    return next;
  }

  // Interpolates the poses between two frames that were checked, of which one was corrected. Their
  // own poses do not count: what misled the others comes and goes from frame to frame.
  static void interpolate_between(const Map& map, std::vector<FrameRecord>& records,
                                  std::size_t begin, std::size_t end, KeyframeId later) {
    const Eigen::Isometry3d from = records[begin].pose(map).inverse();
    const Eigen::Isometry3d to = records[end].pose(map).inverse();
    const double begin_s = records[begin].timestamp(), span_s = records[end].timestamp() - begin_s;
    for (std::size_t r = begin + 1; r < end; ++r) {
      const double share = span_s > 0 ? (records[r].timestamp() - begin_s) / span_s : 0;
      Eigen::Isometry3d T_world_camera = Eigen::Isometry3d::Identity();
      T_world_camera.linear() = Eigen::Quaterniond(from.linear())
                                    .slerp(share, Eigen::Quaterniond(to.linear()))
                                    .toRotationMatrix();
      T_world_camera.translation() = (1 - share) * from.translation() + share * to.translation();
      records[r].correct(map, later, T_world_camera.inverse());
    }
  }

  // The frame's pose by the points that keyframes after `later_s` see; none if these are too few.
  static std::optional<TrackedFrame> track_again(const CameraModel& model, const Map& map,
                                                 const std::vector<FrameRecord>& records,
                                                 std::size_t i, double later_s, const Kept& kept) {
    const std::vector<PointId> points = points_seen_after(map, later_s);
    // As it went on afterwards it may have come, or it was right before.
    const std::size_t second = next_record(records, i), third = next_record(records, second);
    const Eigen::Isometry3d next = records[second].pose(map);
    const Eigen::Isometry3d after = records[third].pose(map);
    std::optional<TrackedFrame> best;
    int most = 0;
    for (const Eigen::Isometry3d& guess : {records[i].pose(map), next * after.inverse() * next}) {
      TrackedFrame f(kept.frame);
      f.T_camera_world = guess;
      match_projections(model, map, points, 15, f);
      const int inliers = refine_pose(model, map, f);
      if (inliers > most) most = inliers, best = std::move(f);
    }
    if (most < kFewestInliers) return std::nullopt;
    ImagePyramid pyramid;
    pyramid.build(kept.gray, model.levels, model.scale_factor);
    match_projections(model, map, points, 4, *best);
    refine_pose(model, map, *best);
    align_matches(model, map, pyramid, *best);
    if (refine_pose(model, map, *best) < kFewestInliers) return std::nullopt;
    return best;
  }

  // Whether the matches fit a pose as well.
  static bool fits(const CameraModel& model, const Map& map, const TrackedFrame& f,
                   const Eigen::Isometry3d& T_camera_world) {
    int matches = 0, fitting = 0;
    for (std::size_t k = 0; k < f.points.size(); ++k) {
      const MapPoint* point = map.point(f.points[k]);
      if (!point) continue;
      ++matches;
      const Eigen::Vector3d p = T_camera_world * point->position;
      const FrameKeypoint& keypoint = f.frame.keypoints[k];
      fitting += p.z() > 0.1 &&
                 (model.camera.project(p) - keypoint.pixel()).norm() < 3 * model.sigma_px(keypoint);
    }
    return fitting >= kFits * matches;
  }

  static std::vector<PointId> points_seen_after(const Map& map, double timestamp) {
    std::vector<PointId> points;
    for (const PointId id : map.point_ids()) {
      const auto& seen = map.point(id)->observations;
      if (std::any_of(seen.begin(), seen.end(), [&](const Observation& o) {
            return map.keyframe(o.keyframe)->timestamp() > timestamp;
          }))
        points.push_back(id);
    }
    return points;
  }

  static KeyframeId first_keyframe_after(const Map& map, double timestamp) {
    for (const KeyframeId id : map.keyframe_ids())
      if (map.keyframe(id)->timestamp() > timestamp) return id;
    return kNone;
  }

  static Keyframe* keyframe_of(Map& map, double timestamp) {
    for (const KeyframeId id : map.keyframe_ids())
      if (map.keyframe(id)->timestamp() == timestamp) return map.keyframe(id);
    return nullptr;
  }

  // Gives a keyframe the pose and the points of `found`; it forgets all others. Frames that are
  // known relative to it stay where they are, relative to keyframe `later`.
  static void correct(Map& map, Keyframe& keyframe, const TrackedFrame& found,
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
      if (!records[r].pose(map).isApprox(poses[r])) records[r].attach_to(map, later, poses[r]);
  }

  std::vector<Kept> kept_;
  std::size_t round_ = 0;
  std::size_t right_ = 0;  // no frame from here on was wrong
};

}  // namespace stillpoint::rgbd_slam
