// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <optional>
#include <utility>
#include <vector>

#include "stillpoint/backends/rgbd_slam/image_pyramid.hpp"
#include "stillpoint/backends/rgbd_slam/map.hpp"
#include "stillpoint/backends/rgbd_slam/matching.hpp"
#include "stillpoint/backends/rgbd_slam/patch.hpp"
#include "stillpoint/backends/rgbd_slam/pose_optimizer.hpp"
#include "stillpoint/core/camera.hpp"

namespace stillpoint::rgbd_slam {

/// The camera, its noise and the pyramid that its keypoints are found in.
struct CameraModel {
  Camera camera;
  NoiseModel noise;
  int levels = 8;
  double scale_factor = 1.2;

  double sigma_px(const FrameKeypoint& k) const {
    return (k.refined ? noise.sigma_refined_px : noise.sigma_px) * k.scale;
  }
};

/// A frame that is being tracked: keypoints, the map point that each shows (or none), pose.
struct TrackedFrame {
  KeypointFrame frame;
  std::vector<PointId> points;
  Eigen::Isometry3d T_camera_world = Eigen::Isometry3d::Identity();

  TrackedFrame() = default;
  explicit TrackedFrame(KeypointFrame f) : frame(std::move(f)), points(frame.size()) {}

  int matches() const {
    return static_cast<int>(points.size()) -
           static_cast<int>(std::count(points.begin(), points.end(), PointId()));
  }
};

/// Projects a point into a camera; no value when it is not in view: behind, outside of the image,
/// too near or too far for the pyramid, or seen from another side.
inline std::optional<Projection> project(const CameraModel& model, const KeypointFrame& frame,
                                         const MapPoint& point,
                                         const Eigen::Isometry3d& T_camera_world) {
  const Eigen::Vector3d p = T_camera_world * point.position;
  if (p.z() < 0.1) return std::nullopt;
  const Eigen::Vector2d pixel = model.camera.project(p);
  if (!frame.contains(pixel)) return std::nullopt;
  const double distance = p.norm();
  const int octave = static_cast<int>(
      std::lround(std::log(point.level0_distance_m / distance) / std::log(model.scale_factor)));
  if (octave < -1 || octave > model.levels ||
      (T_camera_world.linear() * point.view_direction).dot(p) <= 0.5 * distance)
    return std::nullopt;
  return Projection{pixel, octave};
}

/// Whether a keypoint, by its pixel and depth, may show a point at `p` in camera coordinates.
inline bool agrees(const CameraModel& model, const FrameKeypoint& k, const Eigen::Vector3d& p,
                   double depth_sigmas) {
  const double sigma_px = model.noise.sigma_px * k.scale;
  if (p.z() < 0.2 ||
      (model.camera.project(p) - k.pixel()).squaredNorm() > kPixelChi2 * sigma_px * sigma_px)
    return false;
  return k.depth_m <= 0 || std::abs(1 / p.z() - 1 / k.depth_m) <=
                               depth_sigmas * model.noise.sigma_inverse_depth(1 / k.depth_m);
}

/// Matches map points to the frame's free keypoints near their projections. Returns how many were
/// found; `in_view`, if given, takes the points that should have been seen. O(points).
inline int match_projections(const CameraModel& model, const Map& map,
                             const std::vector<PointId>& candidates, double radius_px,
                             TrackedFrame& f, std::vector<PointId>* in_view = nullptr) {
  int matched = 0;
  std::vector<std::size_t> found;
  for (const PointId id : candidates) {
    const MapPoint* point = map.point(id);
    if (!point) continue;
    const auto projection = project(model, f.frame, *point, f.T_camera_world);
    if (!projection) continue;
    if (in_view) in_view->push_back(id);
    const double scale = std::pow(model.scale_factor, std::clamp(projection->octave, 0, 4));
    const auto k = match_at(f.frame, *projection, radius_px * scale, point->descriptor,
                            MatchLimits(), f.points, found);
    if (!k) continue;
    f.points[*k] = id;
    ++matched;
  }
  return matched;
}

/// The observation of a keypoint for the pose optimiser.
inline PoseObservation pose_observation(const CameraModel& model, const FrameKeypoint& k,
                                        std::size_t index, const Eigen::Vector3d& point) {
  PoseObservation o;
  o.point = point;
  o.pixel = k.pixel();
  o.inverse_depth = k.depth_m > 0 ? 1.0 / k.depth_m : 0;
  o.sigma_px = model.sigma_px(k);
  o.index = index;
  return o;
}

/// The observations of the frame's matches; forgets those of points that the map no longer has.
inline std::vector<PoseObservation> pose_observations(const CameraModel& model, const Map& map,
                                                      TrackedFrame& f) {
  std::vector<PoseObservation> observations;
  observations.reserve(f.points.size());
  for (std::size_t i = 0; i < f.points.size(); ++i)
    if (const MapPoint* point = map.point(f.points[i]))
      observations.push_back(pose_observation(model, f.frame.keypoints[i], i, point->position));
    else
      f.points[i] = PointId();
  return observations;
}

/// Whether several keyframes know a point. What only one has seen may be a person whom no mask
/// covered.
inline bool is_confirmed(const Map& map, PointId id) {
  const MapPoint* point = map.point(id);
  return point && point->observations.size() > 1;
}
inline int count_confirmed(const Map& map, const std::vector<PointId>& points) {
  return static_cast<int>(std::count_if(points.begin(), points.end(),
                                        [&](PointId id) { return is_confirmed(map, id); }));
}

/// Optimises the frame's pose on its matches and takes back those that do not fit. Returns the
/// number of the others. Where fewer of the confirmed points fit than would alone, the rest has
/// dragged the pose along: then the confirmed ones find it, and the rest counts where it fits.
inline int refine_pose(const CameraModel& model, const Map& map, TrackedFrame& f,
                       double start_gate = 0) {
  constexpr std::size_t kEnough = 60;     // confirmed points, to find a pose
  constexpr double kDraggedShare = 0.92;  // of those that fit alone; usually 0.97 or more
  std::vector<PoseObservation> all = pose_observations(model, map, f);
  if (all.size() < 6) return 0;
  const auto confirmed = [&](const PoseObservation& o) {
    return is_confirmed(map, f.points[o.index]);
  };
  std::vector<PoseObservation> alone;
  std::copy_if(all.begin(), all.end(), std::back_inserter(alone), confirmed);
  Eigen::Isometry3d T_alone = f.T_camera_world;
  int inliers = optimize_pose(model.camera, model.noise, all, f.T_camera_world, start_gate);
  if (alone.size() >= kEnough && alone.size() < all.size()) {
    const int fit_alone = optimize_pose(model.camera, model.noise, alone, T_alone, start_gate);
    const auto fit = std::count_if(
        all.begin(), all.end(), [&](const PoseObservation& o) { return o.inlier && confirmed(o); });
    if (fit_alone >= static_cast<int>(kEnough) &&
        static_cast<double>(fit) < kDraggedShare * fit_alone) {
      f.T_camera_world = T_alone;
      inliers = optimize_pose(model.camera, model.noise, all, f.T_camera_world, 1);
    }
  }
  for (const PoseObservation& o : all)
    if (!o.inlier) f.points[o.index] = PointId();
  return inliers;
}

/// Moves the matched keypoints to where the points' patches fit.
inline void align_matches(const CameraModel& model, const Map& map, const ImagePyramid& pyramid,
                          TrackedFrame& f) {
  for (std::size_t i = 0; i < f.points.size(); ++i) {
    const MapPoint* p = map.point(f.points[i]);
    if (!p) continue;
    FrameKeypoint& k = f.frame.keypoints[i];
    const auto place = align_patch(pyramid, model.camera, p->patch, f.T_camera_world, p->position,
                                   k.pixel(), k.octave);
    if (!place) continue;
    k.x = static_cast<float>(place->x()), k.y = static_cast<float>(place->y());
    k.refined = true;
  }
}

}  // namespace stillpoint::rgbd_slam
