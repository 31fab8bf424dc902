// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cstddef>
#include <limits>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "stillpoint/core/frame_context.hpp"
#include "stillpoint/core/instance.hpp"
#include "stillpoint/core/object.hpp"
#include "stillpoint/objects/camera_place.hpp"
#include "stillpoint/objects/object_measurement.hpp"
#include "stillpoint/objects/object_tracker_settings.hpp"
#include "stillpoint/objects/position_velocity_filter.hpp"
#include "stillpoint/sensor/sensor_model.hpp"

namespace stillpoint {

/// Follows the objects of the masks from frame to frame: ids, places and velocities.
///
/// The compensator's memory says which instance is which object, where it knows; else the
/// nearest predicted place does (Mahalanobis distance; without depth or poses the overlap of the
/// boxes), so that who comes out from behind a pillar keeps his id. Each object has a Kalman filter
/// in the static world. An instance without a name that lies on another one is the same object,
/// found twice.
///
/// Per frame: finish() with the camera's place at the frame before, observe(), then objects() as
/// soon as the camera's place is known, and again when it is known better. Not thread-safe; one
/// object per camera.
class ObjectTracker {
 public:
  using Settings = ObjectTrackerSettings;

  explicit ObjectTracker(const Settings& settings = {}, const SensorModel& sensor = {})
      : settings_(settings), meter_(sensor, settings.centroid_m) {
    settings.check();
    sensor.check();
  }

  /// Takes the instances of a frame; `memory_ids`: what the compensator calls each of them, -1 (or
  /// none at all) where it does not know. O(instances^2).
  void observe(const FrameContext& context, const std::vector<Instance>& instances,
               const std::vector<int>& memory_ids) {
    begin(context.frame.timestamp);
    for (const ObjectMeasurement& measurement : meter_.measure(context.depth, instances)) {
      const std::size_t i = measurement.instance;
      seen_.emplace_back();
      Seen& seen = seen_.back();
      seen.measurement = measurement;
      seen.memory = i < memory_ids.size() ? memory_ids[i] : -1;
      seen.class_name = instances[i].class_name;
      seen.box = instances[i].box;
      seen.predicted = instances[i].predicted;
      if (!seen.predicted || instances[i].late_s > 0)
        seen.at_s = context.frame.timestamp - instances[i].late_s;
    }
  }

  /// The objects of the last frame. `instances` are those of observe(), `place` is the camera's.
  /// The reference stays valid until the next call. O(objects^2) after observe() and
  /// place_changed().
  const std::vector<DynamicObject>& objects(const std::vector<Instance>& instances,
                                            const CameraPlace& place) {
    if (!up_to_date_) {
      settle(place);
      objects_.resize(seen_.size());
      for (std::size_t k = 0; k < seen_.size(); ++k)
        describe(instances[seen_[k].measurement.instance], seen_[k], place, objects_[k]);
      up_to_date_ = true;
    }
    return objects_;
  }

  /// Concludes the last frame: this is where the camera was. Ends what objects() returned.
  void finish(const CameraPlace& place) {
    settle(place);
    objects_.clear();  // their masks may be written to again
    up_to_date_ = false;
  }
  /// The camera's place at the last frame is known better now.
  void place_changed() { settled_up_to_date_ = up_to_date_ = false; }

 private:
  static constexpr double kGate2 = 16.27;  // 99.9 % of chi-square with 3 degrees of freedom
  static constexpr double kNearM = 0.5, kSpeedM = 1.5;  // Euclidean bound: this, and so much per s
  static constexpr double kBodyM = 0.25;    // how far the centroid of a part of a body may be off
  static constexpr double kOutlier2 = 7.8;  // 95 %
  static constexpr double kElsewhereM = 1;  // the memory has taken another object for this one
  static constexpr double kLeastOverlap = 0.3, kOverlapS = 0.5;

  struct Track {
    int id = 0;
    int memory = -1;
    std::string class_name;
    double first_s = 0, last_s = 0;  // seen first and last
    double state_s = 0, box_s = 0;   // of the filter; of the box, in the mask last
    bool located = false;
    int chain = 0;
    PositionVelocityFilter filter;
    cv::Rect box;
    cv::Point2f center_px;
  };
  // What the last frame shows of an object.
  struct Seen {
    int memory = -1;
    std::string class_name;
    cv::Rect box;
    bool predicted = false;
    std::optional<double> at_s;  // of the frame that shows it; none does: it is only remembered
    ObjectMeasurement measurement;
    Eigen::Vector3d position = Eigen::Vector3d::Zero();  // in the world, with its covariance
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
    cv::Point2f shift_px;  // since the frame before
    int track = -1;        // in settled_

    bool measured() const { return measurement.depth_m > 0; }
  };
  struct Pair {
    double cost;
    std::size_t seen, track;
  };

  void begin(double now_s) {
    std::swap(tracks_, settled_);
    next_id_ = settled_next_id_;
    if (now_s <= now_s_) tracks_.clear();  // time went back
    last_s_ = now_s_, now_s_ = now_s;
    const auto lost = [&](const Track& t) {
      return t.box_s < last_s_ && now_s - t.box_s > settings_.max_lost_s;
    };
    tracks_.erase(std::remove_if(tracks_.begin(), tracks_.end(), lost), tracks_.end());
    seen_.clear();
    settled_up_to_date_ = up_to_date_ = false;
  }

  // From tracks_, the objects before the frame, to settled_, those after it.
  void settle(const CameraPlace& place) {
    if (settled_up_to_date_) return;
    settled_up_to_date_ = true;
    settled_ = tracks_;
    settled_next_id_ = next_id_;
    for (Track& track : settled_) {
      if (track.chain != place.chain) track.located = false;
      if (track.located) track.filter.predict(now_s_ - track.state_s, settings_.acceleration_m_s2);
      track.state_s = now_s_;
    }
    const Eigen::Matrix3d R = place.T_world_depth.linear();
    for (Seen& seen : seen_) {
      seen.track = -1;
      seen.position = place.T_world_depth * seen.measurement.centroid;
      seen.covariance = R * seen.measurement.covariance * R.transpose();
    }
    associate_by_memory();
    associate_by_place();
    for (Seen& seen : seen_) update(seen, place.chain);
  }

  void associate_by_memory() {
    for (Seen& seen : seen_)
      for (std::size_t t = 0; seen.memory >= 0 && t < settled_.size(); ++t)
        if (settled_[t].memory == seen.memory && is_of_class(seen, settled_[t]) &&
            !is_elsewhere(seen, settled_[t]))
          seen.track = static_cast<int>(t);
  }

  // Who is named now may be an old track without a name, but by his place only: the memory of the
  // legs that were found first may go over to the whole person.
  static bool is_of_class(const Seen& seen, const Track& track) {
    return seen.class_name.empty() || seen.class_name == track.class_name;
  }

  // A mask that lacks a part of the body has its centroid elsewhere on it.
  static double distance2(const Seen& seen, const Track& track) {
    return track.filter.distance2(seen.position,
                                  seen.covariance + kBodyM * kBodyM * Eigen::Matrix3d::Identity());
  }

  bool is_elsewhere(const Seen& seen, const Track& track) const {
    return seen.measured() && track.located && distance2(seen, track) > kGate2 &&
           (seen.position - track.filter.position()).norm() > kElsewhereM;
  }

  void associate_by_place() {
    taken_.assign(settled_.size(), 0);
    for (const Seen& seen : seen_)
      if (seen.track >= 0) taken_[static_cast<std::size_t>(seen.track)] = 1;
    pairs_.clear();
    for (std::size_t k = 0; k < seen_.size(); ++k)
      for (std::size_t t = 0; seen_[k].track < 0 && t < settled_.size(); ++t)
        if (const double cost = cost_of(seen_[k], settled_[t]); taken_[t] == 0 && cost <= 2)
          pairs_.push_back({cost, k, t});
    std::sort(pairs_.begin(), pairs_.end(), [](const Pair& a, const Pair& b) {
      if (a.cost != b.cost) return a.cost < b.cost;
      return a.seen != b.seen ? a.seen < b.seen : a.track < b.track;
    });
    for (const Pair& pair : pairs_) {
      if (seen_[pair.seen].track >= 0 || taken_[pair.track] != 0) continue;
      seen_[pair.seen].track = static_cast<int>(pair.track);
      taken_[pair.track] = 1;
    }
  }

  // Up to 1 by place, to 2 by overlap or by place without the name; more: not the same object.
  double cost_of(const Seen& seen, const Track& track) const {
    constexpr double kNever = 3;
    if (!seen.class_name.empty() && !track.class_name.empty() &&
        seen.class_name != track.class_name)
      return kNever;
    const double gone_s = now_s_ - track.last_s;
    if (seen.measured() && track.located) {
      const double off_m = (seen.position - track.filter.position()).norm();
      const double d2 = distance2(seen, track);
      const double nameless = is_of_class(seen, track) ? 0 : 1;  // after all that have his name
      return d2 < kGate2 && off_m < kNearM + kSpeedM * gone_s ? d2 / kGate2 + nameless : kNever;
    }
    const double shared = (seen.box & track.box).area();
    const double overlap = shared / (seen.box.area() + track.box.area() - shared);
    return overlap > kLeastOverlap && now_s_ - track.box_s < kOverlapS ? 2 - overlap : kNever;
  }

  void update(Seen& seen, int chain) {
    seen.shift_px = {0, 0};
    if (seen.track < 0) {
      seen.track = static_cast<int>(settled_.size());
      settled_.emplace_back();
      settled_.back().id = settled_next_id_++;
      settled_.back().first_s = settled_.back().last_s = seen.at_s.value_or(now_s_);
      settled_.back().state_s = now_s_;
    } else if (const Track& t = settled_[static_cast<std::size_t>(seen.track)];
               t.box_s == last_s_) {
      seen.shift_px = seen.measurement.center_px - t.center_px;
    }
    Track& track = settled_[static_cast<std::size_t>(seen.track)];
    if (seen.memory >= 0) track.memory = seen.memory;
    if (!seen.class_name.empty()) track.class_name = seen.class_name;
    track.box = seen.box, track.box_s = now_s_;
    track.center_px = seen.measurement.center_px;
    if (seen.at_s) track.last_s = std::max(track.last_s, *seen.at_s);
    if (!seen.measured()) return;
    if (track.located) {
      // Half a body, or the mask's slip onto somebody else, must not tear the velocity along.
      const double off2 = track.filter.distance2(seen.position, seen.covariance);
      track.filter.correct(seen.position, seen.covariance * std::max(1.0, off2 / kOutlier2));
    } else {
      track.filter.start(seen.position, seen.covariance, settings_.velocity_m_s);
    }
    track.located = true;
    track.chain = chain;
  }

  void describe(const Instance& instance, const Seen& seen, const CameraPlace& place,
                DynamicObject& out) const {
    const Track& track = settled_[static_cast<std::size_t>(seen.track)];
    out.id = track.id;
    out.class_name = track.class_name;
    out.score = instance.score;
    out.box = instance.box;
    out.mask = instance.mask;
    out.predicted = seen.predicted;
    out.depth_m = seen.measurement.depth_m;
    out.shift_px = seen.shift_px;
    out.tracked_s = now_s_ - track.first_s;
    out.unseen_s = now_s_ - track.last_s;
    out.in_camera.reset(), out.in_world.reset();
    if (!track.located) return;
    out.in_camera = seen_from(place.T_world_camera.inverse(), track.filter);
    if (place.T_host_world) out.in_world = seen_from(*place.T_host_world, track.filter);
  }

  static ObjectState seen_from(const Eigen::Isometry3d& T, const PositionVelocityFilter& filter) {
    ObjectState state;
    const Eigen::Matrix3d R = T.linear();
    state.centroid_m = T * filter.position();
    state.velocity_m_s = R * filter.velocity();
    state.covariance = filter.covariance(R);
    return state;
  }

  Settings settings_;
  ObjectMeter meter_;
  double now_s_ = -std::numeric_limits<double>::infinity(), last_s_ = now_s_;
  std::vector<Track> tracks_, settled_;  // before the last frame, and after it
  int next_id_ = 0, settled_next_id_ = 0;
  bool settled_up_to_date_ = true, up_to_date_ = true;
  std::vector<Seen> seen_;
  std::vector<Pair> pairs_;
  std::vector<char> taken_;
  std::vector<DynamicObject> objects_;
};

}  // namespace stillpoint
