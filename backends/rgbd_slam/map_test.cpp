// SPDX-License-Identifier: BSD-2-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "stillpoint/backends/rgbd_slam/map_changes.hpp"
#include "stillpoint/backends/rgbd_slam/map_tracking.hpp"
#include "test_scene.hpp"

namespace {

using namespace stillpoint;
using namespace stillpoint::rgbd_slam;
using namespace test_scene;

// When what is due after some time happens, for a camera that stands still and then sees nothing.
struct Times {
  std::vector<double> keyframes;
  double settled_s = 0, restart_s = 0;  // the age of what is settled last; lost so long
};

Times times_at(double rate_hz, bool with_timestamps = true) {
  static const RgbdFrame still = render(path(0), 0);
  OrbExtractor extractor;
  Features features;
  extractor.extract(still.color, cv::Mat(), features);
  const std::vector<int> all = keep_all(features.keypoints.size()).kept;
  ImagePyramid pyramid;
  pyramid.build(still.color, extractor.levels(), extractor.scale_factor());
  MapTracking::Settings settings;
  settings.restart_keyframes = 100;  // the map counts as young
  const CameraModel model{camera(), NoiseModel(), extractor.levels(), extractor.scale_factor()};
  MapTracking tracking(model, settings);
  Map map;
  FairMutex lock;
  PlaceIndex index;
  Times times;
  const auto track = [&](int step, const std::vector<int>& kept) {
    RgbdFrame frame = still;
    frame.timestamp = with_timestamps ? 1e9 + step / rate_hz : 0;
    return tracking.track(map, index,
                          KeypointFrame(frame, camera(), features, kept, extractor.scale_factor(),
                                        KeypointFrame::Settings()),
                          pyramid, false);
  };
  int step = 0;
  for (; step <= 4 * rate_hz; ++step) {
    EXPECT_TRUE(track(step, all)) << step;
    if (tracking.new_keyframe() != kNone) times.keyframes.push_back(step / rate_hz);
    tracking.history().settle(model, map, lock);
  }
  times.settled_s = (step - static_cast<int>(tracking.history().settled())) / rate_hz;
  const int lost = step;
  while (!tracking.stats().restart_due && step < lost + 20 * rate_hz) track(step++, {});
  times.restart_s = (step - 1 - lost) / rate_hz;
  return times;
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
  CameraModel model;
  Eigen::Isometry3d truth = Eigen::Isometry3d::Identity();

  explicit Recorded(double timestamp = 1) {
    model.camera = camera();
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
      const Eigen::Vector2d pixel = model.camera.project(p);
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
  record.settle(r.model, r.map);
  EXPECT_LT(r.error_m(record), 1e-4);
  // Once: afterwards it moves with its keyframe only.
  for (PointId id = 0; id < r.map.point_end(); ++id)
    if (MapPoint* p = r.map.point(id)) p->position.x() += 0.02;
  record.settle(r.model, r.map);
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
  few.settle(lost.model, lost.map);
  EXPECT_NEAR(lost.error_m(few), 0.01, 1e-9);

  Recorded torn;
  for (PointId id = 0; id < 20; ++id) torn.map.point(id)->position.y() += 0.2;
  FrameRecord record(torn.map, 0, torn.frame);
  record.settle(torn.model, torn.map);
  EXPECT_NEAR(torn.error_m(record), 0.01, 1e-9);
}

TEST(FrameRecord, LeavesAKeyframeToTheMap) {
  Recorded r(0.5);  // the keyframe's own time
  FrameRecord record(r.map, 0, r.frame);
  record.settle(r.model, r.map);
  EXPECT_NEAR(r.error_m(record), 0.01, 1e-9);
}

TEST(PlaceIndex, FindsTheNoisyPlaceAndForgetsRemovedOnes) {
  const auto word = [](int place, int i) {
    Descriptor d;
    for (std::uint32_t w = 0; w < 4; ++w)
      d[w] = std::uint64_t{mix(static_cast<std::uint32_t>(place * 100000 + i * 8) + w)} << 32 |
             mix(static_cast<std::uint32_t>(place * 100000 + i * 8 + 4) + w);
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

}  // namespace
