// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/evaluation/object_metrics.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "stillpoint/core/random.hpp"

namespace stillpoint {
namespace {

ObjectPlace at(int id, double x, double vx = 0) {
  ObjectPlace place;
  place.id = id;
  place.position_m.x() = x;
  place.velocity_m_s.x() = vx;
  return place;
}

TEST(Assignment, CostsNoMoreThanAnyOther) {
  RandomGenerator random(1);
  for (int trial = 0; trial < 300; ++trial) {
    const int rows = 1 + static_cast<int>(4 * random.uniform());
    const int columns = 1 + static_cast<int>(4 * random.uniform());
    Eigen::MatrixXd cost(rows, columns);
    for (int r = 0; r < rows; ++r)
      for (int c = 0; c < columns; ++c) cost(r, c) = std::floor(10 * random.uniform());
    const std::vector<int> found = least_cost_assignment(cost);
    ASSERT_EQ(found.size(), static_cast<std::size_t>(rows));
    double sum = 0;
    std::vector<int> used(static_cast<std::size_t>(columns), 0);
    int assigned = 0;
    for (int r = 0; r < rows; ++r)
      if (const int c = found[static_cast<std::size_t>(r)]; c >= 0)
        sum += cost(r, c), ++used[static_cast<std::size_t>(c)], ++assigned;
    EXPECT_EQ(assigned, std::min(rows, columns));
    for (const int n : used) EXPECT_LE(n, 1);
    // Against all permutations of the longer side.
    const int most = std::max(rows, columns);
    std::vector<int> order(static_cast<std::size_t>(most));
    std::iota(order.begin(), order.end(), 0);
    double least = 1e9;
    do {
      double s = 0;
      for (int r = 0; r < rows; ++r)
        for (int c = 0; c < columns; ++c)
          if (rows <= columns ? order[static_cast<std::size_t>(r)] == c
                              : order[static_cast<std::size_t>(c)] == r)
            s += cost(r, c);
      least = std::min(least, s);
    } while (std::next_permutation(order.begin(), order.end()));
    EXPECT_DOUBLE_EQ(sum, least);
  }
}

TEST(ObjectMetrics, CountsByTheDefinition) {
  // Three frames of two objects: both found; one missed and something found where nothing is; and
  // the first with another id. Written out: 6 true ones, 1 miss, 1 false positive, 1 switch.
  ObjectMetrics metrics(1);
  metrics.add({at(1, 0, 1), at(2, 5)}, {at(10, 0.3, 1.5), at(11, 5)});
  metrics.add({at(1, 0, 1), at(2, 5)}, {at(10, 0.3, 1.5), at(12, 9)});
  metrics.add({at(1, 0, 1), at(2, 5)}, {at(13, 0.6, 1), at(11, 5)});
  EXPECT_EQ(metrics.truths(), 6);
  EXPECT_EQ(metrics.misses(), 1);
  EXPECT_EQ(metrics.false_positives(), 1);
  EXPECT_EQ(metrics.id_switches(), 1);
  EXPECT_DOUBLE_EQ(metrics.mota(), 1 - 3 / 6.0);
  EXPECT_DOUBLE_EQ(metrics.motp_m(), (0.3 + 0 + 0.3 + 0.6 + 0) / 5);
  EXPECT_DOUBLE_EQ(metrics.coverage(), 5 / 6.0);
  EXPECT_DOUBLE_EQ(metrics.position_rmse_m(), std::sqrt((0.09 + 0.09 + 0.36) / 5));
  EXPECT_DOUBLE_EQ(metrics.velocity_rmse_m_s(), std::sqrt(0.5 / 5));
}

TEST(ObjectMetrics, AMatchThatHoldsIsKept) {
  // Another one comes nearer: the first stays the match as long as it is in reach.
  ObjectMetrics metrics(1);
  metrics.add({at(1, 0)}, {at(10, 0.2)});
  metrics.add({at(1, 0)}, {at(11, 0.1), at(10, 0.8)});
  EXPECT_EQ(metrics.id_switches(), 0);
  EXPECT_EQ(metrics.false_positives(), 1);
  metrics.add({at(1, 0)}, {at(11, 0.1), at(10, 1.2)});
  EXPECT_EQ(metrics.id_switches(), 1);
  // A miss in between does not hide a switch.
  metrics.add({at(1, 0)}, {});
  metrics.add({at(1, 0)}, {at(12, 0)});
  EXPECT_EQ(metrics.id_switches(), 2);
}

TEST(ObjectMetrics, AsManyAsPossibleAreMatched) {
  // The nearest pair first would leave one of each alone.
  ObjectMetrics metrics(1);
  metrics.add({at(1, 0), at(2, 0.9)}, {at(10, 0.8), at(11, 1.8)});
  EXPECT_EQ(metrics.matches(), 2);
}

TEST(ObjectMetrics, WhatIsHardlyToBeSeenDoesNotCount) {
  ObjectPlace hidden = at(1, 0);
  hidden.ignored = true;
  ObjectMetrics metrics;
  metrics.add({hidden}, {});
  metrics.add({hidden}, {at(10, 0)});
  EXPECT_EQ(metrics.truths() + metrics.false_positives(), 0);
  EXPECT_TRUE(std::isnan(metrics.mota()) && std::isnan(metrics.motp_m()));
  metrics.add({at(1, 0)}, {at(11, 0)});
  EXPECT_EQ(metrics.id_switches(), 1) << "the id before it was seen well counts";
}

TEST(ObjectMetrics, SaysWhatIsWrong) {
  EXPECT_THROW(ObjectMetrics(0), Error);
  EXPECT_THROW(ObjectMetrics(std::nan("")), Error);
  ObjectMetrics metrics;
  EXPECT_THROW(metrics.add({}, {at(1, std::nan(""))}), Error);
}

}  // namespace
}  // namespace stillpoint
