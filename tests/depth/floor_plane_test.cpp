// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/depth/floor_plane.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace {

using namespace stillpoint;

// Samples of a room as a camera sees it, in rows from the top: a floor `height_m` below the
// camera, which looks down by `pitch`, a wall, and furniture in a share of the image.
std::vector<InverseSample> room(float height_m, float pitch, float clutter, std::uint64_t seed,
                                float noise = 0.002f, float wall_m = 5) {
  RandomGenerator random(seed);
  std::vector<InverseSample> samples;
  for (int v = 0; v < 21; ++v)
    for (int u = 0; u < 28; ++u) {
      const float x = static_cast<float>(u - 13.5) / 23, y = static_cast<float>(v - 10) / 23;
      const float floor = (std::cos(pitch) * y + std::sin(pitch)) / height_m;
      float inverse = std::max(floor, 1 / wall_m);
      if (random.uniform() < clutter)
        inverse = 1 / (0.8f + 4 * static_cast<float>(random.uniform()));
      samples.push_back({x, y, inverse + noise * static_cast<float>(2 * random.uniform() - 1)});
    }
  return samples;
}

void expect_floor(const InversePlane& plane, float height_m, float pitch) {
  ASSERT_TRUE(plane.found);
  for (const float y : {0.2f, 0.4f})
    for (const float x : {-0.5f, 0.0f, 0.5f}) {
      const float z = height_m / (std::cos(pitch) * y + std::sin(pitch));
      EXPECT_NEAR(1 / plane.inverse_depth(x, y), z, 0.02f * z) << "at " << x << " " << y;
    }
}

TEST(FloorPlane, IsFoundFromAnyUsualPlace) {
  for (const float height_m : {0.5f, 1.2f, 1.8f})
    for (const float pitch : {0.0f, 0.2f, 0.5f})
      expect_floor(find_floor(room(height_m, pitch, 0, 1, 0.002f, 8), InversePlane(), 1), height_m,
                   pitch);
}

TEST(FloorPlane, IsFoundAmongFurniture) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed)
    expect_floor(find_floor(room(1.2f, 0.3f, 0.4f, seed), InversePlane(), seed), 1.2f, 0.3f);
}

TEST(FloorPlane, IsNotATableThatCoversMoreOfThePicture) {
  const float height_m = 1.2f, table_m = 0.5f, pitch = 0.3f;
  std::vector<InverseSample> samples = room(height_m, pitch, 0, 1);
  int of_floor = 0, of_table = 0;
  for (InverseSample& s : samples) {
    const float table = (std::cos(pitch) * s.y + std::sin(pitch)) / table_m;
    if (std::abs(s.x) < 0.4f && table > 1 / 2.2f)
      s.inverse = table, ++of_table;
    else
      of_floor += s.inverse > 0.21f;
  }
  ASSERT_GT(of_table, of_floor);
  expect_floor(find_floor(samples, InversePlane(), 1), height_m, pitch);
}

TEST(FloorPlane, MovesWithTheCamera) {
  const float height_m = 1.2f, pitch = 0.3f;
  const InversePlane floor = {{0, std::cos(pitch) / height_m, std::sin(pitch) / height_m}, true};
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.rotate(Eigen::AngleAxisd(0.2, Eigen::Vector3d(0.3, 0.5, 0.8).normalized()));
  T.pretranslate(Eigen::Vector3d(0.1, -0.2, 0.3));
  const InversePlane moved = floor.moved(T);
  ASSERT_TRUE(moved.found);
  for (const double x : {-0.5, 0.0, 0.5}) {
    const Eigen::Vector3d p =
        static_cast<double>(1 / floor.inverse_depth(static_cast<float>(x), 0.3f)) *
        Eigen::Vector3d(x, static_cast<double>(0.3f), 1);
    const Eigen::Vector3d q = T * p;
    EXPECT_NEAR(1 / moved.inverse_depth(static_cast<float>(q.x() / q.z()),
                                        static_cast<float>(q.y() / q.z())),
                q.z(), 1e-4 * q.z());
  }
  EXPECT_FALSE(InversePlane().moved(T).found);
}

TEST(FloorPlane, IsKeptInMindWherePeopleHideIt) {
  const float height_m = 1.2f, pitch = 0.3f;
  const InversePlane floor = {{0, std::cos(pitch) / height_m, std::sin(pitch) / height_m}, true};
  std::vector<InverseSample> samples = room(height_m, pitch, 0, 1);
  RandomGenerator random(1);
  int seen = 0;
  for (InverseSample& s : samples) {
    const bool is_floor = std::abs(floor.inverse_depth(s.x, s.y) - s.inverse) < 0.003f;
    if (is_floor && random.uniform() < 0.85)
      s.inverse = 1 / 0.5f;
    else
      seen += is_floor;
  }
  ASSERT_LT(seen, static_cast<int>(samples.size()) / 8);
  EXPECT_FALSE(find_floor(samples, floor, 1).found);
  expect_floor(find_floor(samples, floor, 1, true), height_m, pitch);
  // Not where nothing of it is seen.
  EXPECT_FALSE(find_floor(room(100, 0, 0, 1), floor, 1, true).found);
}

TEST(FloorPlane, IsNotSeenWhereThereIsNone) {
  // A wall; a ceiling; noise.
  EXPECT_FALSE(find_floor(room(100, 0, 0, 1), InversePlane(), 1).found);
  std::vector<InverseSample> ceiling = room(1.2f, 0.2f, 0, 1);
  for (InverseSample& s : ceiling) s.y = -s.y;
  EXPECT_FALSE(find_floor(ceiling, InversePlane(), 1).found);
  EXPECT_FALSE(find_floor(room(100, 0, 1, 1), InversePlane(), 1).found);
  EXPECT_FALSE(find_floor({}, InversePlane(), 1).found);
  const std::vector<InverseSample> same(100, {0.1f, 0.2f, 0.5f});
  EXPECT_FALSE(find_floor(same, InversePlane(), 1).found);
}

TEST(FloorPlane, NeedsSamples) {
  std::vector<InverseSample> few = room(1.2f, 0.3f, 0, 1);
  few.erase(few.begin(), few.end() - 29);
  EXPECT_FALSE(find_floor(few, InversePlane(), 1).found);
}

TEST(FloorPlane, StartsFromTheLastOne) {
  const InversePlane last = find_floor(room(1.2f, 0.3f, 0, 1), InversePlane(), 1);
  // With no trial of its own only the last one can be found.
  expect_floor(find_floor(room(1.2f, 0.3f, 0.2f, 2), last, 1, false, 0), 1.2f, 0.3f);
  EXPECT_FALSE(find_floor(room(1.2f, 0.3f, 0.2f, 2), InversePlane(), 1, false, 0).found);
  // A last one that does not hold any more is given up.
  expect_floor(find_floor(room(0.8f, 0.1f, 0.1f, 3), last, 1), 0.8f, 0.1f);
}

TEST(FloorPlane, IsTheSameForTheSameSeed) {
  const auto samples = room(1.2f, 0.3f, 0.4f, 5);
  const InversePlane a = find_floor(samples, InversePlane(), 9),
                     b = find_floor(samples, InversePlane(), 9);
  EXPECT_EQ(a.n, b.n);
}

TEST(FloorPlane, RaysAboveTheHorizonMeetNothing) {
  const InversePlane plane = find_floor(room(1.2f, 0, 0, 1), InversePlane(), 1);
  EXPECT_LT(plane.inverse_depth(0, -0.3f), 0);
  EXPECT_GT(plane.inverse_depth(0, 0.3f), 0);
}

}  // namespace
