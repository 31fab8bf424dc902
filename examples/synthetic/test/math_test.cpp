// SPDX-License-Identifier: BSD-2-Clause
#include "synthetic/math.hpp"

#include <gtest/gtest.h>

#include <set>

namespace stillpoint::synthetic {
namespace {

TEST(SyntheticMath, SineAgreesWithTheLibrarys) {
  for (int i = -2000; i <= 2000; ++i) {
    const double x = i * 0.037;
    EXPECT_NEAR(sine(x), std::sin(x), 1e-10) << x;
    EXPECT_NEAR(cosine(x), std::cos(x), 1e-10) << x;
  }
}

TEST(SyntheticMath, AngleAgreesWithTheLibrarysInAllQuadrants) {
  for (int i = -99; i <= 99; ++i) {
    const double a = i / 100.0 * kPi;
    EXPECT_NEAR(angle_in_turns(static_cast<float>(std::sin(a)), static_cast<float>(std::cos(a))),
                a / (2 * kPi), 1e-4)
        << a;
  }
  EXPECT_EQ(angle_in_turns(0, 0), 0);
}

TEST(SyntheticMath, RoughLogarithmIsNear) {
  for (float x = 0.01f; x < 1000; x *= 1.07f) EXPECT_NEAR(rough_log2(x), std::log2(x), 0.09f);
}

TEST(SyntheticMath, HashesDifferInEveryArgument) {
  std::set<std::uint64_t> seen;
  for (std::uint64_t a = 0; a < 10; ++a)
    for (std::uint64_t b = 0; b < 10; ++b)
      for (std::uint64_t c = 0; c < 10; ++c) seen.insert(hash(a, b, c));
  EXPECT_EQ(seen.size(), 1000u);
}

TEST(SyntheticMath, NumbersHaveTheirDistribution) {
  double sum = 0, square = 0, mean = 0;
  constexpr int kCount = 40000;
  for (std::uint64_t i = 0; i < kCount; ++i) {
    const double g = gaussian(hash(7, i));
    sum += g, square += g * g;
    const double u = uniform(hash(8, i));
    ASSERT_GE(u, 0);
    ASSERT_LT(u, 1);
    mean += u / kCount;
  }
  EXPECT_NEAR(sum / kCount, 0, 0.02);
  EXPECT_NEAR(square / kCount, 1, 0.03);
  EXPECT_NEAR(mean, 0.5, 0.01);
  Random random(3);
  for (int i = 0; i < 1000; ++i) {
    const int n = random.below(7);
    ASSERT_GE(n, 0);
    ASSERT_LT(n, 7);
  }
}

TEST(SyntheticMath, NoiseIsSmoothAndRepeatsAfterItsPeriod) {
  for (int i = 0; i < 200; ++i) {
    const float x = static_cast<float>(i) * 0.173f, y = static_cast<float>(i) * 0.211f;
    const float n = value_noise(x, y, 8, 4, 5);
    EXPECT_GE(n, 0);
    EXPECT_LE(n, 1);
    EXPECT_NEAR(n, value_noise(x + 8, y + 4, 8, 4, 5), 1e-4f);
    EXPECT_NEAR(n, value_noise(x + 0.001f, y, 8, 4, 5), 0.01f);
  }
}

TEST(SyntheticMath, FramesTurnBackAndForth) {
  Frame f;
  f.x = {0, 1, 0}, f.y = {-1, 0, 0}, f.origin = {1, 2, 3};
  const Vec3 p = f.to_local(f.to_world({4, 5, 6}));
  EXPECT_NEAR(p.x, 4, 1e-12);
  EXPECT_NEAR(p.y, 5, 1e-12);
  EXPECT_NEAR(p.z, 6, 1e-12);
}

}  // namespace
}  // namespace stillpoint::synthetic
