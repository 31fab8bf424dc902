// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/core/random.hpp"

#include <gtest/gtest.h>

#include <array>

namespace {

using stillpoint::RandomGenerator;

TEST(RandomGenerator, GivesSplitMix64sPublishedNumbers) {
  RandomGenerator random(1234567);
  for (const std::uint64_t expected :
       {6457827717110365317ull, 3203168211198807973ull, 9817491932198370423ull,
        4593380528125082431ull, 16408922859458223821ull})
    EXPECT_EQ(random.next(), expected);
}

TEST(RandomGenerator, DrawsEvenlyBelowN) {
  RandomGenerator random(1);
  std::array<int, 7> count{};
  for (int i = 0; i < 70000; ++i) ++count.at(random.below(7));
  for (int c : count) EXPECT_NEAR(c, 10000, 500);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(random.below(1), 0u);
}

TEST(RandomGenerator, DrawsFromZeroToOne) {
  RandomGenerator random(2);
  double sum = 0;
  for (int i = 0; i < 10000; ++i) {
    const double u = random.uniform();
    ASSERT_GE(u, 0);
    ASSERT_LT(u, 1);
    sum += u;
  }
  EXPECT_NEAR(sum / 10000, 0.5, 0.02);
}

}  // namespace
