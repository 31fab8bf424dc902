// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/evaluation/associate.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <random>
#include <set>
#include <tuple>

namespace {

using stillpoint::associate;

using Pairs = std::vector<std::pair<std::size_t, std::size_t>>;

Pairs as_pairs(const std::vector<stillpoint::TimestampPair>& pairs) {
  Pairs out;
  for (const auto& p : pairs) out.emplace_back(p.first, p.second);
  return out;
}

// The benchmark's rule, written down as it stands: all pairs, sorted, taken greedily.
Pairs slow(const std::vector<double>& a, const std::vector<double>& b, double limit) {
  std::vector<std::tuple<double, double, double, std::size_t, std::size_t>> all;
  for (std::size_t i = 0; i < a.size(); ++i)
    for (std::size_t j = 0; j < b.size(); ++j)
      if (std::abs(a[i] - b[j]) < limit) all.emplace_back(std::abs(a[i] - b[j]), a[i], b[j], i, j);
  std::sort(all.begin(), all.end());
  std::set<std::size_t> used_a, used_b;
  Pairs out;
  for (const auto& [d, ta, tb, i, j] : all) {
    if (used_a.count(i) || used_b.count(j)) continue;
    used_a.insert(i), used_b.insert(j);
    out.emplace_back(i, j);
  }
  std::sort(out.begin(), out.end(), [&](const auto& x, const auto& y) {
    return std::make_pair(a[x.first], x.first) < std::make_pair(a[y.first], y.first);
  });
  return out;
}

TEST(Associate, TakesTheNearestPairFirst) {
  // 1.000 is nearer to 1.010 than 1.025 is, so 1.025 goes without.
  EXPECT_EQ(as_pairs(associate({1.000, 1.025}, {1.010}, 0.02)), (Pairs{{0, 0}}));
  EXPECT_EQ(as_pairs(associate({1.000, 1.012}, {1.010}, 0.02)), (Pairs{{1, 0}}));
}

TEST(Associate, UsesEachTimestampOnce) {
  // After 2.0 took 2.001, 1.99 falls back on 1.985.
  EXPECT_EQ(as_pairs(associate({1.99, 2.0}, {2.001, 1.985}, 0.02)), (Pairs{{0, 1}, {1, 0}}));
}

TEST(Associate, LeavesOutWhatIsTooFarApart) {
  EXPECT_TRUE(associate({1, 2, 3}, {1.5, 2.5}, 0.02).empty());
  EXPECT_TRUE(associate({}, {1.0}).empty());
  EXPECT_TRUE(associate({1.0}, {}).empty());
  EXPECT_TRUE(associate({0.0}, {0.5}, 0.5).empty());  // strictly less, as in the benchmark
}

TEST(Associate, EqualsTheSlowRule) {
  std::mt19937 random(7);
  for (int trial = 0; trial < 300; ++trial) {
    std::vector<double> a(random() % 40), b(random() % 40);
    // Whole thousandths as doubles of exact halves, so that ties are exact and frequent.
    for (double& t : a) t = static_cast<double>(random() % 512) / 1024;
    for (double& t : b) t = static_cast<double>(random() % 512) / 1024;
    const double limit = static_cast<double>(random() % 64) / 1024;
    const Pairs fast = as_pairs(associate(a, b, limit)), expected = slow(a, b, limit);
    // As times: among repeated timestamps it is open which one is whose partner.
    const auto as_times = [&](const Pairs& pairs) {
      std::vector<std::pair<double, double>> out;
      for (const auto& p : pairs) out.emplace_back(a[p.first], b[p.second]);
      std::sort(out.begin(), out.end());
      return out;
    };
    ASSERT_EQ(as_times(fast), as_times(expected)) << "trial " << trial;
  }
}

TEST(Associate, RefusesNaN) {
  EXPECT_THROW(associate({1.0, std::numeric_limits<double>::quiet_NaN()}, {1.0}),
               stillpoint::Error);
  EXPECT_THROW(associate({1.0}, {std::numeric_limits<double>::infinity()}), stillpoint::Error);
}

TEST(Associate, StaysFastWhenEverythingIsNearEverything) {
  std::vector<double> a(100000, 0.0), b(100000, 0.001);
  EXPECT_EQ(associate(a, b, 0.02).size(), a.size());
}

}  // namespace
