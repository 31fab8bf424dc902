// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "stillpoint/backends/rgbd_slam/features.hpp"
#include "stillpoint/backends/rgbd_slam/frame_clock.hpp"
#include "stillpoint/backends/rgbd_slam/image_pyramid.hpp"
#include "stillpoint/backends/rgbd_slam/keypoint_frame.hpp"
#include "stillpoint/backends/rgbd_slam/matching.hpp"
#include "stillpoint/backends/rgbd_slam/patch.hpp"
#include "stillpoint/backends/rgbd_slam/pnp.hpp"
#include "stillpoint/backends/rgbd_slam/pose_optimizer.hpp"
#include "stillpoint/backends/rgbd_slam/tracker_input.hpp"
#include "stillpoint/tracking/tracker.hpp"

namespace stillpoint::rgbd_slam {

/// Small RGB-D visual odometry: a bounded map of points without bundle adjustment or loop closing.
///
/// A frame is tracked by projecting the map with the predicted motion, matching near the
/// projections and refining the pose; when too little of the map is still in view, the frame
/// becomes a keyframe: seen points are averaged, new ones are made from depth. After a loss the
/// whole map is matched without a guess (PnP with RANSAC), so that the trajectory goes on in the
/// same frame of reference. Deterministic. Called from one thread. O(keypoints + map points).
class RgbdOdometry final : public Tracker {
 public:
  struct Settings {
    OrbExtractor::Settings features;
    KeypointFrame::Settings depth;
    NoiseModel noise;
    /// Fewer matches that agree with one pose than this: lost.
    int min_inliers = 20;
    /// Keypoints with depth that the first frame needs.
    int min_start_points = 60;
    /// A keyframe is made below this share of the last one's keypoints, and after so many seconds.
    double keyframe_ratio = 0.33;
    double max_keyframe_gap_s = 2.0 / 3;
    /// Map points kept; those not seen for longest go first.
    int max_points = 20000;
  };

  /// What happened to the last frame.
  struct Stats {
    int matches = 0, inliers = 0;
    bool keyframe = false, recovered = false;
  };

  explicit RgbdOdometry(const Camera& camera) : RgbdOdometry(camera, Settings()) {}

  /// Throws Error for a camera without focal lengths.
  RgbdOdometry(const Camera& camera, const Settings& settings,
               std::unique_ptr<FeatureExtractor> extractor = nullptr)
      : camera_(camera), settings_(settings), extractor_(std::move(extractor)) {
    check_camera("RgbdOdometry", camera);
    if (!extractor_) extractor_ = std::make_unique<OrbExtractor>(settings.features);
  }

  const std::vector<cv::KeyPoint>& extract(const RgbdFrame& frame,
                                           const DynamicMask& mask) override {
    check_frame(frame);
    copy_gray(frame, gray_);
    try {
      extractor_->extract(gray_, mask.image, features_);
      check_features("RgbdOdometry::extract", features_, extractor_->levels());
    } catch (...) {
      features_ = Features();  // nothing that a track() could take
      throw;
    }
    return features_.keypoints;
  }

  std::optional<Eigen::Isometry3d> track(const RgbdFrame& frame, const DynamicMask&,
                                         const Selection& selection) override {
    check_track("RgbdOdometry", frame, gray_.size(), selection, features_);
    current_ = KeypointFrame(frame, camera_, features_, selection.kept, extractor_->scale_factor(),
                             settings_.depth);
    pyramid_.build(gray_, extractor_->levels(), extractor_->scale_factor());
    stats_ = Stats();
    clock_.advance(frame.timestamp);
    if (points_.empty()) return start();

    std::optional<Eigen::Isometry3d> T;
    if (tracked_last_) {
      T = refine(scaled_motion() * T_camera_world_, 12);
      if (!T) T = refine(T_camera_world_, 40);
    }
    if (!T) T = recover();
    if (T) T = refine(*T, 4);
    if (T) T = polish(*T);
    if (!T) {
      tracked_last_ = false;
      return std::nullopt;
    }
    accept(*T);
    return T_camera_world_.inverse();
  }

  /// The motion between the last two tracked frames.
  std::optional<Eigen::Isometry3d> predicted_motion() const override {
    if (!tracked_last_) return std::nullopt;
    return velocity_;
  }

  Trajectory trajectory() const override { return trajectory_; }

  const Stats& stats() const { return stats_; }
  std::size_t map_points() const { return points_.size(); }

 private:
  // A point that one keyframe saw, and no frame for so long, is given up. (91 frames at 30 Hz.)
  static constexpr double kForgetAfterS = 91.0 / 30;

  struct Point {
    Eigen::Vector3d position;
    Descriptor descriptor;
    ScaleRange scale;
    double last_seen_s;
    int observations;
    Patch patch;
  };

  // The last motion, stretched by the real time between frames: frames may be dropped.
  Eigen::Isometry3d scaled_motion() const {
    const double dt = current_.timestamp - trajectory_.back().timestamp;
    const double ratio = last_dt_ > 0 && dt > 0 ? std::min(dt / last_dt_, 10.0) : 1;
    if (std::abs(ratio - 1) < 0.1) return velocity_;
    const Eigen::AngleAxisd turn(velocity_.linear());
    Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
    motion.linear() = Eigen::AngleAxisd(turn.angle() * ratio, turn.axis()).toRotationMatrix();
    motion.translation() = velocity_.translation() * ratio;
    return motion;
  }

  std::optional<Eigen::Isometry3d> start() {
    int with_depth = 0;
    for (const FrameKeypoint& k : current_.keypoints) with_depth += k.depth_m > 0;
    if (with_depth < settings_.min_start_points) return std::nullopt;
    matched_.assign(current_.size(), -1);
    accept(Eigen::Isometry3d::Identity());
    return T_camera_world_.inverse();
  }

  PoseObservation observation(std::size_t keypoint, const Eigen::Vector3d& point, int index) const {
    const FrameKeypoint& k = current_.keypoints[keypoint];
    PoseObservation o;
    o.point = point;
    o.pixel = k.pixel();
    o.inverse_depth = k.depth_m > 0 ? 1.0 / k.depth_m : 0;
    o.sigma_px =
        (k.refined ? settings_.noise.sigma_refined_px : settings_.noise.sigma_px) * k.scale;
    o.index = index;
    return o;
  }

  // Matches the map near its projections and optimises the pose; no value: too few agree. Leaves
  // the agreeing matches in matched_ (point of each keypoint, -1 for none).
  std::optional<Eigen::Isometry3d> refine(Eigen::Isometry3d T, double radius_px) {
    const double log_scale = std::log(extractor_->scale_factor());
    matched_.assign(current_.size(), -1);
    std::vector<PoseObservation> observations;
    std::vector<int> keypoint_of, found;
    for (std::size_t i = 0; i < points_.size(); ++i) {
      const Eigen::Vector3d p = T * points_[i].position;
      if (p.z() < 0.1) continue;
      const Eigen::Vector2d pixel = camera_.project(p);
      if (!current_.contains(pixel)) continue;
      const int octave = points_[i].scale.octave_at(p.norm(), log_scale);
      if (octave < -1 || octave > extractor_->levels()) continue;
      const double radius =
          radius_px * std::pow(extractor_->scale_factor(), std::clamp(octave, 0, 4));
      const int k = match_at(current_, {pixel, radius, octave - 1, octave + 1},
                             points_[i].descriptor, MatchLimits(), matched_, found);
      if (k < 0) continue;
      const auto keypoint = static_cast<std::size_t>(k);
      matched_[keypoint] = static_cast<int>(i);
      observations.push_back(observation(keypoint, points_[i].position, k));
    }
    stats_.matches = static_cast<int>(observations.size());
    return optimize(observations, T);
  }

  // Optimises the pose and takes back the matches that do not agree.
  std::optional<Eigen::Isometry3d> optimize(std::vector<PoseObservation>& observations,
                                            Eigen::Isometry3d T) {
    if (static_cast<int>(observations.size()) < settings_.min_inliers) return std::nullopt;
    stats_.inliers = optimize_pose(camera_, settings_.noise, observations, T);
    for (const PoseObservation& o : observations)
      if (!o.inlier) matched_[static_cast<std::size_t>(o.index)] = -1;
    if (stats_.inliers < settings_.min_inliers) return std::nullopt;
    return T;
  }

  // Moves the matched keypoints to where the points' patches fit, and optimises once more. A pose
  // that too few of them agree on is contested.
  std::optional<Eigen::Isometry3d> polish(const Eigen::Isometry3d& T) {
    std::vector<PoseObservation> observations;
    for (std::size_t i = 0; i < matched_.size(); ++i) {
      if (matched_[i] < 0) continue;
      const Point& p = points_[static_cast<std::size_t>(matched_[i])];
      FrameKeypoint& k = current_.keypoints[i];
      const auto place =
          align_patch(pyramid_, camera_, p.patch, T, p.position, k.pixel(), k.octave);
      if (place) {
        k.x = static_cast<float>(place->x()), k.y = static_cast<float>(place->y());
        k.refined = true;
      }
      observations.push_back(observation(i, p.position, static_cast<int>(i)));
    }
    const std::vector<int> matched = matched_;
    const std::optional<Eigen::Isometry3d> fitted = optimize(observations, T);
    if (fitted && stats_.inliers >= 0.8 * static_cast<double>(observations.size())) return fitted;
    // It may be a compromise with people whom no mask covers. Those of the static world fit well.
    std::optional<Eigen::Isometry3d> other =
        solve_pnp_ransac(camera_, settings_.noise, observations, settings_.min_inliers, 300, 0.5);
    if (!other) return fitted;
    const int agreeing = optimize_pose(camera_, settings_.noise, observations, *other, 4);
    const auto misfit = [&](const Eigen::Isometry3d& pose) {
      return pose_misfit(camera_, settings_.noise, observations, pose);
    };
    if (agreeing < settings_.min_inliers || (fitted && misfit(*other) >= misfit(*fitted)))
      return fitted;
    stats_.inliers = agreeing;
    for (const PoseObservation& o : observations) {
      const auto k = static_cast<std::size_t>(o.index);
      matched_[k] = o.inlier ? matched[k] : -1;
    }
    return other;
  }

  // Finds the pose in the map without any guess.
  std::optional<Eigen::Isometry3d> recover() {
    std::vector<Descriptor> known;
    known.reserve(points_.size());
    for (const Point& p : points_) known.push_back(p.descriptor);
    std::vector<PoseObservation> observations;
    for (const DescriptorMatch& m : match_all(current_.descriptors, known, {64, 0.85}))
      observations.push_back(observation(static_cast<std::size_t>(m.first),
                                         points_[static_cast<std::size_t>(m.second)].position,
                                         m.first));
    const auto T = solve_pnp_ransac(camera_, settings_.noise, observations, settings_.min_inliers);
    stats_.recovered = T.has_value();
    return T;
  }

  void accept(const Eigen::Isometry3d& T) {
    const double dt = tracked_last_ ? current_.timestamp - trajectory_.back().timestamp : 0;
    last_dt_ = dt;
    velocity_ = dt > 0 ? T * T_camera_world_.inverse() : Eigen::Isometry3d::Identity();
    T_camera_world_ = T;
    tracked_last_ = true;
    trajectory_.push_back({current_.timestamp, T.inverse()});
    for (const int p : matched_)
      if (p >= 0) points_[static_cast<std::size_t>(p)].last_seen_s = clock_.now_s();
    const bool keyframe = points_.empty() || stats_.recovered ||
                          clock_.reached_since(keyframe_s_, settings_.max_keyframe_gap_s) ||
                          stats_.inliers < settings_.keyframe_ratio * keyframe_inliers_;
    if (keyframe) make_keyframe();
  }

  void make_keyframe() {
    stats_.keyframe = true;
    const Eigen::Isometry3d T_world_camera = T_camera_world_.inverse();
    keyframe_inliers_ = 0;
    for (std::size_t i = 0; i < current_.size(); ++i) {
      const FrameKeypoint& k = current_.keypoints[i];
      keyframe_inliers_ += k.depth_m > 0 || matched_[i] >= 0;
      if (k.depth_m <= 0) continue;
      const Eigen::Vector3d p = camera_.unproject(k.x, k.y, k.depth_m);
      const Eigen::Vector3d world = T_world_camera * p;
      if (matched_[i] >= 0) {
        Point& point = points_[static_cast<std::size_t>(matched_[i])];
        ++point.observations;
        point.position += (world - point.position) / std::min(point.observations, 20);
        point.descriptor = current_.descriptors[i];
        point.scale = ScaleRange(p.norm(), k.scale);
        continue;
      }
      points_.push_back(
          {world, current_.descriptors[i], ScaleRange(p.norm(), k.scale), clock_.now_s(), 1,
           cut_patch(pyramid_, camera_, k.pixel(), k.octave, T_camera_world_.linear(), k.depth_m)});
    }
    keyframe_s_ = clock_.now_s();
    const auto limit = static_cast<std::size_t>(settings_.max_points);
    // Points of one keyframe that were never found again describe nothing that can be found.
    points_.erase(std::remove_if(points_.begin(), points_.end(),
                                 [&](const Point& p) {
                                   return p.observations == 1 &&
                                          clock_.reached_since(p.last_seen_s, kForgetAfterS);
                                 }),
                  points_.end());
    if (points_.size() > limit) {
      std::stable_sort(points_.begin(), points_.end(), [](const Point& a, const Point& b) {
        return a.last_seen_s > b.last_seen_s;
      });
      points_.resize(limit);
    }
  }

  Camera camera_;
  Settings settings_;
  std::unique_ptr<FeatureExtractor> extractor_;
  cv::Mat gray_;
  ImagePyramid pyramid_;
  Features features_;
  KeypointFrame current_;
  std::vector<Point> points_;
  std::vector<int> matched_;
  Trajectory trajectory_;
  Stats stats_;
  Eigen::Isometry3d T_camera_world_ = Eigen::Isometry3d::Identity();
  Eigen::Isometry3d velocity_ = Eigen::Isometry3d::Identity();
  double last_dt_ = 0;
  bool tracked_last_ = false;
  FrameClock clock_;
  double keyframe_s_ = 0;  // when the last keyframe was made
  int keyframe_inliers_ = 0;
};

}  // namespace stillpoint::rgbd_slam
