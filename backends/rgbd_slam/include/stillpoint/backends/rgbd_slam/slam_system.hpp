// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <atomic>
#include <cstddef>
#include <exception>
#include <memory>
#include <mutex>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "stillpoint/backends/rgbd_slam/features.hpp"
#include "stillpoint/backends/rgbd_slam/image_pyramid.hpp"
#include "stillpoint/backends/rgbd_slam/local_mapping.hpp"
#include "stillpoint/backends/rgbd_slam/loop_closing.hpp"
#include "stillpoint/backends/rgbd_slam/map.hpp"
#include "stillpoint/backends/rgbd_slam/map_tracking.hpp"
#include "stillpoint/backends/rgbd_slam/place_index.hpp"
#include "stillpoint/backends/rgbd_slam/threads.hpp"
#include "stillpoint/backends/rgbd_slam/tracker_input.hpp"
#include "stillpoint/core/error.hpp"
#include "stillpoint/tracking/tracker.hpp"

namespace stillpoint::rgbd_slam {

/// RGB-D SLAM on static keypoints: tracking, local mapping, loop closing.
///
/// Two modes: deterministic (the default: each keyframe is worked in before track() returns; the
/// same input gives the same trajectory), and threaded (local mapping and loop closing in their own
/// threads, track() stays fast). The world is the first tracked camera; poses of the first
/// frames that followed people whom no mask covered are corrected later (StartReview).
/// A frame that is lost has no pose; after relocalisation the trajectory goes on in the same frame
/// of reference. Call it from one thread. Settings::odometry() makes a visual odometry of it.
///
/// Should mapping or loop closing fail (memory runs out), the caller gets an Error that says so,
/// once: threaded, from the next call of extract(), track() or finish(), which has done nothing
/// then and may be called again; else from track(), which has tracked the frame. The system stays
/// usable: the map keeps what it had, only the work on that keyframe is missing. (Inside of a solve
/// of Ceres itself, memory that runs out ends the process: Ceres calls std::terminate.)
class SlamSystem final : public Tracker {
 public:
  struct Settings {
    OrbExtractor::Settings features;
    KeypointFrame::Settings depth;
    NoiseModel noise;
    MapTracking::Settings tracking;
    LocalMapping::Settings mapping;
    LoopClosing::Settings loops;
    /// Old poses become better as the map does: with keyframes that are adjusted, by StartReview,
    /// FrameRecord::settle() and finish().
    bool revise_poses = true;
    /// Mapping and loop closing in threads of their own.
    bool threaded = false;

    /// Visual odometry: few keyframes are adjusted at once, no loops are closed, and what track()
    /// has returned stays.
    static Settings odometry() {
      Settings settings;
      settings.tracking.keyframe_ratio = 0.7;
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
    if (!extractor_) extractor_ = std::make_unique<OrbExtractor>(settings.features);
    model_ = {camera, settings.noise, extractor_->levels(), extractor_->scale_factor()};
    tracking_ = std::make_unique<MapTracking>(model_, settings.tracking);
    mapping_ = std::make_unique<LocalMapping>(model_, settings.mapping);
    loops_ = std::make_unique<LoopClosing>(model_, settings.loops);
    if (!settings.threaded) return;
    loop_worker_ = std::make_unique<Worker>([this](int id) { close_loops(id); });
    mapping_worker_ = std::make_unique<Worker>([this](int id) {
      build_map(id, mapping_worker_->waiting());
      loop_worker_->push(id);
    });
  }

  const std::vector<cv::KeyPoint>& extract(const RgbdFrame& frame,
                                           const DynamicMask& mask) override {
    rethrow();
    check_frame(frame);
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
    rethrow();
    check_track("SlamSystem", frame, gray_.size(), selection, features_);
    KeypointFrame keypoints(frame, model_.camera, features_, selection.kept, model_.scale_factor,
                            settings_.depth);
    pyramid_.build(gray_, model_.levels, model_.scale_factor);
    const bool busy = mapping_worker_ && !mapping_worker_->idle();
    std::optional<Eigen::Isometry3d> pose;
    KeyframeId made = kNone;
    bool restart = false;
    {
      const std::lock_guard<FairMutex> guard(map_mutex_);
      if (tracking_->track(map_, index_, std::move(keypoints), pyramid_, busy))
        pose = tracking_->current().T_camera_world.inverse();
      made = tracking_->new_keyframe();
      restart = tracking_->stats().restart_due;
    }
    if (restart) start_anew();
    if (made != kNone) {
      if (mapping_worker_) {
        mapping_worker_->push(made);
      } else {
        const std::atomic<bool> never{false};
        build_map(made, never);
        close_loops(made);
      }
    }
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
    for (const KeyframeId id : map_.keyframe_ids())
      trajectory.push_back(
          {map_.keyframe(id)->timestamp(), map_.keyframe(id)->T_camera_world.inverse()});
    return trajectory;
  }

  /// Ends background work, adjusts the map as a whole once more, and refines the last frames on it.
  /// O(map): 0.1 to 0.3 s for 50 keyframes, 6 s for 400. Without new keyframes, nothing changes any
  /// more.
  void finish() override {
    drain();
    rethrow();
    if (!settings_.revise_poses) return;
    if (adjusted_to_ != map_.keyframe_end()) loops_->adjust_all(map_, mapping_mutex_, map_mutex_);
    adjusted_to_ = map_.keyframe_end();
    tracking_->history().settle(model_, map_, map_mutex_, true);
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
  void build_map(KeyframeId id, const std::atomic<bool>& hurry) {
    const std::lock_guard<std::mutex> guard(mapping_mutex_);
    {
      const std::lock_guard<FairMutex> map_guard(map_mutex_);
      if (id >= map_.keyframe_end() || !map_.keyframe(id)) return;
    }
    name_errors("local mapping", id, [&] {
      mapping_->process(map_, map_mutex_, index_, id, hurry);
      if (!settings_.revise_poses) return;
      tracking_->history().review_start(model_, map_, map_mutex_);
      tracking_->history().settle(model_, map_, map_mutex_);
    });
  }

  // Runs a step of the background work; what it throws comes as an Error that names the step.
  template <class Step>
  static void name_errors(const char* name, KeyframeId id, Step&& step) {
    const auto failed = [&](const std::string& reason) {
      return Error("SlamSystem: " + std::string(name) + " of keyframe " + std::to_string(id) +
                   ": expected it to be worked into the map, found " + reason +
                   "; tracking goes on in the map without what is missing");
    };
    try {
      step();
    } catch (const std::exception& e) {
      throw failed(e.what());
    } catch (...) {
      throw failed("an exception of unknown type");
    }
  }

  // What background work threw since the last call.
  void rethrow() {
    if (mapping_worker_) mapping_worker_->rethrow();
    if (loop_worker_) loop_worker_->rethrow();
  }

  void drain() {
    if (mapping_worker_) mapping_worker_->drain();
    if (loop_worker_) loop_worker_->drain();
  }

  void close_loops(KeyframeId id) {
    {
      const std::lock_guard<FairMutex> map_guard(map_mutex_);
      if (id >= map_.keyframe_end()) return;
    }
    name_errors("loop closing", id,
                [&] { loops_->process(map_, mapping_mutex_, map_mutex_, index_, id); });
  }

  // A map of a few keyframes that is not found again is worth less than a new start; its frames are
  // lost frames then.
  void start_anew() {
    drain();
    const std::lock_guard<std::mutex> guard(mapping_mutex_);
    const std::lock_guard<FairMutex> map_guard(map_mutex_);
    map_.clear();
    adjusted_to_ = 0;
    index_ = PlaceIndex();
    tracking_->reset();
    mapping_->reset();
    loops_->reset();
  }

  Settings settings_;
  CameraModel model_;
  std::unique_ptr<FeatureExtractor> extractor_;
  cv::Mat gray_;
  ImagePyramid pyramid_;
  Features features_;
  // Who works on the map holds the first; who only passes by, the second; both in this order.
  std::mutex mapping_mutex_;
  mutable FairMutex map_mutex_;
  Map map_;
  PlaceIndex index_;
  KeyframeId adjusted_to_ = 0;  // keyframe_end() when all of the map was adjusted last
  std::unique_ptr<MapTracking> tracking_;
  std::unique_ptr<LocalMapping> mapping_;
  std::unique_ptr<LoopClosing> loops_;
  // Last: the threads end before what they work on. The mapper feeds the loop closer.
  std::unique_ptr<Worker> loop_worker_, mapping_worker_;
};

}  // namespace stillpoint::rgbd_slam
