// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "stillpoint/backends/rgbd_slam/pose_optimizer.hpp"
#include "stillpoint/core/camera.hpp"

namespace stillpoint::rgbd_slam {

/// Finds T_camera_world from observations of which many may be wrong (EPnP in RANSAC, then
/// optimize_pose). Sets `inlier` of each; no value below `min_inliers`. Deterministic: OpenCV's
/// RANSAC starts from a fixed seed.
inline std::optional<Eigen::Isometry3d> solve_pnp_ransac(const Camera& camera,
                                                         const NoiseModel& noise,
                                                         std::vector<PoseObservation>& observations,
                                                         int min_inliers, int iterations = 300,
                                                         double error_px = 4) {
  if (static_cast<int>(observations.size()) < std::max(min_inliers, 5)) return std::nullopt;
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> pixels;
  for (const PoseObservation& o : observations) {
    points.emplace_back(o.point.x(), o.point.y(), o.point.z());
    pixels.emplace_back(o.pixel.x(), o.pixel.y());
  }
  cv::Vec3d rvec, tvec;
  std::vector<int> inliers;
  try {
    if (!cv::solvePnPRansac(points, pixels, camera.matrix(), cv::noArray(), rvec, tvec, false,
                            iterations, static_cast<float>(error_px), 0.999, inliers,
                            cv::SOLVEPNP_EPNP))
      return std::nullopt;
  } catch (const cv::Exception&) {
    return std::nullopt;  // degenerate points: no pose
  }
  if (static_cast<int>(inliers.size()) < min_inliers) return std::nullopt;
  const Eigen::Vector3d rotation(rvec.val), translation(tvec.val);
  Eigen::Isometry3d T = Eigen::Translation3d(translation) *
                        Eigen::AngleAxisd(rotation.norm(), rotation.stableNormalized());
  if (!T.matrix().allFinite()) return std::nullopt;
  std::vector<PoseObservation> good;
  for (const int i : inliers) good.push_back(observations[static_cast<std::size_t>(i)]);
  if (optimize_pose(camera, noise, good, T) < min_inliers) return std::nullopt;
  // Again over all of them: RANSAC's narrow threshold leaves out good points of coarse levels.
  if (optimize_pose(camera, noise, observations, T, 9) < min_inliers) return std::nullopt;
  return T;
}

}  // namespace stillpoint::rgbd_slam
