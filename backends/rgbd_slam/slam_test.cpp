// SPDX-License-Identifier: BSD-2-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <opencv2/imgproc.hpp>
#include <string>
#include <thread>
#include <vector>

#include "../../tests/io/temporary_folder.hpp"
#include "slam_fixture.hpp"
#include "stillpoint/core/random.hpp"
#include "stillpoint/evaluation/trajectory_error.hpp"

namespace {

using namespace stillpoint;
using namespace stillpoint::rgbd_slam;
using namespace test_scene;

TEST(SlamSystem, FollowsACamera) {
  SlamSystem slam(camera(), small_settings());
  walk(slam, 60);
  ASSERT_EQ(slam.trajectory().size(), 60u);
  EXPECT_LT(worst_error(slam.trajectory()), 0.03);
  EXPECT_GE(slam.keyframes(), 3u);
  const std::vector<Eigen::Vector3d> points = slam.map_point_positions();
  EXPECT_EQ(points.size(), slam.map_points());
  EXPECT_TRUE(
      std::all_of(points.begin(), points.end(), [](const auto& p) { return p.allFinite(); }));
  EXPECT_LE(slam.keyframe_trajectory().size(), 40u);
}

TEST(SlamSystem, AsOdometryNeverLooksBack) {
  SlamSystem slam(camera(), small_settings(SlamSystem::Settings::odometry()));
  const Trajectory tracked = walk(slam, 40);
  slam.finish();
  EXPECT_LT(worst_error(tracked), 0.02);
  EXPECT_GE(slam.keyframes(), 3u);
  expect_same(slam.trajectory(), tracked);
}

// What was seen later makes earlier poses better, too.
TEST(SlamSystem, IsMoreExactOnceItIsFinished) {
  SlamSystem slam(camera(), small_settings());
  cv::RNG noise(1);
  for (int step = 0; step < 60; ++step) {
    RgbdFrame frame = render(path(2 * step), step / 15.0);
    cv::Mat added(frame.color.size(), CV_16SC1), noisy;
    noise.fill(added, cv::RNG::NORMAL, 0, 8);
    cv::add(frame.color, added, noisy, cv::noArray(), CV_8U);
    frame.color = noisy;
    ASSERT_TRUE(feed(slam, frame)) << step;
  }
  Trajectory truth;
  for (const StampedPose& p : slam.trajectory())
    truth.push_back({p.timestamp, path_at(p.timestamp)});
  const double before = ate(truth, slam.trajectory()).rmse_m;
  slam.finish();
  const Trajectory finished = slam.trajectory();
  const double after = ate(truth, finished).rmse_m;
  EXPECT_LT(after, before);
  slam.finish();
  EXPECT_EQ(slam.trajectory().back().T_world_camera.matrix(),
            finished.back().T_world_camera.matrix());
}

// Rotates by jerks to either side: nothing is where the last motion predicts it.
TEST(SlamSystem, FollowsACameraThatRotatesByJerks) {
  RandomGenerator random(3);
  SlamSystem slam(camera(), small_settings());
  Trajectory truth, tracked;
  double turn = 0;
  int fewest = 1000;
  for (int step = 0; step < 60; ++step) {
    Eigen::Isometry3d T = path(step);
    T.rotate(Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitY()));
    turn = std::clamp(turn + 0.4 * (random.uniform() - 0.5), -0.6, 0.6);
    const RgbdFrame frame = render(T, step / 15.0);
    truth.push_back({frame.timestamp, T});
    const auto pose = feed(slam, frame);
    ASSERT_TRUE(pose) << step;
    tracked.push_back({frame.timestamp, *pose});
    EXPECT_FALSE(slam.stats().recovered) << step;
    fewest = std::min(fewest, step > 0 ? slam.stats().inliers : 1000);
  }
  EXPECT_LT(ate(truth, tracked).max_m, 0.03);
  EXPECT_GT(fewest, 60);
}

TEST(SlamSystem, ClosesALoop) {
  // A camera that believes in a focal length 1.5 % too long walks once around the room and a little
  // further: each turn is measured too small.
  Camera wrong = camera();
  wrong.fx *= 1.015, wrong.fy *= 1.015;
  constexpr int kFrames = 104;
  const auto around = [](double t) {
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.linear() = Eigen::AngleAxisd(t * 4 * std::acos(-1.0) / 180, Eigen::Vector3d::UnitY())
                     .toRotationMatrix();
    T.translation() = T.linear() * Eigen::Vector3d(0, 0, 1);
    return T;
  };
  enum { kOff, kOn, kThreaded };
  double drift[3] = {0, 0, 0};
  int loops[3] = {0, 0, 0};
  std::vector<RgbdFrame> frames;
  for (int step = 0; step < kFrames; ++step) frames.push_back(render(around(step), step / 30.0));
  for (const int mode : {kOff, kOn, kThreaded}) {
    SlamSystem::Settings settings = small_settings();
    settings.loops.enabled = mode != kOff;
    settings.threaded = mode == kThreaded;
    SlamSystem slam(wrong, settings);
    for (const RgbdFrame& frame : frames) ASSERT_TRUE(feed(slam, frame)) << frame.timestamp;
    slam.finish();
    const Trajectory trajectory = slam.trajectory();
    ASSERT_EQ(trajectory.size(), frames.size());
    // The end against the place that was seen one turn before.
    const Eigen::Isometry3d moved = trajectory[kFrames - 1 - 90].T_world_camera.inverse() *
                                    trajectory[kFrames - 1].T_world_camera;
    drift[mode] = moved.translation().norm();
    loops[mode] = slam.loops_closed();
  }
  EXPECT_EQ(loops[kOff], 0);
  EXPECT_GE(loops[kOn], 1);
  EXPECT_GT(drift[kOff], 0.015) << "nothing to close";
  EXPECT_LT(drift[kOn], drift[kOff] / 25) << "3 mm without adjusting all keyframes";
  // How many keyframes there are in threads depends on the machine, and so does when it closes.
  EXPECT_LT(drift[kThreaded], 0.1);
}

// When a camera that stands still makes keyframes.
std::vector<double> keyframe_times(double rate_hz, const std::function<double(int)>& timestamp) {
  SlamSystem slam(camera(), small_settings(SlamSystem::Settings::odometry()));
  RgbdFrame frame = render(path(0), 0);
  std::vector<double> times;
  for (int step = 0; step <= 1.1 * rate_hz; ++step) {
    frame.timestamp = timestamp(step);
    EXPECT_TRUE(feed(slam, frame)) << step;
    if (slam.stats().keyframe) times.push_back(step / rate_hz);
  }
  return times;
}

TEST(SlamSystem, WaitsForSecondsNotForFrames) {
  for (const double rate_hz : {10.0, 30.0, 90.0}) {
    const auto times = keyframe_times(rate_hz, [&](int step) { return 1e9 + step / rate_hz; });
    ASSERT_EQ(times.size(), 3u) << rate_hz;
    for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(times[i], 0.5 * static_cast<double>(i), 1e-6);
  }
  const auto times = keyframe_times(30, [](int) { return 0; });
  ASSERT_EQ(times.size(), 3u) << "a host without timestamps counts as one at 30 Hz";
  EXPECT_NEAR(times[2], 1, 1e-6);
}

TEST(SlamSystem, ThreadsGiveTheSameWithinNoise) {
  SlamSystem slam(camera(), threaded_settings());
  walk(slam, 40);
  slam.finish();
  EXPECT_LT(worst_error(slam.trajectory()), 0.03);
}

// Else who comes back at once would keep it from whoever waits.
TEST(FairMutex, GoesToWhoeverWaitedLongest) {
  FairMutex mutex;
  std::vector<int> order;
  std::vector<std::thread> others;
  std::unique_lock<FairMutex> mine(mutex);
  for (int i = 0; i < 3; ++i) {
    others.emplace_back([&, i] {
      const std::lock_guard<FairMutex> guard(mutex);
      order.push_back(i);
    });
    std::this_thread::sleep_for(std::chrono::milliseconds(50));  // until it waits
  }
  mine.unlock();
  mine.lock();
  order.push_back(3);
  mine.unlock();
  for (std::thread& t : others) t.join();
  EXPECT_EQ(order, (std::vector<int>{0, 1, 2, 3}));
}

TEST(SlamSystem, IsDeterministic) {
  Trajectory trajectories[2];
  for (Trajectory& trajectory : trajectories) {
    SlamSystem slam(camera(), small_settings());
    walk(slam, 20, 5);
    slam.finish();
    trajectory = slam.trajectory();
  }
  expect_same(trajectories[0], trajectories[1]);
}

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinite = std::numeric_limits<double>::infinity();

// Passes on what ORB finds, with one keypoint at NaN when told so.
class SpoiledExtractor final : public FeatureExtractor {
 public:
  explicit SpoiledExtractor(const bool& spoiled) : spoiled_(spoiled) {}
  void extract(const cv::Mat& gray, const cv::Mat& mask, Features& features) override {
    orb_.extract(gray, mask, features);
    if (spoiled_) features.keypoints.at(7).pt.y = std::numeric_limits<float>::quiet_NaN();
  }
  int levels() const override { return orb_.levels(); }
  double scale_factor() const override { return orb_.scale_factor(); }

 private:
  const bool& spoiled_;
  OrbExtractor orb_;
};

// What a caller gets wrong is refused; `spoiled` is the extractor's. The frame itself is right.
void expect_errors(SlamSystem& slam, const RgbdFrame& frame, bool& spoiled) {
  const std::size_t n = slam.extract(frame, {}).size();
  for (const double bad : {kNan, kInfinite}) {
    RgbdFrame other = frame;
    other.timestamp = bad;
    EXPECT_ERROR(slam.track(other, {}, keep_all(n)), "frame.timestamp", "expected seconds");
  }
  EXPECT_ERROR(slam.track(frame, {}, keep_all(3)), "expected a selection", "found 3");
  Selection wrong = keep_all(n);
  wrong.kept.back() = static_cast<int>(n);
  const std::string found = "found " + std::to_string(n);
  EXPECT_ERROR(slam.track(frame, {}, wrong), "selection.kept", found.c_str());
  RgbdFrame small = frame;
  small.color = frame.color(cv::Rect(0, 0, 64, 48)), small.depth.release();
  EXPECT_ERROR(slam.track(small, {}, keep_all(n)), "320x240", "found 64x48");
  spoiled = true;
  EXPECT_ERROR(slam.extract(frame, {}), "extract", "finite pixels", "number 7", "nan");
  spoiled = false;
}

// And the tracker goes on as if nothing had been.
TEST(SlamSystem, RefusesWhatACallerGetsWrong) {
  bool spoiled = false;
  Trajectory trajectories[2];
  for (const bool disturbed : {false, true}) {
    SlamSystem slam(camera(), small_settings(), std::make_unique<SpoiledExtractor>(spoiled));
    for (int step = 0; step < 8; ++step) {
      const RgbdFrame frame = render(path(step), step / 30.0);
      if (disturbed) expect_errors(slam, frame, spoiled);
      EXPECT_TRUE(feed(slam, frame)) << step;
    }
    slam.finish();
    trajectories[disturbed] = slam.trajectory();
  }
  ASSERT_EQ(trajectories[0].size(), 8u);
  expect_same(trajectories[0], trajectories[1]);
  EXPECT_ERROR(SlamSystem{Camera()}, "expected a camera with focal lengths");
  Camera bad = camera();
  bad.cx = kNan;
  EXPECT_ERROR(SlamSystem{bad}, "camera: expected finite numbers, found nan");
  bad = camera();
  bad.fx = kInfinite;
  EXPECT_ERROR(SlamSystem{bad}, "camera: expected finite numbers, found inf");
}

// Grey frames and color ones in turn: a grey image must not become the memory that the next color
// image is converted into.
TEST(SlamSystem, NeverWritesIntoTheCallersImage) {
  for (const auto& settings : {small_settings(), threaded_settings()}) {
    SlamSystem slam(camera(), settings);
    std::vector<RgbdFrame> frames;
    std::vector<cv::Mat> colors, depths;
    for (int step = 0; step < 6; ++step) {
      RgbdFrame frame = render(path(step), step / 30.0);
      if (step % 2) cv::cvtColor(frame.color, frame.color, cv::COLOR_GRAY2BGR);
      frames.push_back(frame);
      colors.push_back(frame.color.clone()), depths.push_back(frame.depth.clone());
      EXPECT_TRUE(feed(slam, frame)) << step;
    }
    slam.finish();
    for (std::size_t i = 0; i < frames.size(); ++i) {
      EXPECT_EQ(cv::norm(frames[i].color, colors[i], cv::NORM_INF), 0) << i;
      EXPECT_EQ(cv::norm(frames[i].depth, depths[i], cv::NORM_INF), 0) << i;
    }
  }
}

TEST(SlamSystem, RefusesANoiseThatNoSensorHas) {
  for (const double sigma : {0.0, -1.0, std::nan("")})
    for (double NoiseModel::*member : {&NoiseModel::sigma_px, &NoiseModel::sigma_refined_px}) {
      SlamSystem::Settings settings;
      settings.noise.*member = sigma;
      EXPECT_THROW(SlamSystem(camera(), settings), Error);
    }
  SlamSystem::Settings settings;
  settings.noise.sensor.depth_square = -1;
  EXPECT_THROW(SlamSystem(camera(), settings), Error);
}

}  // namespace
