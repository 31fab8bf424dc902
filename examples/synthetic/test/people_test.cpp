// SPDX-License-Identifier: BSD-2-Clause
#include "synthetic/people.hpp"

#include <gtest/gtest.h>

#include "synthetic/camera.hpp"
#include "synthetic/movers.hpp"

namespace stillpoint::synthetic {
namespace {

constexpr std::uint64_t kSeed = 3;

/// A furnished room, built once, with people of a test's own.
struct Office {
  StaticScene scene;
  RoomPlan plan;
};

const Office& office() {
  static const Office* built = [] {
    auto* o = new Office;
    o->plan = build_room(o->scene, kSeed);
    return o;
  }();
  return *built;
}

/// The people; their clothes join the textures of the room, of which they carry cartons.
struct Crowd {
  StaticScene wardrobe;
  People people;
  Crowd(int count, bool seated, bool carried = false, bool near_lane_free = false)
      : wardrobe(office().scene),
        people(wardrobe, office().plan, count, seated, carried, near_lane_free, false, kSeed) {}
  MovingThings at(double t_s) const {
    MovingThings things;
    people.append(t_s, wardrobe.textures, things);
    return things;
  }
};

/// Where each person stands: the mean of the parts, on the floor.
std::vector<Vec3> places(const MovingThings& things, int count) {
  std::vector<Vec3> sums(static_cast<std::size_t>(count));
  std::vector<int> counts(static_cast<std::size_t>(count), 0);
  for (const RoundPart& part : things.parts) {
    const auto i = static_cast<std::size_t>(part.label - 1);
    sums[i] = sums[i] + part.frame.origin, ++counts[i];
  }
  for (std::size_t i = 0; i < sums.size(); ++i)
    sums[i] = sums[i] * (1.0 / counts[i]), sums[i].z = 0;
  return sums;
}

double flat_distance(Vec3 a, Vec3 b) {
  return std::sqrt((a.x - b.x) * (a.x - b.x) + (a.y - b.y) * (a.y - b.y));
}

/// Distance of a place on the floor from a box's footprint; 0 inside.
double flat_distance(Vec3 p, const Occluder& box) {
  const Vec3 q = box.frame.to_local({p.x, p.y, box.frame.origin.z});
  const double dx = std::max(0.0, std::abs(q.x) - box.size.x / 2);
  const double dy = std::max(0.0, std::abs(q.y) - box.size.y / 2);
  return std::sqrt(dx * dx + dy * dy);
}

TEST(SyntheticPeople, WalkersTouchNeitherWallsNorFurnitureNorEachOther) {
  const Crowd crowd(kMostPeople, false);
  for (double t = 0; t < 40; t += 0.4) {
    const std::vector<Vec3> at = places(crowd.at(t), kMostPeople);
    for (std::size_t i = 0; i < at.size(); ++i) {
      EXPECT_LT(std::abs(at[i].x), office().plan.extent.half_x - 0.4);
      for (const Occluder& box : office().scene.occluders)
        EXPECT_GT(flat_distance(at[i], box), 0.2)
            << "person " << i << " at " << at[i].x << ' ' << at[i].y << ", furniture at "
            << box.frame.origin.x << ' ' << box.frame.origin.y;
      for (std::size_t j = 0; j < i; ++j)
        EXPECT_GT(flat_distance(at[i], at[j]), 0.45) << i << ' ' << j << " at " << t;
    }
  }
}

TEST(SyntheticPeople, CameraKeepsItsDistanceFromPeopleAndFurniture) {
  const Crowd crowd(kMostPeople, false);
  for (const SyntheticMotion motion :
       {SyntheticMotion::kXyz, SyntheticMotion::kHalfsphere, SyntheticMotion::kStatic,
        SyntheticMotion::kRpy, SyntheticMotion::kLoop})
    for (std::uint64_t seed = 1; seed <= 3; ++seed) {
      const CameraPath path(motion, seed);
      const double duration = motion == SyntheticMotion::kLoop ? CameraPath::loop_duration_s() : 10;
      for (double t = 0; t < duration; t += 0.25) {
        const Vec3 camera = path.at(t).origin;
        for (const Vec3& p : places(crowd.at(t), kMostPeople))
          EXPECT_GT(flat_distance(p, camera), 0.55) << static_cast<int>(motion) << ' ' << t;
        for (const Occluder& box : office().scene.occluders)
          if (box.frame.origin.z + box.size.z > 0.9) {
            EXPECT_GT(flat_distance(camera, box), 0.12) << static_cast<int>(motion) << ' ' << t;
          }
      }
    }
}

TEST(SyntheticPeople, BodiesHangTogetherAndStandOnTheFloor) {
  const Crowd crowd(6, false, true);
  const Crowd seated(5, true);
  for (double t = 0; t < 6; t += 0.11)
    for (const Crowd* c : {&crowd, &seated}) {
      const MovingThings things = c->at(t);
      std::vector<double> lowest(8, 9), highest(8, 0);
      for (const RoundPart& part : things.parts) {
        // Each part touches another one of the same person.
        double gap = 9;
        for (const RoundPart& other : things.parts) {
          if (&other == &part || other.label != part.label) continue;
          for (int i = 0; i <= 10; ++i)
            for (int j = 0; j <= 10; ++j) {
              const Vec3 a = part.frame.to_world({0, 0, part.length * i / 10});
              const Vec3 b = other.frame.to_world({0, 0, other.length * j / 10});
              gap = std::min(gap, norm(a - b) - std::min(part.radius0, part.radius1) -
                                      std::min(other.radius0, other.radius1));
            }
        }
        EXPECT_LT(gap, 0.01) << "limb " << part.limb << " of person " << int(part.label);
        const auto i = static_cast<std::size_t>(part.label);
        for (const double z : {part.frame.origin.z - part.radius0,
                               part.frame.to_world({0, 0, part.length}).z - part.radius1})
          lowest[i] = std::min(lowest[i], z);
        highest[i] =
            std::max(highest[i], part.frame.to_world({0, 0, part.length}).z + part.radius1);
      }
      for (int i = 1; i <= c->people.count(); ++i) {
        EXPECT_GT(lowest[static_cast<std::size_t>(i)], -0.06) << "feet in the floor at " << t;
        EXPECT_LT(lowest[static_cast<std::size_t>(i)], 0.06) << "floating at " << t;
        EXPECT_GT(highest[static_cast<std::size_t>(i)], c == &crowd ? 1.5 : 1.1);
        EXPECT_LT(highest[static_cast<std::size_t>(i)], 1.95);
      }
    }
}

TEST(SyntheticPeople, OneFootStandsStillWhileTheOtherSwings) {
  const Crowd crowd(3, false);
  const double dt = 0.02;
  for (double t = 0; t < 4; t += 0.13) {
    const MovingThings a = crowd.at(t), b = crowd.at(t + dt);
    for (int label = 1; label <= 3; ++label) {
      double slowest = 9, body = 0;
      for (std::size_t i = 0; i < a.parts.size(); ++i) {
        if (a.parts[i].label != label) continue;
        const auto speed = [&](double z) {
          return norm(b.parts[i].frame.to_world({0, 0, z}) - a.parts[i].frame.to_world({0, 0, z})) /
                 dt;
        };
        if (a.parts[i].limb == kLeftLeg || a.parts[i].limb == kRightLeg)  // heel or toe
          slowest = std::min({slowest, speed(0), speed(a.parts[i].length)});
        if (a.parts[i].limb == kTorso) body = std::max(body, speed(0));
      }
      EXPECT_GT(body, 0.4);
      EXPECT_LT(body, 1.9);
      EXPECT_LT(slowest, 0.35) << "both feet slide at " << t;
    }
  }
}

TEST(SyntheticPeople, SeatedAndStandingOnesHardlyMove) {
  const Crowd crowd(6, true);
  const MovingThings a = crowd.at(0);
  for (double t = 0.5; t < 6; t += 0.5) {
    const MovingThings b = crowd.at(t);
    for (std::size_t i = 0; i < a.parts.size(); ++i)
      EXPECT_LT(norm(a.parts[i].frame.origin - b.parts[i].frame.origin), 0.2);
  }
}

TEST(SyntheticPeople, CarriedCartonBelongsToItsPerson) {
  const Crowd with(1, false, true), without(1, false, false);
  ASSERT_EQ(with.at(1).quads.size(), 6u);
  for (const Quad& quad : with.at(1).quads) EXPECT_EQ(quad.label, 1);
  EXPECT_TRUE(without.at(1).quads.empty());
}

TEST(SyntheticMovers, MoveSteadilyAndKeepClearOfPeopleAndCamera) {
  const Movers movers(office().plan, kMostMovers, kSeed), none(office().plan, 0, kSeed);
  const Crowd crowd(18, false, false, true);
  MovingThings last;
  movers.append(0, office().scene.textures, last);
  double way = 0;
  for (double t = 0.1; t < 20; t += 0.1) {
    MovingThings things, still;
    movers.append(t, office().scene.textures, things);
    none.append(t, office().scene.textures, still);
    for (const Quad& quad : still.quads) EXPECT_EQ(quad.label, 0) << "the door is closed";
    for (std::size_t i = 0; i < things.quads.size(); ++i) {
      const double step = norm(things.quads[i].point(1, 1) - last.quads[i].point(1, 1));
      EXPECT_LT(step, 0.18) << "jump at " << t;
      way += step;
      EXPECT_GE(things.quads[i].label, kFirstMoverLabel);
      for (const double u : {0.0, 0.5, 1.0}) {
        EXPECT_LT(things.quads[i].point(u, 1).y, -0.4);
        EXPECT_GT(things.quads[i].point(u, 1).y, -2.1);
      }
    }
    for (const Vec3& p : places(crowd.at(t), 18))
      for (const Quad& quad : things.quads) EXPECT_GT(flat_distance(p, quad.point(0.5, 0.5)), 0.3);
    last = things;
  }
  EXPECT_GT(way, 20);
}

TEST(SyntheticCamera, MotionsAreWhatTheirNamesSay) {
  struct Extent {
    double moved = 0, turned_deg = 0, fastest_m_s = 0, fastest_deg_s = 0;
  };
  const auto measure = [](SyntheticMotion motion, std::uint64_t seed, double duration) {
    const CameraPath path(motion, seed);
    Extent e;
    const double dt = 1 / 30.0;
    for (double t = dt; t < duration; t += dt) {
      const Frame f = path.at(t), before = path.at(t - dt), first = path.at(0);
      const auto angle = [](const Frame& a, const Frame& b) {
        const double trace = dot(a.x, b.x) + dot(a.y, b.y) + dot(a.z, b.z);
        return std::acos(std::min(1.0, (trace - 1) / 2)) * 180 / kPi;
      };
      e.moved = std::max(e.moved, norm(f.origin - first.origin));
      e.turned_deg = std::max(e.turned_deg, angle(f, first));
      e.fastest_m_s = std::max(e.fastest_m_s, norm(f.origin - before.origin) / dt);
      e.fastest_deg_s = std::max(e.fastest_deg_s, angle(f, before) / dt);
    }
    return e;
  };
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const Extent xyz = measure(SyntheticMotion::kXyz, seed, 7.5);
    EXPECT_GT(xyz.moved, 0.25);
    EXPECT_LT(xyz.moved, 0.95);
    EXPECT_LT(xyz.turned_deg, 7);
    EXPECT_LT(xyz.fastest_m_s, 1.0);
    const Extent half = measure(SyntheticMotion::kHalfsphere, seed, 7.5);
    EXPECT_GT(half.moved, 0.4);
    EXPECT_LT(half.moved, 1.2);
    EXPECT_GT(half.turned_deg, 8);
    const Extent still = measure(SyntheticMotion::kStatic, seed, 7.5);
    EXPECT_LT(still.moved, 0.02);
    EXPECT_LT(still.turned_deg, 1.5);
    EXPECT_GT(still.moved, 0.002);
    const Extent rpy = measure(SyntheticMotion::kRpy, seed, 7.5);
    EXPECT_LT(rpy.moved, 0.25);
    EXPECT_GT(rpy.fastest_deg_s, 35);
    EXPECT_LT(rpy.fastest_deg_s, 85);
    const Extent loop = measure(SyntheticMotion::kLoop, seed, CameraPath::loop_duration_s());
    EXPECT_GT(loop.moved, 6);
    EXPECT_LT(loop.fastest_m_s, 1.0);
    EXPECT_LT(loop.fastest_deg_s, 60);
  }
}

TEST(SyntheticCamera, LoopComesBackToWhereItBegan) {
  EXPECT_GT(CameraPath::loop().length(), 15);
  const CameraPath path(SyntheticMotion::kLoop, 2);
  const double lap = CameraPath::loop().length() / CameraPath::kLoopSpeed;
  const Frame first = path.at(0), again = path.at(lap);
  EXPECT_LT(norm(first.origin - again.origin), 0.15);
  EXPECT_GT(dot(first.z, again.z), 0.97);
}

TEST(SyntheticCamera, AxesAreOrthonormalAndRightHanded) {
  for (const std::string& name : synthetic_motion_names()) {
    const CameraPath path(synthetic_motion(name), 9);
    for (double t = 0; t < 5; t += 0.3) {
      const Eigen::Matrix3d R = to_isometry(path.at(t)).linear();
      EXPECT_LT((R * R.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-9) << name;
      EXPECT_NEAR(R.determinant(), 1, 1e-9) << name;
      EXPECT_LT(R(2, 1), -0.5) << "down is down in " << name;
    }
  }
}

TEST(SyntheticCamera, UnknownMotionIsAnErrorThatNamesTheChoices) {
  try {
    synthetic_motion("spiral");
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("halfsphere"), std::string::npos);
    EXPECT_NE(std::string(error.what()).find("spiral"), std::string::npos);
  }
}

}  // namespace
}  // namespace stillpoint::synthetic
