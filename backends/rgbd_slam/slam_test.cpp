// SPDX-License-Identifier: BSD-2-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "failing_memory.hpp"
#include "stillpoint/backends/rgbd_slam/fair_mutex.hpp"
#include "stillpoint/backends/rgbd_slam/slam_system.hpp"
#include "stillpoint/backends/rgbd_slam/worker.hpp"
#include "stillpoint/core/random.hpp"
#include "stillpoint/evaluation/trajectory_error.hpp"
#include "test_scene.hpp"

namespace {

using namespace stillpoint;
using namespace stillpoint::rgbd_slam;

SlamSystem::Settings small_settings() {
  SlamSystem::Settings settings;
  settings.features.features = 500;
  return settings;
}

std::optional<Eigen::Isometry3d> feed(Tracker& tracker, const RgbdFrame& frame) {
  const std::size_t n = tracker.extract(frame, DynamicMask()).size();
  return tracker.track(frame, DynamicMask(), test_scene::keep_all(n));
}

// Largest distance between the trajectory and the path it was rendered from, metres.
double worst_error(const Trajectory& trajectory,
                   const std::function<Eigen::Isometry3d(double)>& truth) {
  const Eigen::Isometry3d origin =
      trajectory.front().T_world_camera * truth(trajectory.front().timestamp).inverse();
  double worst = 0;
  for (const StampedPose& p : trajectory)
    worst = std::max(
        worst,
        (p.T_world_camera.translation() - (origin * truth(p.timestamp)).translation()).norm());
  return worst;
}

Eigen::Isometry3d sway(double t) { return test_scene::path(static_cast<int>(std::lround(t * 30))); }

// When what is due after some time happens, for a camera that stands still and then sees nothing.
struct Times {
  std::vector<double> keyframes;
  double settled_s = 0, restart_s = 0;  // the age of what is settled last; lost so long
};

Times times_at(double rate_hz, bool with_timestamps = true) {
  static const RgbdFrame still = test_scene::render(test_scene::path(0), 0);
  OrbExtractor extractor;
  Features features;
  extractor.extract(still.color, cv::Mat(), features);
  const std::vector<int> all = test_scene::keep_all(features.keypoints.size()).kept;
  ImagePyramid pyramid;
  pyramid.build(still.color, extractor.levels(), extractor.scale_factor());
  MapTracking::Settings settings;
  settings.restart_keyframes = 100;  // the map counts as young
  MapTracking tracking(
      {test_scene::camera(), NoiseModel(), extractor.levels(), extractor.scale_factor()}, settings);
  Map map;
  FairMutex lock;
  PlaceIndex index;
  Times times;
  const auto track = [&](int step, const std::vector<int>& kept) {
    RgbdFrame frame = still;
    frame.timestamp = with_timestamps ? 1e9 + step / rate_hz : 0;
    return tracking.track(map, index,
                          KeypointFrame(frame, test_scene::camera(), features, kept,
                                        extractor.scale_factor(), KeypointFrame::Settings()),
                          pyramid, false);
  };
  int step = 0;
  for (; step <= 4 * rate_hz; ++step) {
    EXPECT_TRUE(track(step, all)) << step;
    if (tracking.new_keyframe() != kNone) times.keyframes.push_back(step / rate_hz);
    tracking.settle(map, lock);
  }
  times.settled_s = (step - static_cast<int>(tracking.settled())) / rate_hz;
  const int lost = step;
  while (!tracking.stats().restart_due && step < lost + 20 * rate_hz) track(step++, {});
  times.restart_s = (step - 1 - lost) / rate_hz;
  return times;
}

Eigen::Isometry3d path_at_10_hz(double t) {
  return test_scene::path(2 * static_cast<int>(std::lround(t * 10)));
}

KeypointFrame frame_of(std::size_t n, std::uint64_t seed) {
  KeypointFrame f;
  for (std::size_t i = 0; i < n; ++i) {
    FrameKeypoint k;
    k.depth_m = 2;
    f.keypoints.push_back(k);
    f.descriptors.push_back({seed, i, 0, 0});
  }
  return f;
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

TEST(Worker, HandsOnWhatItsWorkThrowsOnceAndGoesOn) {
  std::vector<int> done;
  Worker worker([&](int item) {
    if (item == 2) throw Error("two");
    if (item == 3) throw std::runtime_error("only follows from the first");
    if (item == 6) throw 6;
    done.push_back(item);
  });
  EXPECT_NO_THROW(worker.rethrow());
  for (int i = 1; i <= 4; ++i) worker.push(i);
  worker.drain();
  try {
    worker.rethrow();
    ADD_FAILURE() << "nothing was thrown";
  } catch (const Error& e) {
    EXPECT_STREQ(e.what(), "stillpoint: two");
  }
  EXPECT_NO_THROW(worker.rethrow()) << "once";
  worker.push(5);
  worker.drain();
  EXPECT_NO_THROW(worker.rethrow());
  EXPECT_EQ(done, (std::vector<int>{1, 4, 5}));
  worker.push(6);  // and nobody asks: no harm when it ends
  worker.drain();
}

TEST(Map, KeepsObservationsOfBothSidesTogether) {
  Map map;
  Keyframe& a = map.add_keyframe(frame_of(30, 1), Eigen::Isometry3d::Identity());
  Keyframe& b = map.add_keyframe(frame_of(30, 2), Eigen::Isometry3d::Identity());
  for (int i = 0; i < 20; ++i) map.observe(map.add_point({0, 0, 2.0 + i}, a, i), b, 29 - i);
  map.update_connections(b.id);
  EXPECT_EQ(a.covisible.at(b.id), 20);
  EXPECT_EQ(b.parent, a.id);
  EXPECT_EQ(map.neighbors(a.id), std::vector<KeyframeId>{b.id});

  MapPoint& twin = map.add_point({0, 0, 2}, b, 0);
  const PointId twin_id = twin.id;
  map.replace_point(twin_id, 5);
  EXPECT_EQ(map.point(twin_id), nullptr);
  EXPECT_EQ(map.resolve(twin_id), 5);
  EXPECT_EQ(b.points[0], kNone);  // point 5 is seen by b at another keypoint

  map.forget(3, a.id);
  EXPECT_EQ(a.points[3], kNone);
  ASSERT_NE(map.point(3), nullptr);
  EXPECT_EQ(map.point(3)->reference, b.id);
  map.forget(3, b.id);
  EXPECT_EQ(map.point(3), nullptr);
  EXPECT_EQ(map.point_count(), 19u);
}

TEST(Map, KeepsThePoseOfACulledKeyframeRelativeToItsParent) {
  Map map;
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  for (int i = 0; i < 3; ++i) {
    T.translation().x() = i;
    map.add_keyframe(frame_of(5, 1), T);
    map.update_connections(i);
  }
  map.cull_keyframe(0);
  EXPECT_NE(map.keyframe(0), nullptr);  // the origin stays
  map.cull_keyframe(1);
  EXPECT_EQ(map.keyframe(1), nullptr);
  EXPECT_EQ(map.keyframe(2)->parent, 0);
  EXPECT_NEAR(map.pose_of(1).translation().x(), 1, 1e-12);
  Eigen::Isometry3d moved = Eigen::Isometry3d::Identity();
  moved.translation().y() = 7;
  move_map(map, {{0, moved}});
  EXPECT_NEAR(map.pose_of(1).translation().y(), 7, 1e-12);
  EXPECT_NEAR(map.pose_of(2).translation().y(), 7, 1e-12);
}

// A camera 10 cm beside the only keyframe, which sees 40 points; `frame` sees them without error,
// but was tracked 1 cm off.
struct Recorded {
  Map map;
  TrackedFrame frame;
  Optics optics;
  Eigen::Isometry3d truth = Eigen::Isometry3d::Identity();

  explicit Recorded(double timestamp = 1) {
    optics.camera = test_scene::camera();
    truth.translation().x() = -0.1;
    frame = TrackedFrame(frame_of(40, 2));
    frame.frame.timestamp = timestamp;
    Keyframe& k = map.add_keyframe(frame_of(40, 1), Eigen::Isometry3d::Identity());
    k.frame.timestamp = 0.5;
    for (int i = 0; i < 40; ++i) {
      const Eigen::Vector3d place(0.3 * (i % 8) - 1, 0.4 * (i / 8) - 0.8, 2 + 0.1 * (i % 5));
      frame.points[static_cast<std::size_t>(i)] = map.add_point(place, k, i).id;
      const Eigen::Vector3d p = truth * place;
      FrameKeypoint& seen = frame.frame.keypoints[static_cast<std::size_t>(i)];
      const Eigen::Vector2d pixel = optics.camera.project(p);
      seen.x = static_cast<float>(pixel.x()), seen.y = static_cast<float>(pixel.y());
      seen.depth_m = static_cast<float>(p.z());
    }
    frame.T_camera_world = truth;
    frame.T_camera_world.translation().y() += 0.01;
  }
  double error_m(const FrameRecord& record) const {
    return (record.pose(map).translation() - truth.translation()).norm();
  }
};

TEST(MapTracking, WaitsForSecondsNotForFrames) {
  for (const double rate_hz : {10.0, 30.0, 60.0, 90.0}) {
    SCOPED_TRACE(rate_hz);
    const Times times = times_at(rate_hz);
    ASSERT_EQ(times.keyframes.size(), 9u);
    for (std::size_t i = 0; i < 9; ++i) EXPECT_NEAR(times.keyframes[i], 0.5 * i, 1e-6);
    EXPECT_NEAR(times.settled_s, 3, 1e-6);
    EXPECT_NEAR(times.restart_s, 1, 1e-6);
  }
}

// A host that has none.
TEST(MapTracking, TakesFramesWithoutTimestampsForThoseOfACameraAt30Hz) {
  const Times times = times_at(30, false);
  ASSERT_EQ(times.keyframes.size(), 9u);
  EXPECT_NEAR(times.keyframes.back(), 4, 1e-6);
  EXPECT_NEAR(times.restart_s, 1, 1e-6);
}

TEST(FrameRecord, SettlesOnWhereItsPointsAreKnownToBe) {
  Recorded r;
  r.map.replace_point(3, 4);  // a point seen twice is one point now
  FrameRecord record(r.map, 0, r.frame);
  record.settle(r.optics, r.map);
  EXPECT_LT(r.error_m(record), 1e-4);
  // Once: afterwards it moves with its keyframe only.
  for (PointId id = 0; id < r.map.point_end(); ++id)
    if (MapPoint* p = r.map.point(id)) p->position.x() += 0.02;
  record.settle(r.optics, r.map);
  EXPECT_LT(r.error_m(record), 1e-4);
  Eigen::Isometry3d moved = Eigen::Isometry3d::Identity();
  moved.translation().z() = 7;
  move_map(r.map, {{0, moved}});
  EXPECT_NEAR(record.pose(r.map).translation().z(), 7, 1e-4);
}

TEST(FrameRecord, StaysWhereTheMapHasChangedTooMuch) {
  Recorded lost;
  for (PointId id = 0; id < 25; ++id) lost.map.erase_point(id);
  FrameRecord few(lost.map, 0, lost.frame);
  few.settle(lost.optics, lost.map);
  EXPECT_NEAR(lost.error_m(few), 0.01, 1e-9);

  Recorded torn;
  for (PointId id = 0; id < 20; ++id) torn.map.point(id)->position.y() += 0.2;
  FrameRecord record(torn.map, 0, torn.frame);
  record.settle(torn.optics, torn.map);
  EXPECT_NEAR(torn.error_m(record), 0.01, 1e-9);
}

TEST(FrameRecord, LeavesAKeyframeToTheMap) {
  Recorded r(0.5);  // the keyframe's own time
  FrameRecord record(r.map, 0, r.frame);
  record.settle(r.optics, r.map);
  EXPECT_NEAR(r.error_m(record), 0.01, 1e-9);
}

TEST(PlaceIndex, FindsTheNoisyPlaceAndForgetsRemovedOnes) {
  const auto word = [](int place, int i) {
    Descriptor d;
    for (std::uint32_t w = 0; w < 4; ++w)
      d[w] = std::uint64_t{test_scene::mix(static_cast<std::uint32_t>(place * 100000 + i * 8) + w)}
                 << 32 |
             test_scene::mix(static_cast<std::uint32_t>(place * 100000 + i * 8 + 4) + w);
    return d;
  };
  PlaceIndex index;
  for (int place = 0; place < 20; ++place) {
    std::vector<Descriptor> all;
    for (int i = 0; i < 100; ++i) all.push_back(word(place, i));
    index.add(place, all);
  }
  std::vector<Descriptor> seen;
  for (int i = 0; i < 60; ++i) {
    Descriptor d = word(7, i);
    for (int bit = 0; bit < 20; ++bit) d[bit % 4] ^= 1ull << ((bit * 13 + i) % 64);
    seen.push_back(d);
  }
  const auto votes = index.query(seen);
  ASSERT_FALSE(votes.empty());
  EXPECT_EQ(votes[0].place, 7);
  EXPECT_GT(votes[0].votes, 40);
  for (int place = 0; place < 15; ++place) index.remove(place);
  EXPECT_EQ(index.size(), 500u);
  for (const auto& v : index.query(seen)) EXPECT_GE(v.place, 15);
}

TEST(BundleAdjustment, HasExactDerivatives) {
  BundleProblem::Residual r{0, 0, {100, 90}, 0.4, 0.004, 1.2};
  const ReprojectionCost cost(test_scene::camera(), r, true);
  const Eigen::Quaterniond q0 = Eigen::Quaterniond(0.9, 0.2, -0.3, 0.1).normalized();
  double q[4] = {q0.x(), q0.y(), q0.z(), q0.w()}, t[3] = {0.1, -0.2, 0.3}, X[3] = {0.5, 0.4, 3};
  double* parameters[] = {q, t, X};
  double value[3], jq[12], jt[9], jx[9];
  double* jacobians[] = {jq, jt, jx};
  ASSERT_TRUE(cost.Evaluate(parameters, value, jacobians));
  const int sizes[] = {4, 3, 3};
  for (int block = 0; block < 3; ++block)
    for (int i = 0; i < sizes[block]; ++i) {
      const double h = 1e-6, old = parameters[block][i];
      double up[3], down[3];
      parameters[block][i] = old + h;
      cost.Evaluate(parameters, up, nullptr);
      parameters[block][i] = old - h;
      cost.Evaluate(parameters, down, nullptr);
      parameters[block][i] = old;
      // Off the unit sphere the rotation matrix differs from q X q*: compare along the sphere only.
      if (block == 0) continue;
      for (int row = 0; row < 3; ++row)
        EXPECT_NEAR(jacobians[block][row * sizes[block] + i], (up[row] - down[row]) / (2 * h),
                    1e-4 * (1 + std::abs(up[row])));
    }
  for (int axis = 0; axis < 3; ++axis) {
    const double h = 1e-6;
    Eigen::Vector3d w = Eigen::Vector3d::Zero();
    w[axis] = h;
    double values[2][3];
    Eigen::Vector4d tangent;
    for (int side = 0; side < 2; ++side) {
      const Eigen::Quaterniond turned =
          Eigen::Quaterniond(Eigen::AngleAxisd((side ? -h : h), w / h)) * q0;
      double qt[4] = {turned.x(), turned.y(), turned.z(), turned.w()};
      const double* p[] = {qt, t, X};
      cost.Evaluate(p, values[side], nullptr);
      tangent = side ? Eigen::Vector4d((tangent - turned.coeffs()) / (2 * h))
                     : Eigen::Vector4d(turned.coeffs());
    }
    for (int row = 0; row < 3; ++row) {
      double expected = 0;
      for (int i = 0; i < 4; ++i) expected += jq[row * 4 + i] * tangent[i];
      EXPECT_NEAR(expected, (values[0][row] - values[1][row]) / (2 * h),
                  1e-4 * (1 + std::abs(expected)));
    }
  }
}

TEST(PoseGraph, SpreadsTheDriftOverTheLoop) {
  // A circle whose odometry turns a little too far; one edge says where the end really is.
  constexpr int kCount = 20;
  const auto truth = [](int i) {
    const double angle = 2 * std::acos(-1.0) * i / kCount;
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.linear() = Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitY()).toRotationMatrix();
    T.translation() = T.linear() * Eigen::Vector3d(0, 0, -3);
    return Eigen::Isometry3d(T.inverse());
  };
  std::map<KeyframeId, Eigen::Isometry3d> poses{{0, truth(0)}};
  std::vector<PoseGraphEdge> edges;
  Eigen::Isometry3d drift = Eigen::Isometry3d::Identity();
  drift.linear() = Eigen::AngleAxisd(0.01, Eigen::Vector3d::UnitY()).toRotationMatrix();
  drift.translation() << 0.01, 0, 0;
  for (int i = 1; i < kCount; ++i) {
    const Eigen::Isometry3d step = drift * truth(i) * truth(i - 1).inverse();
    poses[i] = step * poses[i - 1];
    edges.push_back({i, i - 1, step});
  }
  edges.push_back({kCount - 1, 0, truth(kCount - 1) * truth(0).inverse()});
  const auto error = [&] {
    double worst = 0;
    for (const auto& [id, T] : poses)
      worst =
          std::max(worst, (T.inverse().translation() - truth(id).inverse().translation()).norm());
    return worst;
  };
  const double before = error();
  ASSERT_TRUE(optimize_pose_graph(poses, edges, 0));
  EXPECT_LT(error(), before / 3);
  EXPECT_TRUE(poses[0].isApprox(truth(0), 1e-12));
}

TEST(SlamSystem, FollowsACamera) {
  SlamSystem slam(test_scene::camera(), small_settings());
  for (int step = 0; step < 60; ++step)
    ASSERT_TRUE(feed(slam, test_scene::render(test_scene::path(3 * step), step * 0.1))) << step;
  ASSERT_EQ(slam.trajectory().size(), 60u);
  EXPECT_LT(worst_error(slam.trajectory(), sway), 0.03);
  EXPECT_GE(slam.keyframes(), 3u);
  const std::vector<Eigen::Vector3d> points = slam.map_point_positions();
  EXPECT_EQ(points.size(), slam.map_points());
  EXPECT_TRUE(
      std::all_of(points.begin(), points.end(), [](const auto& p) { return p.allFinite(); }));
  EXPECT_LE(slam.keyframe_trajectory().size(), 40u);
}

// It has no bundle adjustment, but points of more than one keyframe.
TEST(SlamSystem, AsOdometryNeverLooksBack) {
  SlamSystem::Settings settings = SlamSystem::Settings::odometry();
  settings.features = small_settings().features;
  SlamSystem slam(test_scene::camera(), settings);
  Trajectory tracked;
  for (int step = 0; step < 40; ++step) {
    const auto pose = feed(slam, test_scene::render(test_scene::path(3 * step), step * 0.1));
    ASSERT_TRUE(pose) << step;
    tracked.push_back({step * 0.1, *pose});
  }
  slam.finish();
  EXPECT_LT(worst_error(tracked, sway), 0.02);
  EXPECT_GE(slam.keyframes(), 3u);
  const Trajectory finished = slam.trajectory();
  ASSERT_EQ(finished.size(), tracked.size());
  for (std::size_t i = 0; i < tracked.size(); ++i)
    EXPECT_TRUE(finished[i].T_world_camera.isApprox(tracked[i].T_world_camera, 1e-12)) << i;
}

// What was seen later makes earlier poses better, too.
TEST(SlamSystem, IsMoreExactOnceItIsFinished) {
  SlamSystem slam(test_scene::camera(), small_settings());
  cv::RNG noise(1);
  for (int step = 0; step < 60; ++step) {
    RgbdFrame frame = test_scene::render(test_scene::path(2 * step), step / 15.0);
    cv::Mat added(frame.color.size(), CV_16SC1), noisy;
    noise.fill(added, cv::RNG::NORMAL, 0, 8);
    cv::add(frame.color, added, noisy, cv::noArray(), CV_8U);
    frame.color = noisy;
    ASSERT_TRUE(feed(slam, frame)) << step;
  }
  Trajectory truth;
  for (const StampedPose& p : slam.trajectory()) truth.push_back({p.timestamp, sway(p.timestamp)});
  const double before = ate(truth, slam.trajectory()).rmse_m;
  slam.finish();
  const Trajectory finished = slam.trajectory();
  const double after = ate(truth, finished).rmse_m;
  EXPECT_LT(after, 0.95 * before);
  slam.finish();
  EXPECT_EQ(slam.trajectory().back().T_world_camera.matrix(),
            finished.back().T_world_camera.matrix());
}

// Turns by jerks, now to this side and now to that: nothing is where the last turn foretells it.
TEST(SlamSystem, FollowsACameraThatTurnsByJerks) {
  RandomGenerator random(3);
  SlamSystem slam(test_scene::camera(), small_settings());
  Trajectory truth, tracked;
  double turn = 0;
  int fewest = 1000;
  for (int step = 0; step < 60; ++step) {
    Eigen::Isometry3d T = test_scene::path(step);
    T.rotate(Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitY()));
    turn = std::clamp(turn + 0.4 * (random.uniform() - 0.5), -0.6, 0.6);
    const RgbdFrame frame = test_scene::render(T, step / 15.0);
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

// No mask covers the mover yet.
TEST(SlamSystem, IsNotTakenAlongByWhatMovesBeforeTheFirstMask) {
  SlamSystem slam(test_scene::camera(), small_settings());
  Trajectory tracked;
  for (int step = 0; step < 5; ++step) {
    const RgbdFrame frame = test_scene::render_with_mover(step);
    const auto pose = feed(slam, frame);
    ASSERT_TRUE(pose) << step;
    tracked.push_back({frame.timestamp, *pose});
  }
  EXPECT_LT(worst_error(tracked, sway), 0.02);  // 0.055 if the pose is a compromise with it
}

// What fills most of the image takes the first frames along; then it goes, and they are mended.
void mend_the_start(double covered_s, double rate_hz = 30) {
  for (const bool threaded : {false, true}) {
    if (threaded && rate_hz > 30) continue;  // slow, as the threads are waited for after each frame
    SlamSystem::Settings settings = small_settings();
    settings.threaded = threaded;
    SlamSystem slam(test_scene::camera(), settings);
    Trajectory tracked;
    for (int step = 0; step < 80 * rate_hz / 30; ++step) {
      const double t = step / rate_hz;
      const Eigen::Isometry3d T = test_scene::path_at(t);
      RgbdFrame frame = test_scene::render(T, t);
      if (t < covered_s - 1e-6) {
        // It looks like the walls behind the camera, which are not seen else.
        Eigen::Isometry3d moved = Eigen::AngleAxisd(3.14159, Eigen::Vector3d::UnitY()) * T;
        moved.pretranslate(Eigen::Vector3d(0.45, 0, 0.15) * t);
        test_scene::cover_left(frame, frame.color.cols * 3 / 5, moved);
      }
      const auto pose = feed(slam, frame);
      ASSERT_TRUE(pose) << step;
      tracked.push_back({frame.timestamp, *pose});
      if (threaded) slam.finish();  // else frames come faster than the map is built
    }
    slam.finish();
    ASSERT_EQ(slam.trajectory().size(), tracked.size());
    EXPECT_GT(worst_error(tracked, test_scene::path_at), 0.08) << threaded;  // else nothing to mend
    EXPECT_LT(worst_error(slam.trajectory(), test_scene::path_at), 0.05) << threaded;
    // Where it is now has not changed.
    EXPECT_LT((slam.trajectory().back().T_world_camera.translation() -
               tracked.back().T_world_camera.translation())
                  .norm(),
              0.01)
        << threaded;
  }
}

TEST(SlamSystem, MendsTheStartOnceItKnowsWhatStandsStill) { mend_the_start(8 / 30.0); }

// Then keyframes of 10 frames later have it in their map, too.
TEST(SlamSystem, MendsALongWrongStart) { mend_the_start(20 / 30.0); }

// 1.5 s are 15 or 23 frames then.
TEST(SlamSystem, MendsTheStartOfASlowCamera) {
  mend_the_start(8 / 30.0, 15);
  mend_the_start(20 / 30.0, 10);
}

// And 90 or 135, of which every second or third is kept.
TEST(SlamSystem, MendsTheStartOfAFastCamera) {
  mend_the_start(20 / 30.0, 60);
  mend_the_start(0.85, 90);
}

// Few frames in the first seconds, with gaps.
TEST(SlamSystem, ReviewsAStartOfFewFrames) {
  SlamSystem slam(test_scene::camera(), small_settings());
  Trajectory tracked;
  int step = 0;
  for (const double t : {0.0, 0.4, 1.9, 3.1, 3.2, 6.0}) {
    const auto pose = feed(slam, test_scene::render(test_scene::path(step++), t));
    ASSERT_TRUE(pose) << t;
    tracked.push_back({t, *pose});
  }
  slam.finish();
  ASSERT_EQ(slam.trajectory().size(), tracked.size());
  for (std::size_t i = 0; i < tracked.size(); ++i)
    EXPECT_LT((slam.trajectory()[i].T_world_camera.translation() -
               tracked[i].T_world_camera.translation())
                  .norm(),
              0.01)
        << i;
}

TEST(SlamSystem, SaysThatItIsLostAndGoesOnInTheSameFrameOfReference) {
  SlamSystem slam(test_scene::camera(), small_settings());
  for (int step = 0; step < 20; ++step)
    ASSERT_TRUE(feed(slam, test_scene::render(test_scene::path(3 * step), step * 0.1)));
  RgbdFrame black = test_scene::render(test_scene::path(0), 2.0);
  black.color.setTo(0);
  for (int i = 0; i < 3; ++i) {
    black.timestamp = 2.0 + 0.1 * i;
    EXPECT_FALSE(feed(slam, black).has_value());
    EXPECT_FALSE(slam.predicted_motion().has_value());
  }
  // Back at a place seen long ago.
  RgbdFrame known = test_scene::render(test_scene::path(6), 2.4);
  const auto T = feed(slam, known);
  ASSERT_TRUE(T.has_value());
  EXPECT_TRUE(slam.stats().recovered);
  const Eigen::Isometry3d truth = test_scene::path(0).inverse() * test_scene::path(6);
  EXPECT_LT((T->translation() - truth.translation()).norm(), 0.02);
  EXPECT_EQ(slam.trajectory().size(), 21u);
}

// Two seconds of trouble at 10 Hz in the middle of a walk: what was tracked, and what was lost.
class Trouble : public testing::Test {
 protected:
  static constexpr int kFrames = 45, kBegin = 15, kEnd = 35;

  // `change` spoils a frame of the bad time and its mask.
  void walk(const std::function<void(RgbdFrame&, DynamicMask&)>& change) {
    for (int step = 0; step < kFrames; ++step) {
      RgbdFrame frame = test_scene::render(test_scene::path(2 * step), step * 0.1);
      DynamicMask mask;
      const bool bad = step >= kBegin && step < kEnd;
      if (bad) change(frame, mask);
      const std::size_t n = slam_.extract(frame, mask).size();
      const bool tracked = slam_.track(frame, mask, test_scene::keep_all(n)).has_value();
      const MapTracking::Stats& stats = slam_.stats();
      (bad ? tracked_in_trouble_ : tracked_else_) += tracked;
      recovered_ += stats.recovered;
      if (bad) keypoints_ += stats.keypoints, with_depth_ += stats.with_depth;
      EXPECT_EQ(tracked, slam_.trajectory().size() > 0 &&
                             slam_.trajectory().back().timestamp == frame.timestamp)
          << step;
    }
  }

  void expect_lost_and_found_again() const {
    EXPECT_EQ(tracked_in_trouble_, 0);
    EXPECT_EQ(keypoints_, 0);
    EXPECT_EQ(tracked_else_, kFrames - (kEnd - kBegin));
    EXPECT_EQ(recovered_, 1);
    EXPECT_LT(worst_error(slam_.trajectory(), path_at_10_hz), 0.03);
  }

  SlamSystem slam_{test_scene::camera(), small_settings()};
  int tracked_in_trouble_ = 0, tracked_else_ = 0, recovered_ = 0;
  int keypoints_ = 0, with_depth_ = 0;
};

TEST_F(Trouble, BlackPicturesAreLostAndTheWayIsFoundAgain) {
  walk([](RgbdFrame& frame, DynamicMask&) { frame.color.setTo(0); });
  expect_lost_and_found_again();
}

TEST_F(Trouble, FullMasksAreLostAndTheWayIsFoundAgain) {
  walk([](RgbdFrame& frame, DynamicMask& mask) {
    mask.image = cv::Mat(frame.color.size(), CV_8UC1, cv::Scalar(255));
  });
  expect_lost_and_found_again();
}

TEST_F(Trouble, AKidnappedCameraIsLostUntilItSeesWhatItKnows) {
  // Half of the frames look the other way, at walls never seen.
  int step = kBegin;
  walk([&](RgbdFrame& frame, DynamicMask&) {
    Eigen::Isometry3d T = test_scene::path(2 * step);
    T.linear() = T.linear() * Eigen::AngleAxisd(3.14, Eigen::Vector3d::UnitY()).toRotationMatrix();
    frame = test_scene::render(T, frame.timestamp);
    ++step;
  });
  EXPECT_EQ(tracked_in_trouble_, 0) << "nothing there is like the map";
  EXPECT_GT(keypoints_, 20 * 100);
  EXPECT_EQ(tracked_else_, kFrames - (kEnd - kBegin));
  EXPECT_EQ(recovered_, 1);
  EXPECT_LT(worst_error(slam_.trajectory(), path_at_10_hz), 0.03);
}

TEST_F(Trouble, MissingDepthIsBridged) {
  int step = 0;
  walk([&](RgbdFrame& frame, DynamicMask&) {
    // Both kinds of nothing: no value, no image.
    if (step++ % 2)
      frame.depth.setTo(0);
    else
      frame.depth.release();
  });
  EXPECT_EQ(with_depth_, 0);
  EXPECT_EQ(tracked_in_trouble_ + tracked_else_, kFrames);
  EXPECT_EQ(recovered_, 0);
  EXPECT_LT(worst_error(slam_.trajectory(), path_at_10_hz), 0.03);
}

TEST(SlamSystem, ClosesALoop) {
  // A camera that believes in a focal length 1.5 % too long walks once around the room and a little
  // further: each turn is measured too small.
  Camera wrong = test_scene::camera();
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
  for (int step = 0; step < kFrames; ++step)
    frames.push_back(test_scene::render(around(step), step / 30.0));
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
  EXPECT_LT(drift[kOn], drift[kOff] / 3);
  // How many keyframes there are in threads depends on the machine, and so does when it closes.
  EXPECT_LT(drift[kThreaded], 0.1);
}

TEST(SlamSystem, StartsAnewWhenAYoungMapIsLost) {
  SlamSystem::Settings settings = small_settings();
  settings.tracking.restart_after_s = 0.1;
  SlamSystem slam(test_scene::camera(), settings);
  ASSERT_TRUE(feed(slam, test_scene::render(test_scene::path(0), 0)));
  RgbdFrame black = test_scene::render(test_scene::path(0), 0.1);
  black.color.setTo(0);
  for (int i = 0; i < 4; ++i) EXPECT_FALSE(feed(slam, black));
  EXPECT_TRUE(slam.trajectory().empty());
  EXPECT_TRUE(feed(slam, test_scene::render(test_scene::path(30), 1)));
  EXPECT_EQ(slam.trajectory().size(), 1u);
}

TEST(SlamSystem, IsDeterministic) {
  Trajectory first;
  for (int run = 0; run < 2; ++run) {
    SlamSystem slam(test_scene::camera(), small_settings());
    for (int step = 0; step < 20; ++step)
      feed(slam, test_scene::render(test_scene::path(5 * step), step * 0.1));
    slam.finish();
    const Trajectory t = slam.trajectory();
    if (run == 0) first = t;
    ASSERT_EQ(t.size(), first.size());
    for (std::size_t i = 0; i < t.size(); ++i)
      EXPECT_EQ(t[i].T_world_camera.matrix(), first[i].T_world_camera.matrix());
  }
}

TEST(SlamSystem, ThreadsGiveTheSameWithinNoise) {
  SlamSystem::Settings settings = small_settings();
  settings.threaded = true;
  SlamSystem slam(test_scene::camera(), settings);
  for (int step = 0; step < 40; ++step)
    ASSERT_TRUE(feed(slam, test_scene::render(test_scene::path(3 * step), step * 0.1))) << step;
  slam.finish();
  EXPECT_LT(worst_error(slam.trajectory(), sway), 0.03);
}

TEST(SlamSystem, RefusesNumbersThatAreNotFinite) {
  test_scene::expect_only_finite_numbers(
      [](const Camera& camera, std::unique_ptr<FeatureExtractor> extractor) {
        return std::make_unique<SlamSystem>(camera, small_settings(), std::move(extractor));
      });
}

TEST(SlamSystem, NeverWritesIntoTheCallersImage) {
  for (const bool threaded : {false, true}) {
    SlamSystem::Settings settings = small_settings();
    settings.threaded = threaded;
    SlamSystem slam(test_scene::camera(), settings);
    test_scene::expect_images_untouched(slam);
  }
}

// Memory that runs out in a thread, at any place, reaches the caller and does no other harm.
TEST(SlamSystem, HandsOnWhatItsThreadsThrowAndGoesOn) {
  cv::setNumThreads(1);  // no threads but ours ask for memory
  const failing_memory::SpareThisThread spared;
  std::vector<RgbdFrame> frames;
  for (int step = 0; step < 40; ++step)
    frames.push_back(test_scene::render(test_scene::path(3 * step), step * 0.1));
  SlamSystem::Settings settings = small_settings();
  settings.threaded = true;
  settings.mapping.bundle_keyframes = 0;  // Ceres itself ends the process
  int failures = 0;
  // The further into the work it happens, the farther apart the places that are tried.
  for (int after = 1; after < 30000; after += 1 + after / 2) {
    SCOPED_TRACE(after);
    SlamSystem slam(test_scene::camera(), settings);
    // Each of the two threads may have an Error to hand on; what fails so was not begun.
    const auto attempt = [&](const auto& call) {
      for (int tries = 0; tries < 3; ++tries) {
        try {
          return call();
        } catch (const Error& e) {
          ++failures;
          EXPECT_NE(std::string(e.what()).find(" of keyframe "), std::string::npos) << e.what();
          EXPECT_NE(std::string(e.what()).find("bad_alloc"), std::string::npos) << e.what();
          failing_memory::fail_after(0);
        }
      }
      ADD_FAILURE() << "more Errors than threads";
    };
    for (const RgbdFrame& frame : frames) {
      if (slam.keyframes() % 5 == 2) failing_memory::fail_after(after);
      std::size_t n = 0;
      attempt([&] { n = slam.extract(frame, DynamicMask()).size(); });
      attempt([&] {
        EXPECT_TRUE(slam.track(frame, DynamicMask(), test_scene::keep_all(n))) << frame.timestamp;
      });
    }
    attempt([&] { slam.finish(); });
    failing_memory::fail_after(0);
    EXPECT_EQ(slam.trajectory().size(), frames.size());
    EXPECT_LT(worst_error(slam.trajectory(), sway), 0.05);
  }
  EXPECT_GT(failures, 20);
  cv::setNumThreads(-1);
}

TEST(SlamSystem, RefusesASelectionOfOtherKeypoints) {
  SlamSystem slam(test_scene::camera(), small_settings());
  const RgbdFrame frame = test_scene::render(test_scene::path(0), 0);
  slam.extract(frame, DynamicMask());
  EXPECT_THROW(slam.track(frame, DynamicMask(), test_scene::keep_all(3)), Error);
  EXPECT_THROW(SlamSystem{Camera()}, Error);
}

}  // namespace
