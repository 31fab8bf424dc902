// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <mutex>
#include <opencv2/core.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "stillpoint/backends/rgbd_slam/fair_mutex.hpp"
#include "stillpoint/backends/rgbd_slam/image_pyramid.hpp"
#include "stillpoint/backends/rgbd_slam/map.hpp"
#include "stillpoint/backends/rgbd_slam/pose_history.hpp"
#include "stillpoint/backends/rgbd_slam/tracked_frame.hpp"

namespace stillpoint::rgbd_slam {

/// Tracks the first frames again, once more of the room is known.
///
/// At the start nobody knows yet who moves. A person close by may take the first poses along, and
/// the trajectory begins wrong. So the first frames are kept and tracked a second time, the last
/// one first, on those points only that later keyframes see: later than the frame by a while, and
/// later than the last frame that was far off. A pose that these points fit clearly worse than the
/// one found on them is replaced. Right poses stay as they are, so nothing changes after a start
/// among nobody.
class StartReview {
 public:
  /// Takes a frame that will be tracked. One of the first is kept, about 0.5 MB at 640 x 480, until
  /// run() has judged it. The first is the newest that comes before any is tracked (`started`). The
  /// caller holds the map's lock.
  void keep(const KeypointFrame& frame, const cv::Mat& gray, bool started) {
    if (over_) return;
    if (!started) kept_.clear();
    // Without a clock, or with one that was set back, nobody knows which keyframes are later.
    if (!kept_.empty() && frame.timestamp <= kept_.back().frame.timestamp) {
      over_ = true;
      kept_.clear();
      return;
    }
    if (kept_.empty()) start_s_ = frame.timestamp;
    if (frame.timestamp - start_s_ < kFirstS && kept_.size() < kMostFrames)
      kept_.push_back({frame, gray.clone()});
  }

  /// Judges the frames, if it is time. The caller's thread is the only one that moves keyframes;
  /// `lock`, the map's, is held for one frame (about 5 ms) at a time.
  void run(const CameraModel& model, Map& map, FairMutex& lock, PoseHistory& history) {
    std::vector<Kept> kept;
    {
      const std::lock_guard<FairMutex> guard(lock);
      if (over_ || kept_.empty() || history.size() == 0 ||
          history.timestamp(history.size() - 1) - start_s_ < kJudgeAfterS)
        return;
      over_ = true;
      kept.swap(kept_);
    }
    double right_from_s = start_s_;  // no frame from here on was far off
    double next_s = start_s_;        // of the frame judged before: its time and T_camera_world
    std::optional<Eigen::Isometry3d> next, after_next;
    for (std::size_t k = kept.size(); k-- > 0;) {
      const std::lock_guard<FairMutex> guard(lock);
      const double time_s = kept[k].frame.timestamp;
      const std::optional<std::size_t> record = history.find(time_s);
      if (!record) continue;  // it was lost
      Eigen::Isometry3d T = history.pose(map, *record);
      std::vector<Eigen::Isometry3d> guesses{T};
      if (after_next) guesses.push_back(*next * after_next->inverse() * *next);
      const double later_s = std::max(time_s + kLaterS, right_from_s);
      const auto found = track_again(model, map, kept[k], later_s, guesses);
      if (!found && !next) continue;  // no keyframe is so much later yet
      if (!found) break;              // earlier frames are still farther from what is known
      const Fit before = fit(model, map, *found, T);
      if (before.error > kWorse * fit(model, map, *found, found->T_camera_world).error) {
        if (before.share < kLeastShare) right_from_s = std::max(right_from_s, next_s);
        T = found->T_camera_world;
        correct(map, history, *record, *found, later_s);
      }
      after_next = std::exchange(next, T);
      next_s = time_s;
    }
  }

 private:
  // Frames of the first seconds are judged when the map is so old.
  static constexpr double kFirstS = 1.5, kJudgeAfterS = 2.25;
  // At most so many: 60 MB at 640 x 480.
  static constexpr std::size_t kMostFrames = 120;
  // How much later than a frame a keyframe must be for its points to count: the next few may be
  // wrong, too.
  static constexpr double kLaterS = 0.34;
  static constexpr int kFewestInliers = 25;
  // A pose is wrong whose mean squared error is so many times that of the pose found again. Among
  // nobody it is 1.16 times at most (fr1/rpy); a pose that is off by 6 mm has 1.3 times.
  static constexpr double kWorse = 1.25;
  // It is far off, and may have led others astray, if fewer points than this share fit. Many fit a
  // wrong pose, too: far points hardly tell a translation from a rotation.
  static constexpr double kLeastShare = 0.93;
  static constexpr double kFitsSigmas = 3;

  struct Kept {
    KeypointFrame frame;
    cv::Mat gray;
  };

  // The frame's pose by the points that keyframes after `later_s` see; none if these are too few.
  static std::optional<TrackedFrame> track_again(const CameraModel& model, const Map& map,
                                                 const Kept& kept, double later_s,
                                                 const std::vector<Eigen::Isometry3d>& guesses) {
    std::vector<KeyframeId> later;
    for (const KeyframeId id : map.keyframe_ids())
      if (map.keyframe(id)->timestamp() > later_s) later.push_back(id);
    const std::vector<PointId> points = map.points_of(later);
    TrackedFrame best;
    int most = 0;
    for (const Eigen::Isometry3d& guess : guesses) {
      TrackedFrame f(kept.frame);
      f.T_camera_world = guess;
      match_projections(model, map, points, 15, f);
      const int inliers = refine_pose(model, map, f);
      if (inliers > most) most = inliers, best = std::move(f);
    }
    if (most < kFewestInliers) return std::nullopt;
    match_projections(model, map, points, 4, best);
    refine_pose(model, map, best);
    cv::Mat gray_float;
    kept.gray.convertTo(gray_float, CV_32F);
    ImagePyramid pyramid;
    pyramid.build(gray_float, model.levels, model.scale_factor);
    align_matches(model, map, pyramid, best);
    if (refine_pose(model, map, best) < kFewestInliers) return std::nullopt;
    return best;
  }

  struct Fit {
    double share;  // of the matches, those within kFitsSigmas
    double error;  // the mean of their squared errors in sigmas; those beyond count as just there
  };

  // How well the matches fit a pose.
  static Fit fit(const CameraModel& model, const Map& map, const TrackedFrame& found,
                 const Eigen::Isometry3d& T_camera_world) {
    Fit sum{0, 0};
    for (std::size_t k = 0; k < found.points.size(); ++k) {
      const MapPoint* point = map.point(found.points[k]);
      if (!point) continue;
      const Eigen::Vector3d p = T_camera_world * point->position;
      const FrameKeypoint& keypoint = found.frame.keypoints[k];
      double sigmas = kFitsSigmas;
      if (p.z() > 0.1)
        sigmas = (model.camera.project(p) - keypoint.pixel()).norm() / model.sigma_px(keypoint);
      sum.share += sigmas < kFitsSigmas;
      sum.error += std::pow(std::min(sigmas, kFitsSigmas), 2);
    }
    return {sum.share / found.matches(), sum.error / found.matches()};
  }

  // Gives a frame the pose `found`, relative to the first keyframe after `later_s`. If it is a
  // keyframe, it forgets what it saw from its wrong pose; all other frames stay where they are.
  static void correct(Map& map, PoseHistory& history, std::size_t record, const TrackedFrame& found,
                      double later_s) {
    KeyframeId later;
    Keyframe* own = nullptr;
    for (const KeyframeId id : map.keyframe_ids()) {
      if (map.keyframe(id)->timestamp() == found.frame.timestamp) own = map.keyframe(id);
      if (!later && map.keyframe(id)->timestamp() > later_s) later = id;
    }
    std::vector<Eigen::Isometry3d> poses;
    for (std::size_t i = 0; i < history.size(); ++i) poses.push_back(history.pose(map, i));
    poses[record] = found.T_camera_world;
    if (own) replace_pose(map, *own, found);
    for (std::size_t i = 0; i < history.size(); ++i)
      if (!history.pose(map, i).isApprox(poses[i])) history.attach(map, i, later, poses[i]);
  }

  static void replace_pose(Map& map, Keyframe& keyframe, const TrackedFrame& found) {
    for (const PointId id : std::vector<PointId>(keyframe.points)) map.forget(id, keyframe.id);
    keyframe.T_camera_world = found.T_camera_world;
    for (std::size_t k = 0; k < found.points.size(); ++k) {
      MapPoint* p = map.point(found.points[k]);
      if (!p) continue;
      keyframe.frame.keypoints[k] = found.frame.keypoints[k];
      map.observe(*p, keyframe, k);
      map.refresh(*p);
    }
    map.update_connections(keyframe.id);
  }

  std::vector<Kept> kept_;
  bool over_ = false;
  double start_s_ = 0;
};

}  // namespace stillpoint::rgbd_slam
