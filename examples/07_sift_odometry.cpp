// SPDX-License-Identifier: BSD-2-Clause
//
// A SLAM system of your own, with keypoints that are not ORB: SIFT (floats), matched with those of
// the last frame, and PnP. Nothing of the library is derived from; the front end is asked twice.
//
// Usage: 07_sift_odometry SEQUENCE    (with masks/ and camera.yaml)

#include <Eigen/Geometry>
#include <iostream>
#include <opencv2/calib3d.hpp>
#include <opencv2/features2d.hpp>
#include <stillpoint/backends/mask_files.hpp>
#include <stillpoint/core/distortion.hpp>
#include <stillpoint/evaluation/trajectory_error.hpp>
#include <stillpoint/front_end.hpp>
#include <stillpoint/io/tum_sequence.hpp>
#include <stillpoint/keypoints/feature_budget.hpp>
#include <stillpoint/motion/constant_velocity.hpp>

struct Odometry {
  stillpoint::Camera camera;
  std::vector<cv::Point3d> points;  // of the last tracked frame, in its camera
  cv::Mat point_descriptors;
  Eigen::Isometry3d T_world_camera = Eigen::Isometry3d::Identity();

  // Tracks one frame on keypoints that are static; false: lost.
  bool track(const stillpoint::RgbdFrame& frame, const std::vector<cv::KeyPoint>& keypoints,
             const cv::Mat& descriptors) {
    if (keypoints.size() < 10) return false;
    if (!points.empty()) {
      std::vector<std::vector<cv::DMatch>> pairs;
      cv::BFMatcher(cv::NORM_L2).knnMatch(descriptors, point_descriptors, pairs, 2);
      std::vector<cv::Point3d> matched;
      std::vector<cv::Point2d> pixels;
      for (const auto& p : pairs)
        if (p.size() == 2 && p[0].distance < 0.8f * p[1].distance) {
          matched.push_back(points[static_cast<std::size_t>(p[0].trainIdx)]);
          pixels.push_back(keypoints[static_cast<std::size_t>(p[0].queryIdx)].pt);
        }
      cv::Vec3d r, t;
      if (matched.size() < 10 || !cv::solvePnPRansac(matched, pixels, camera.matrix(),
                                                     camera.distortion(), r, t, false, 300, 2))
        return false;
      const Eigen::Vector3d turn(r[0], r[1], r[2]);
      const Eigen::Isometry3d T_current_last =
          Eigen::Translation3d(t[0], t[1], t[2]) *
          Eigen::AngleAxisd(turn.norm(), turn.stableNormalized());
      T_world_camera = T_world_camera * T_current_last.inverse();
    }
    points.clear();
    point_descriptors.release();
    for (std::size_t i = 0; i < keypoints.size(); ++i) {
      const cv::Point2f p = keypoints[i].pt;
      const double z = stillpoint::depth_m_at(frame, cvRound(p.x), cvRound(p.y));
      if (z <= 0) continue;
      const Eigen::Vector2d flat = stillpoint::undistort_pixel(camera, {p.x, p.y});
      if (!flat.allFinite()) continue;
      const Eigen::Vector3d point = camera.unproject(flat.x(), flat.y(), z);
      points.emplace_back(point.x(), point.y(), point.z());
      point_descriptors.push_back(descriptors.row(static_cast<int>(i)));
    }
    return true;
  }
};

int main(int argc, char** argv) try {
  if (argc != 2) {
    std::cerr << "usage: " << argv[0] << " SEQUENCE\n";
    return 2;
  }
  const stillpoint::TumSequence sequence(argv[1]);
  Odometry odometry;
  odometry.camera = sequence.camera().value_or(stillpoint::Camera::tum_fr3());
  stillpoint::MaskFilesSegmenter segmenter(sequence.folder() / "masks",
                                           stillpoint::frame_names(sequence));
  stillpoint::FrontEnd front_end({}, odometry.camera, &segmenter);
  stillpoint::ConstantVelocity velocity;  // this odometry predicts nothing itself
  stillpoint::FeatureBudget budget;       // and it can choose how many keypoints to extract
  stillpoint::Trajectory trajectory;
  double last_s = 0;
  for (std::size_t i = 0; i < sequence.size(); ++i) {
    const stillpoint::RgbdFrame frame = sequence.load(i);
    front_end.compute_mask(frame, velocity.predict(last_s, frame.timestamp));
    last_s = frame.timestamp;

    std::vector<cv::KeyPoint> keypoints;
    cv::Mat descriptors, kept_descriptors;
    cv::SIFT::create(budget.features_for(400, 2000))
        ->detectAndCompute(frame.color, cv::noArray(), keypoints, descriptors);
    const stillpoint::Selection& selection = front_end.select(keypoints);
    budget.add(front_end.stats().keypoints, front_end.stats().kept, frame.timestamp);
    for (const int k : selection.kept) kept_descriptors.push_back(descriptors.row(k));
    stillpoint::compact(keypoints, selection);

    if (odometry.track(frame, keypoints, kept_descriptors)) {
      velocity.add(frame.timestamp, odometry.T_world_camera);
      front_end.correct_pose(odometry.T_world_camera);
      trajectory.push_back({frame.timestamp, odometry.T_world_camera});
    } else {
      velocity.reset();
    }
  }
  std::cout << trajectory.size() << " of " << sequence.size() << " frames tracked";
  if (sequence.has_groundtruth() && trajectory.size() >= 3)
    std::cout << ", ATE RMSE " << stillpoint::ate(sequence.groundtruth(), trajectory).rmse_m
              << " m";
  std::cout << "\n";
} catch (const stillpoint::Error& error) {
  std::cerr << error.what() << "\n";
  return 1;
}
