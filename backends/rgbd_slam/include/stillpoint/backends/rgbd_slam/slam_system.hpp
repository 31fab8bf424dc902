// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <deque>
#include <future>
#include <memory>
#include <mutex>
#include <opencv2/core.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "stillpoint/backends/rgbd_slam/fair_mutex.hpp"
#include "stillpoint/backends/rgbd_slam/features.hpp"
#include "stillpoint/backends/rgbd_slam/image_pyramid.hpp"
#include "stillpoint/backends/rgbd_slam/local_mapping.hpp"
#include "stillpoint/backends/rgbd_slam/loop_closing.hpp"
#include "stillpoint/backends/rgbd_slam/map.hpp"
#include "stillpoint/backends/rgbd_slam/map_tracking.hpp"
#include "stillpoint/backends/rgbd_slam/place_index.hpp"
#include "stillpoint/backends/rgbd_slam/start_review.hpp"
#include "stillpoint/backends/rgbd_slam/tracker_input.hpp"
#include "stillpoint/core/camera.hpp"
#include "stillpoint/tracking/tracker.hpp"

namespace stillpoint::rgbd_slam {

/// RGB-D SLAM on static keypoints: tracking, local mapping, loop closing.
///
/// Two modes: deterministic (the default: each keyframe is worked in before track() returns; the
/// same input gives the same trajectory), and threaded (local mapping and loop closing in the
/// background, track() stays fast). The world is the first tracked camera. A frame that is lost has
/// no pose; after relocalisation the trajectory goes on in the same frame of reference. Call it
/// from one thread. Settings::odometry() makes a visual odometry of it.
///
/// What the background work throws (memory runs out) the next track() or finish() throws.
class SlamSystem final : public Tracker {
 public:
  struct Settings {
    OrbExtractor::Settings features;
    KeypointFrame::Settings depth;
    NoiseModel noise;
    MapTracking::Settings tracking;
    LocalMapping::Settings mapping;
    LoopClosing::Settings loops;
    /// Iterations of finish().
    int final_iterations = 15;
    /// Old poses become better as the map does: they move with keyframes that are adjusted.
    bool revise_poses = true;
    /// Mapping and loop closing in the background.
    bool threaded = false;

    /// Visual odometry: few keyframes are adjusted at once, no loops are closed, and what track()
    /// has returned stays.
    static Settings odometry() {
      Settings settings;
      settings.tracking.keyframe_ratio = 0.7;
      settings.tracking.fallen_ratio = 0;
      settings.mapping.bundle_keyframes = 3;
      settings.loops.enabled = false;
      settings.revise_poses = false;
      return settings;
    }
  };

  explicit SlamSystem(const Camera& camera) : SlamSystem(camera, Settings()) {}

  /// Throws Error for a camera without focal lengths. `extractor`: none = OrbExtractor.
  SlamSystem(const Camera& camera, const Settings& settings,
             std::unique_ptr<FeatureExtractor> extractor = nullptr)
      : settings_(settings), extractor_(std::move(extractor)) {
    check_camera("SlamSystem", camera);
    settings.noise.check();
    if (!extractor_) extractor_ = std::make_unique<OrbExtractor>(settings.features);
    model_ = {camera, settings.noise, extractor_->levels(), extractor_->scale_factor()};
    start_anew();
  }

  ~SlamSystem() override {
    const std::lock_guard<FairMutex> guard(map_mutex_);
    waiting_.clear();
  }

  const std::vector<cv::KeyPoint>& extract(const RgbdFrame& frame,
                                           const DynamicMask& mask) override {
    check_frame(frame, model_.camera);
    copy_gray(frame, gray_);
    try {
      extractor_->extract(gray_, mask.image, features_);
      check_features("SlamSystem::extract", features_, model_.levels);
    } catch (...) {
      features_ = Features();  // nothing that a track() could take
      throw;
    }
    return features_.keypoints;
  }

  std::optional<Eigen::Isometry3d> track(const RgbdFrame& frame, const DynamicMask&,
                                         const Selection& selection) override {
    check_track("SlamSystem", frame, gray_.size(), selection, features_);
    const bool busy = in_background();
    if (!busy) wait_for_background();  // throws what it threw
    if (stats().restart_due) start_anew();
    KeypointFrame keypoints(frame, model_.camera, features_, selection.kept, model_.scale_factor,
                            settings_.depth);
    gray_.convertTo(gray_float_, CV_32F);
    pyramid_.build(gray_float_, model_.levels, model_.scale_factor);
    std::optional<Eigen::Isometry3d> pose;
    {
      const std::lock_guard<FairMutex> guard(map_mutex_);
      if (settings_.revise_poses) review_.keep(keypoints, gray_, tracking_->history().size() > 0);
      if (tracking_->track(map_, index_, std::move(keypoints), pyramid_, busy))
        pose = tracking_->current().T_camera_world.inverse();
      if (stats().keyframe) waiting_.push_back(tracking_->newest_keyframe());
      hurry_ = busy && !waiting_.empty();
    }
    if (!settings_.threaded)
      build_map();
    else if (!busy && !waiting_.empty())
      background_ = std::async(std::launch::async, [this] { build_map(); });
    return pose;
  }

  std::optional<Eigen::Isometry3d> predicted_motion() const override {
    return tracking_->history().motion();
  }

  Trajectory trajectory() const override {
    const std::lock_guard<FairMutex> guard(map_mutex_);
    const PoseHistory& history = tracking_->history();
    return settings_.revise_poses ? history.trajectory(map_) : history.as_tracked();
  }

  /// Poses of the keyframes that are in the map now.
  Trajectory keyframe_trajectory() const {
    const std::lock_guard<FairMutex> guard(map_mutex_);
    Trajectory trajectory;
    for (const auto& [id, T_camera_world] : map_.poses())
      trajectory.push_back({map_.keyframe(id)->timestamp(), T_camera_world.inverse()});
    return trajectory;
  }

  /// Ends background work and adjusts the map as a whole once more.
  /// O(map): 0.1 to 0.3 s for 50 keyframes, 6 s for 400. Without new keyframes, nothing changes any
  /// more.
  void finish() override {
    wait_for_background();
    build_map();
    if (!settings_.revise_poses) return;
    review_.run(model_, map_, map_mutex_, tracking_->history());
    if (adjusted_to_ != map_.keyframe_end())
      adjust_keyframes(map_, map_mutex_, model_, {}, settings_.final_iterations);
    adjusted_to_ = map_.keyframe_end();
  }

  const MapTracking::Stats& stats() const { return tracking_->stats(); }
  int loops_closed() const { return loops_->closed(); }
  std::size_t keyframes() const {
    const std::lock_guard<FairMutex> guard(map_mutex_);
    return map_.keyframe_count();
  }
  std::size_t map_points() const {
    const std::lock_guard<FairMutex> guard(map_mutex_);
    return map_.point_count();
  }
  /// World coordinates of the map's points, metres. O(points).
  std::vector<Eigen::Vector3d> map_point_positions() const {
    const std::lock_guard<FairMutex> guard(map_mutex_);
    std::vector<Eigen::Vector3d> positions;
    positions.reserve(map_.point_count());
    for (const PointId id : map_.point_ids()) positions.push_back(map_.point(id)->position);
    return positions;
  }

 private:
  // Works the new keyframes into the map, one after the other.
  void build_map() {
    for (;;) {
      KeyframeId id;
      {
        const std::lock_guard<FairMutex> guard(map_mutex_);
        if (waiting_.empty()) return;
        id = waiting_.front();
        waiting_.pop_front();
        hurry_ = !waiting_.empty();
      }
      mapping_->process(map_, map_mutex_, index_, id, hurry_);
      loops_->process(map_, map_mutex_, index_, id, hurry_);
      review_.run(model_, map_, map_mutex_, tracking_->history());
    }
  }

  bool in_background() const {
    return background_.valid() &&
           background_.wait_for(std::chrono::seconds(0)) != std::future_status::ready;
  }

  void wait_for_background() {
    if (background_.valid()) background_.get();
  }

  // Begins with an empty map. One of a few keyframes that is not found again is worth less; its
  // frames are lost frames then.
  void start_anew() {
    wait_for_background();
    waiting_.clear();
    map_ = Map();
    index_ = PlaceIndex();
    adjusted_to_ = 0;
    review_ = StartReview();
    tracking_ = std::make_unique<MapTracking>(model_, settings_.tracking);
    mapping_ = std::make_unique<LocalMapping>(model_, settings_.mapping);
    loops_ = std::make_unique<LoopClosing>(model_, settings_.loops);
  }

  Settings settings_;
  CameraModel model_;
  std::unique_ptr<FeatureExtractor> extractor_;
  cv::Mat gray_, gray_float_;
  ImagePyramid pyramid_;  // of gray_float_
  Features features_;
  mutable FairMutex map_mutex_;  // of the map, the index, and what waits
  Map map_;
  PlaceIndex index_;
  std::size_t adjusted_to_ = 0;     // keyframe_end() when all of the map was adjusted last
  std::deque<KeyframeId> waiting_;  // to be worked into the map
  std::atomic<bool> hurry_{false};  // another one waits
  std::unique_ptr<MapTracking> tracking_;
  std::unique_ptr<LocalMapping> mapping_;
  std::unique_ptr<LoopClosing> loops_;
  StartReview review_;
  std::future<void> background_;  // last: ends before what it works on
};

}  // namespace stillpoint::rgbd_slam
