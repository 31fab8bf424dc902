// SPDX-License-Identifier: BSD-2-Clause
#include <gtest/gtest.h>

#include <vector>

#include "stillpoint/backends/rgbd_slam/map_changes.hpp"
#include "stillpoint/backends/rgbd_slam/place_index.hpp"
#include "test_scene.hpp"

namespace {

using namespace stillpoint;
using namespace stillpoint::rgbd_slam;
using namespace test_scene;

KeypointFrame frame_of(std::size_t n) {
  KeypointFrame f;
  f.keypoints.resize(n);
  for (FrameKeypoint& k : f.keypoints) k.depth_m = 2;
  f.descriptors.resize(n);
  return f;
}

TEST(Map, KeepsObservationsOfBothSidesTogether) {
  Map map;
  Keyframe& a = map.add_keyframe(frame_of(30), Eigen::Isometry3d::Identity());
  Keyframe& b = map.add_keyframe(frame_of(30), Eigen::Isometry3d::Identity());
  for (std::size_t i = 0; i < 20; ++i)
    map.observe(map.add_point({0, 0, 2 + 0.1 * static_cast<double>(i)}, a, i), b, 29 - i);
  map.update_connections(b.id);
  EXPECT_EQ(a.covisible.at(b.id), 20);
  EXPECT_TRUE(b.parent == a.id);
  EXPECT_TRUE(map.neighbors(a.id) == std::vector<KeyframeId>{b.id});

  const PointId twin = map.add_point({0, 0, 2}, b, 0).id, fifth(5), third(3);
  map.replace_point(twin, fifth);
  EXPECT_EQ(map.point(twin), nullptr);
  EXPECT_FALSE(b.points[0]) << "point 5 is seen by b at another keypoint";

  map.forget(third, a.id);
  EXPECT_FALSE(a.points[3]);
  ASSERT_NE(map.point(third), nullptr);
  EXPECT_TRUE(map.point(third)->reference == b.id);
  map.forget(third, b.id);
  EXPECT_EQ(map.point(third), nullptr);
  EXPECT_EQ(map.point_count(), 19u);
}

TEST(Map, KeepsThePoseOfACulledKeyframeRelativeToItsParent) {
  Map map;
  const KeyframeId first(0), second(1), third(2);
  for (int i = 0; i < 3; ++i) {
    const Eigen::Isometry3d T(Eigen::Translation3d(i, 0, 0));
    map.update_connections(map.add_keyframe(frame_of(5), T).id);
  }
  map.cull_keyframe(first);
  EXPECT_NE(map.keyframe(first), nullptr);  // the origin stays
  map.cull_keyframe(second);
  EXPECT_EQ(map.keyframe(second), nullptr);
  EXPECT_TRUE(map.keyframe(third)->parent == first);
  EXPECT_NEAR(map.pose_of(second).translation().x(), 1, 1e-12);
  move_map(map, {{first, Eigen::Isometry3d(Eigen::Translation3d(0, 7, 0))}});
  EXPECT_NEAR(map.pose_of(second).translation().y(), 7, 1e-12);
  EXPECT_NEAR(map.pose_of(third).translation().y(), 7, 1e-12);
}

TEST(PlaceIndex, FindsTheNoisyPlaceAndForgetsRemovedOnes) {
  const auto word = [](std::uint32_t place, std::uint32_t i) {
    Descriptor d;
    for (std::uint32_t byte = 0; byte < 32; ++byte)
      d[byte] = static_cast<std::uint8_t>(mix(mix(place * 100 + i) + byte));
    return d;
  };
  PlaceIndex index;
  for (std::uint32_t place = 0; place < 20; ++place) {
    std::vector<Descriptor> all;
    for (std::uint32_t i = 0; i < 100; ++i) all.push_back(word(place, i));
    index.add(KeyframeId(place), all);
  }
  std::vector<Descriptor> seen;
  for (std::uint32_t i = 0; i < 60; ++i) {
    seen.push_back(word(7, i));
    for (std::uint32_t n = 0; n < 20; ++n) seen.back()[(n * 13 + i) % 32] ^= 1 << n % 8;
  }
  const auto votes = index.query(seen);
  ASSERT_FALSE(votes.empty());
  EXPECT_EQ(votes[0].place.index(), 7u);
  EXPECT_GT(votes[0].votes, 40);
  for (std::size_t place = 0; place < 15; ++place) index.remove(KeyframeId(place));
  for (const auto& v : index.query(seen)) EXPECT_GE(v.place.index(), 15u);
}

}  // namespace
