// SPDX-License-Identifier: BSD-2-Clause
//
// A tracker of your own behind the seam. This one matches ORB keypoints with those of the last
// frame and solves PnP: enough to show where the selection goes in, too little to track well.
//
// Usage: 06_custom_tracker SEQUENCE    (with masks/ and camera.yaml)

#include <Eigen/Geometry>
#include <iostream>
#include <opencv2/calib3d.hpp>
#include <opencv2/features2d.hpp>
#include <stillpoint/backends/mask_files.hpp>
#include <stillpoint/core/distortion.hpp>
#include <stillpoint/evaluation/trajectory_error.hpp>
#include <stillpoint/front_end.hpp>
#include <stillpoint/io/run_sequence.hpp>
#include <stillpoint/io/tum_sequence.hpp>
#include <stillpoint/tracking/tracker.hpp>

class PnpOdometry : public stillpoint::Tracker {
 public:
  explicit PnpOdometry(const stillpoint::Camera& camera) : camera_(camera) {}

  const std::vector<cv::KeyPoint>& extract(const stillpoint::RgbdFrame& frame,
                                           const stillpoint::DynamicMask& mask) override {
    // Extracting outside the mask spends the feature budget on the static world.
    orb_->detectAndCompute(frame.color, mask.static_image(), keypoints_, descriptors_);
    return keypoints_;
  }

  std::optional<Eigen::Isometry3d> track(const stillpoint::RgbdFrame& frame,
                                         const stillpoint::DynamicMask&,
                                         const stillpoint::Selection& selection) override {
    std::vector<cv::DMatch> matches;
    if (!points_.empty() && !descriptors_.empty())
      cv::BFMatcher(cv::NORM_HAMMING, true).match(point_descriptors_, descriptors_, matches);
    std::vector<cv::Point3d> points;
    std::vector<cv::Point2d> pixels;
    for (const cv::DMatch& match : matches) {
      if (!selection.is_kept(static_cast<std::size_t>(match.trainIdx))) continue;
      points.push_back(points_[static_cast<std::size_t>(match.queryIdx)]);
      pixels.push_back(keypoints_[static_cast<std::size_t>(match.trainIdx)].pt);
    }
    cv::Mat rotation, translation, inliers;
    const bool first = trajectory_.empty();
    if (!first && (points.size() < 10 ||
                   !cv::solvePnPRansac(points, pixels, camera_.matrix(), camera_.distortion(),
                                       rotation, translation, false, 200, 3, 0.99, inliers) ||
                   inliers.rows < 10 || cv::norm(translation) > kMaxStep_m))
      return std::nullopt;
    if (!first) {
      const Eigen::Map<const Eigen::Vector3d> r(rotation.ptr<double>()),
          t(translation.ptr<double>());
      const Eigen::Isometry3d T_camera_last =
          Eigen::Translation3d(t) * Eigen::AngleAxisd(r.norm(), r.stableNormalized());
      T_world_camera_ = T_world_camera_ * T_camera_last.inverse();
    }
    remember(frame, selection);
    trajectory_.push_back({frame.timestamp, T_world_camera_});
    return T_world_camera_;
  }

  stillpoint::Trajectory trajectory() const override { return trajectory_; }

 private:
  static constexpr double kMaxStep_m = 0.5;  // no camera in a hand moves so far between frames

  // Keeps the selected keypoints that have depth, as points of this frame's camera.
  void remember(const stillpoint::RgbdFrame& frame, const stillpoint::Selection& selection) {
    points_.clear();
    point_descriptors_.release();
    for (const int i : selection.kept) {
      const cv::Point2f p = keypoints_[static_cast<std::size_t>(i)].pt;
      const double z = stillpoint::depth_m_at(frame, cvRound(p.x), cvRound(p.y));
      if (z <= 0) continue;
      const Eigen::Vector2d flat = stillpoint::undistort_pixel(camera_, {p.x, p.y});
      if (!flat.allFinite()) continue;
      const Eigen::Vector3d point = camera_.unproject(flat.x(), flat.y(), z);
      points_.emplace_back(point.x(), point.y(), point.z());
      point_descriptors_.push_back(descriptors_.row(i));
    }
  }

  stillpoint::Camera camera_;
  cv::Ptr<cv::ORB> orb_ = cv::ORB::create(1000);
  std::vector<cv::KeyPoint> keypoints_;
  std::vector<cv::Point3d> points_;  // of the last frame
  cv::Mat descriptors_, point_descriptors_;
  Eigen::Isometry3d T_world_camera_ = Eigen::Isometry3d::Identity();
  stillpoint::Trajectory trajectory_;
};

int main(int argc, char** argv) try {
  if (argc != 2) {
    std::cerr << "usage: " << argv[0] << " SEQUENCE\n";
    return 2;
  }
  const stillpoint::TumSequence sequence(argv[1]);
  const stillpoint::Camera camera = sequence.camera().value_or(stillpoint::Camera::tum_fr3());
  stillpoint::MaskFilesSegmenter segmenter(sequence.folder() / "masks",
                                           stillpoint::frame_names(sequence));
  stillpoint::FrontEnd front_end(stillpoint::FrontEndSettings(), camera, &segmenter);
  PnpOdometry tracker(camera);
  stillpoint::SequenceRun run;
  run.tracked = [](const stillpoint::TrackedFrame& t) {
    if (!t.T_world_camera) std::cout << "frame " << t.index << ": lost\n";
  };
  const stillpoint::Trajectory estimate =
      stillpoint::run_sequence(sequence, front_end, tracker, run);
  std::cout << estimate.size() << " of " << sequence.size() << " frames tracked";
  if (sequence.has_groundtruth() && estimate.size() >= 3)
    std::cout << ", ATE RMSE " << stillpoint::ate(sequence.groundtruth(), estimate).rmse_m << " m";
  std::cout << "\n";
} catch (const stillpoint::Error& error) {
  std::cerr << error.what() << "\n";
  return 1;
}
