// SPDX-License-Identifier: BSD-2-Clause
#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "stillpoint/backends/rgbd_slam/odometry.hpp"
#include "test_scene.hpp"

namespace {

using namespace stillpoint;
using namespace stillpoint::rgbd_slam;

TEST(Descriptor, CountsDifferingBits) {
  Descriptor a{}, b{};
  EXPECT_EQ(hamming_distance(a, b), 0);
  b = {~0ull, ~0ull, ~0ull, ~0ull};
  EXPECT_EQ(hamming_distance(a, b), 256);
  a = {1, 2, 4, 8}, b = {0, 2, 5, 0};
  EXPECT_EQ(hamming_distance(a, b), 3);
}

TEST(Descriptor, RefusesRowsOfAnotherLength) {
  EXPECT_THROW(descriptors_from_rows(cv::Mat::zeros(3, 16, CV_8UC1)), Error);
  EXPECT_TRUE(descriptors_from_rows(cv::Mat()).empty());
}

TEST(Spread, KeepsTheStrongestOfEvenCells) {
  std::vector<cv::KeyPoint> keypoints;
  // A dense clump on the left, single points on the right.
  for (int i = 0; i < 400; ++i)
    keypoints.emplace_back(static_cast<float>(i % 20), static_cast<float>(i / 20), 1.0f, -1.0f,
                           static_cast<float>(100 + i));
  for (int i = 0; i < 8; ++i)
    keypoints.emplace_back(200.0f + 50 * static_cast<float>(i % 4),
                           static_cast<float>(50 + 100 * (i / 4)), 1.0f, -1.0f, 1.0f);
  spread(keypoints, 20, cv::Size(400, 200));
  ASSERT_EQ(keypoints.size(), 20u);
  int right = 0;
  for (const cv::KeyPoint& k : keypoints) right += k.pt.x >= 200;
  EXPECT_EQ(right, 8);
  spread(keypoints, 0, cv::Size(400, 200));
  EXPECT_TRUE(keypoints.empty());
}

TEST(OrbExtractor, SpendsTheWholeBudgetOutsideTheMask) {
  const RgbdFrame frame = test_scene::render(Eigen::Isometry3d::Identity(), 0);
  OrbExtractor::Settings settings;
  settings.features = 400;
  OrbExtractor extractor(settings);
  Features all, masked, again;
  extractor.extract(frame.color, cv::Mat(), all);
  EXPECT_NEAR(static_cast<double>(all.keypoints.size()), 400, 8);
  EXPECT_EQ(all.keypoints.size(), all.descriptors.size());
  cv::Mat mask = cv::Mat::zeros(frame.color.size(), CV_8UC1);
  mask.colRange(0, 160) = 255;
  settings.most_masked = 1;
  OrbExtractor(settings).extract(frame.color, mask, masked);
  EXPECT_NEAR(static_cast<double>(masked.keypoints.size()), 400, 100);
  extractor.extract(frame.color, mask, masked);
  int octaves = 0;
  for (const cv::KeyPoint& k : masked.keypoints) {
    EXPECT_GT(k.pt.x, 160 + settings.mask_margin_px - 1);
    octaves = std::max(octaves, k.octave);
  }
  EXPECT_GE(octaves, 4);
  extractor.extract(frame.color, mask, again);
  EXPECT_EQ(again.descriptors, masked.descriptors);
  extractor.extract(frame.color, cv::Mat(frame.color.size(), CV_8UC1, cv::Scalar(255)), again);
  EXPECT_TRUE(again.keypoints.empty());
}

TEST(OrbExtractor, FindsMoreWhereAMaskLeavesLess) {
  const RgbdFrame frame = test_scene::render(Eigen::Isometry3d::Identity(), 0);
  OrbExtractor::Settings settings;
  settings.features = 100;
  Features found;
  const auto count_with = [&](int hidden_columns) {
    cv::Mat mask = cv::Mat::zeros(frame.color.size(), CV_8UC1);
    mask.colRange(0, hidden_columns) = 255;
    OrbExtractor(settings).extract(frame.color, mask, found);
    return static_cast<double>(found.keypoints.size());
  };
  const int width = frame.color.cols;
  EXPECT_NEAR(count_with(0), 100, 8);
  EXPECT_NEAR(count_with(width / 5), 100 / (0.8 * 0.8), 12);
  EXPECT_NEAR(count_with(width / 2), 300, 24) << "more than most_masked times as many";
  settings.most_masked = 1;
  EXPECT_NEAR(count_with(width / 2), 100, 8);
  settings.most_masked = 0.5;
  EXPECT_THROW(OrbExtractor{settings}, Error);
}

TEST(OrbExtractor, SurvivesTinyAndRefusesWrongPictures) {
  OrbExtractor extractor;
  Features features;
  extractor.extract(cv::Mat::zeros(20, 20, CV_8UC1), cv::Mat(), features);
  EXPECT_TRUE(features.keypoints.empty());
  EXPECT_THROW(extractor.extract(cv::Mat::zeros(48, 64, CV_8UC3), cv::Mat(), features), Error);
  EXPECT_THROW(
      extractor.extract(cv::Mat::zeros(48, 64, CV_8UC1), cv::Mat::zeros(4, 4, CV_8UC1), features),
      Error);
  OrbExtractor::Settings bad;
  bad.scale_factor = 1;
  EXPECT_THROW(OrbExtractor{bad}, Error);
}

std::vector<PoseObservation> observations_of(const Camera& camera, const Eigen::Isometry3d& T,
                                             int n) {
  std::vector<PoseObservation> observations;
  for (int i = 0; i < n; ++i) {
    const auto random = [&](int k) {
      return test_scene::mix(static_cast<std::uint32_t>(i * 3 + k)) / 4294967296.0;
    };
    const double z = 1 + 3 * random(2);
    const Eigen::Vector2d pixel(320 * random(0), 240 * random(1));
    PoseObservation o;
    o.pixel = pixel;
    o.inverse_depth = i % 3 ? 1 / z : 0;
    o.point = T.inverse() * camera.unproject(pixel.x(), pixel.y(), z);
    observations.push_back(o);
  }
  return observations;
}

Eigen::Isometry3d some_pose() {
  Eigen::Matrix<double, 6, 1> x;
  x << 0.3, -0.2, 0.5, 0.2, -0.3, 0.1;
  return se3_exp(x);
}

TEST(PoseOptimizer, FindsThePoseAndTheOutliers) {
  const Camera camera = test_scene::camera();
  const Eigen::Isometry3d truth = some_pose();
  auto observations = observations_of(camera, truth, 120);
  for (std::size_t i = 0; i < 24; ++i) observations[i].pixel.x() += 30 + static_cast<double>(i);
  Eigen::Matrix<double, 6, 1> off;
  off << 0.03, -0.02, 0.02, 0.02, 0.03, -0.02;
  Eigen::Isometry3d T = se3_exp(off) * truth;
  EXPECT_EQ(optimize_pose(camera, NoiseModel(), observations, T), 96);
  EXPECT_TRUE(T.isApprox(truth, 1e-6));
  for (std::size_t i = 0; i < 24; ++i) EXPECT_FALSE(observations[i].inlier);
}

TEST(PoseOptimizer, DropsADepthThatDisagreesButKeepsThePixel) {
  const Camera camera = test_scene::camera();
  const Eigen::Isometry3d truth = some_pose();
  auto observations = observations_of(camera, truth, 60);
  observations[1].inverse_depth += 0.02;
  Eigen::Isometry3d T = truth;
  optimize_pose(camera, NoiseModel(), observations, T);
  EXPECT_TRUE(T.isApprox(truth, 1e-4));
  EXPECT_TRUE(observations[1].inlier);
  EXPECT_FALSE(observations[1].depth_inlier);
}

TEST(PoseOptimizer, SaysHowBadlyAPoseFits) {
  const Camera camera = test_scene::camera();
  const Eigen::Isometry3d truth = some_pose();
  NoiseModel noise;
  noise.sensor.depth_floor_m = noise.sensor.depth_slope = 0;  // the same variance everywhere
  auto observations = observations_of(camera, truth, 60);
  EXPECT_NEAR(pose_misfit(camera, noise, observations, truth), 0, 1e-6);
  observations[0].pixel.x() += 2;  // two standard deviations, without a depth
  EXPECT_NEAR(pose_misfit(camera, noise, observations, truth), 4, 1e-6);
  observations[1].pixel.x() += 1000;
  EXPECT_NEAR(pose_misfit(camera, noise, observations, truth), 4 + kPixelChi2, 1e-6) << "no more";
  observations[2].inverse_depth += noise.sigma_inverse_depth(observations[2].inverse_depth);
  EXPECT_NEAR(pose_misfit(camera, noise, observations, truth), 5 + kPixelChi2, 1e-6);
  const Eigen::Isometry3d behind = Eigen::Translation3d(0, 0, -100) * truth;
  EXPECT_NEAR(pose_misfit(camera, noise, observations, behind), 60 * kPixelChi2, 1e-6);
}

// A third moves as one, a little: all agree on a pose between, but not well.
TEST(PoseOptimizer, FitsTheStaticWorldBetterThanACompromise) {
  const Camera camera = test_scene::camera();
  const Eigen::Isometry3d truth = some_pose();
  auto observations = observations_of(camera, truth, 90);
  for (PoseObservation& o : observations) o.inverse_depth = 0;
  for (std::size_t i = 0; i < 30; ++i) observations[i].pixel.x() += 3.2;
  Eigen::Isometry3d between = Eigen::AngleAxisd(1.1 / camera.fx, Eigen::Vector3d::UnitY()) * truth;
  EXPECT_GE(optimize_pose(camera, NoiseModel(), observations, between), 85);
  EXPECT_GT(pose_misfit(camera, NoiseModel(), observations, between),
            1.1 * pose_misfit(camera, NoiseModel(), observations, truth));
}

TEST(PnpRansac, FindsThePoseWithoutAGuess) {
  const Camera camera = test_scene::camera();
  const Eigen::Isometry3d truth = some_pose();
  auto observations = observations_of(camera, truth, 90);
  for (std::size_t i = 0; i < 45; ++i) observations[i].pixel = {7.0 * static_cast<double>(i), 90};
  const auto T = solve_pnp_ransac(camera, NoiseModel(), observations, 20);
  ASSERT_TRUE(T.has_value());
  EXPECT_TRUE(T->isApprox(truth, 1e-4));
  observations.resize(3);
  EXPECT_FALSE(solve_pnp_ransac(camera, NoiseModel(), observations, 20).has_value());
}

// A smooth pattern on a plane at 2 m before the first camera, as a camera at `T_world_camera` sees
// it.
cv::Mat smooth_plane(const Camera& camera, const Eigen::Isometry3d& T_world_camera) {
  cv::Mat gray(camera.height, camera.width, CV_8UC1);
  for (int y = 0; y < gray.rows; ++y)
    for (int x = 0; x < gray.cols; ++x) {
      const Eigen::Vector3d d = T_world_camera.linear() * camera.unproject(x, y, 1);
      const Eigen::Vector3d o = T_world_camera.translation();
      const Eigen::Vector3d p = o + d * ((2 - o.z()) / d.z());
      gray.at<uchar>(y, x) = static_cast<uchar>(128 + 40 * std::sin(90 * p.x() + 7 * p.y()) +
                                                40 * std::sin(80 * p.y() - 20 * p.x()));
    }
  return gray;
}

TEST(Patch, FindsItsPlaceToATenthOfAPixelWhateverTheTurnAndTheLight) {
  const Camera camera = test_scene::camera();
  const Eigen::Isometry3d first = Eigen::Isometry3d::Identity();
  Eigen::Isometry3d second = first;
  second.linear() = Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  second.translation() << 0.013, -0.008, 0.1;
  ImagePyramid a, b;
  a.build(smooth_plane(camera, first), 3, 1.2);
  b.build(smooth_plane(camera, second) + 15, 3, 1.2);
  for (int level = 0; level < 3; ++level)
    for (const Eigen::Vector2d& pixel :
         {Eigen::Vector2d(150, 110), Eigen::Vector2d(170.3, 140.6), Eigen::Vector2d(120, 130)}) {
      const Eigen::Vector3d point = camera.unproject(pixel.x(), pixel.y(), 2);
      const Patch patch = cut_patch(a, camera, pixel, level, first.linear(), 2);
      ASSERT_FALSE(patch.empty());
      const Eigen::Vector2d truth = camera.project(second.inverse() * point);
      const auto place = align_patch(b, camera, patch, second.inverse(), point,
                                     truth + Eigen::Vector2d(0.8, -0.7), level);
      ASSERT_TRUE(place.has_value()) << level << ' ' << pixel.transpose();
      EXPECT_LT((*place - truth).norm(), 0.1) << level << ' ' << pixel.transpose();
    }
}

TEST(Patch, RefusesOtherSurfacesAndRims) {
  const Camera camera = test_scene::camera();
  const RgbdFrame frame = test_scene::render(test_scene::path(0), 0);
  ImagePyramid pyramid, blank;
  pyramid.build(frame.color, 3, 1.2);
  blank.build(cv::Mat(240, 320, CV_8UC1, cv::Scalar(90)), 3, 1.2);
  const Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  const Eigen::Vector2d pixel(160, 120);
  const Patch patch = cut_patch(pyramid, camera, pixel, 0, T.linear(), 2);
  ASSERT_FALSE(patch.empty());
  const Eigen::Vector3d point = camera.unproject(160, 120, 2);
  EXPECT_FALSE(align_patch(blank, camera, patch, T, point, pixel, 0).has_value());
  EXPECT_FALSE(align_patch(pyramid, camera, patch, T, point, {3, 120}, 0).has_value());
  EXPECT_FALSE(align_patch(pyramid, camera, patch, T, -point, pixel, 0).has_value());
  EXPECT_FALSE(align_patch(pyramid, camera, Patch(), T, point, pixel, 0).has_value());
  EXPECT_TRUE(cut_patch(pyramid, camera, {3, 120}, 0, T.linear(), 2).empty());
  EXPECT_TRUE(cut_patch(pyramid, camera, pixel, 7, T.linear(), 2).empty());
}

RgbdOdometry::Settings small_settings() {
  RgbdOdometry::Settings settings;
  settings.features.features = 500;
  return settings;
}

std::optional<Eigen::Isometry3d> feed(Tracker& tracker, const RgbdFrame& frame,
                                      const DynamicMask& mask = {}) {
  const std::size_t n = tracker.extract(frame, mask).size();
  return tracker.track(frame, mask, test_scene::keep_all(n));
}

TEST(RgbdOdometry, FollowsACamera) {
  RgbdOdometry tracker(test_scene::camera(), small_settings());
  const Eigen::Isometry3d origin = test_scene::path(0).inverse();
  for (int step = 0; step < 40; ++step) {
    const Eigen::Isometry3d truth = origin * test_scene::path(3 * step);
    const auto T = feed(tracker, test_scene::render(test_scene::path(3 * step), step * 0.1));
    ASSERT_TRUE(T.has_value()) << step;
    EXPECT_LT((T->translation() - truth.translation()).norm(), 0.02) << step;
    EXPECT_LT(Eigen::AngleAxisd(T->linear().transpose() * truth.linear()).angle(), 0.01) << step;
  }
  EXPECT_EQ(tracker.trajectory().size(), 40u);
  ASSERT_TRUE(tracker.predicted_motion().has_value());
}

// No mask covers the mover yet.
TEST(RgbdOdometry, IsNotTakenAlongByWhatMovesBeforeTheFirstMask) {
  RgbdOdometry tracker(test_scene::camera(), small_settings());
  double worst = 0;
  for (int step = 0; step < 5; ++step) {
    const auto T = feed(tracker, test_scene::render_with_mover(step));
    ASSERT_TRUE(T.has_value()) << step;
    const Eigen::Isometry3d truth = test_scene::path(0).inverse() * test_scene::path(2 * step);
    worst = std::max(worst, (T->translation() - truth.translation()).norm());
  }
  EXPECT_LT(worst, 0.02);
}

TEST(RgbdOdometry, SaysThatItIsLostAndRecoversInTheSameFrameOfReference) {
  RgbdOdometry tracker(test_scene::camera(), small_settings());
  for (int step = 0; step < 10; ++step)
    ASSERT_TRUE(feed(tracker, test_scene::render(test_scene::path(3 * step), step * 0.1)));
  RgbdFrame black = test_scene::render(test_scene::path(0), 1.0);
  black.color.setTo(0);
  EXPECT_FALSE(feed(tracker, black).has_value());
  EXPECT_FALSE(tracker.predicted_motion().has_value());
  const Eigen::Isometry3d truth = test_scene::path(0).inverse() * test_scene::path(6);
  const auto T = feed(tracker, test_scene::render(test_scene::path(6), 1.1));
  ASSERT_TRUE(T.has_value());
  EXPECT_TRUE(tracker.stats().recovered);
  EXPECT_LT((T->translation() - truth.translation()).norm(), 0.02);
  EXPECT_EQ(tracker.trajectory().size(), 11u);
}

// A camera that stands still: only time makes keyframes.
TEST(RgbdOdometry, MakesKeyframesAfterTheSameTimeAtAnyRate) {
  for (const double rate_hz : {10.0, 30.0, 60.0, 90.0}) {
    RgbdOdometry tracker(test_scene::camera(), small_settings());
    RgbdFrame frame = test_scene::render(test_scene::path(0), 0);
    std::vector<double> keyframes;
    for (int step = 0; step <= 2 * rate_hz; ++step) {
      frame.timestamp = step / rate_hz;
      ASSERT_TRUE(feed(tracker, frame));
      if (tracker.stats().keyframe) keyframes.push_back(frame.timestamp);
    }
    // At 10 Hz two thirds of a second are over at 0.7 s.
    ASSERT_EQ(keyframes.size(), rate_hz < 30 ? 3u : 4u) << rate_hz;
    EXPECT_NEAR(keyframes[1], 0.68, 0.03) << rate_hz;
  }
}

TEST(RgbdOdometry, TracksWithoutDepthOnceStarted) {
  RgbdOdometry tracker(test_scene::camera(), small_settings());
  RgbdFrame blind = test_scene::render(test_scene::path(0), 0);
  blind.depth.setTo(0);
  EXPECT_FALSE(feed(tracker, blind).has_value());
  EXPECT_TRUE(feed(tracker, test_scene::render(test_scene::path(0), 0.1)).has_value());
  blind = test_scene::render(test_scene::path(3), 0.2);
  blind.depth.release();
  const auto T = feed(tracker, blind);
  ASSERT_TRUE(T.has_value());
  const Eigen::Isometry3d truth = test_scene::path(0).inverse() * test_scene::path(3);
  EXPECT_LT((T->translation() - truth.translation()).norm(), 0.02);
}

TEST(RgbdOdometry, IsDeterministic) {
  Trajectory first;
  for (int run = 0; run < 2; ++run) {
    RgbdOdometry tracker(test_scene::camera(), small_settings());
    for (int step = 0; step < 8; ++step)
      feed(tracker, test_scene::render(test_scene::path(5 * step), step * 0.1));
    if (run == 0) first = tracker.trajectory();
    ASSERT_EQ(tracker.trajectory().size(), first.size());
    for (std::size_t i = 0; i < first.size(); ++i)
      EXPECT_EQ(tracker.trajectory()[i].T_world_camera.matrix(), first[i].T_world_camera.matrix());
  }
}

TEST(RgbdOdometry, RefusesNumbersThatAreNotFinite) {
  test_scene::expect_only_finite_numbers(
      [](const Camera& camera, std::unique_ptr<FeatureExtractor> extractor) {
        return std::make_unique<RgbdOdometry>(camera, small_settings(), std::move(extractor));
      });
}

// A grey image must not become the memory that the next color image is converted into.
TEST(RgbdOdometry, NeverWritesIntoTheCallersImage) {
  RgbdOdometry tracker(test_scene::camera(), small_settings());
  test_scene::expect_images_untouched(tracker);
}

TEST(RgbdOdometry, RefusesASelectionOfOtherKeypoints) {
  RgbdOdometry tracker(test_scene::camera(), small_settings());
  const RgbdFrame frame = test_scene::render(test_scene::path(0), 0);
  tracker.extract(frame, DynamicMask());
  EXPECT_THROW(tracker.track(frame, DynamicMask(), test_scene::keep_all(3)), Error);
  EXPECT_THROW(RgbdOdometry{Camera()}, Error);
}

}  // namespace
