// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/evaluation/bootstrap.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "../io/temporary_folder.hpp"

namespace {

using stillpoint::median_interval;

TEST(Bootstrap, HoldsTheMedianAndNarrowsWithMoreRuns) {
  stillpoint::RandomGenerator random(3);
  std::vector<double> few, many;
  for (int i = 0; i < 401; ++i) {
    many.push_back(random.uniform());
    if (i < 9) few.push_back(many.back());
  }
  const auto wide = median_interval(few), narrow = median_interval(many);
  EXPECT_LT(narrow.low, 0.5);
  EXPECT_GT(narrow.high, 0.5);
  // The median of n uniform numbers has a standard deviation of 1 / (2 sqrt(n)).
  EXPECT_NEAR(narrow.high - narrow.low, 2 * 1.96 / (2 * std::sqrt(401.0)), 0.03);
  EXPECT_GT(wide.high - wide.low, 2 * (narrow.high - narrow.low));
}

// By hand: of two values the median of a draw is the smaller (1/4), the mean (1/2), the larger.
TEST(Bootstrap, OfTwoRunsIsTheirRange) {
  const auto both = median_interval({1, 2});
  EXPECT_DOUBLE_EQ(both.low, 1);
  EXPECT_DOUBLE_EQ(both.high, 2);
  const auto middle = median_interval({1, 2}, 0.3);
  EXPECT_DOUBLE_EQ(middle.low, 1.5);
  EXPECT_DOUBLE_EQ(middle.high, 1.5);
}

TEST(Bootstrap, IsTheSameEveryTimeAndDependsOnNoOrder) {
  const auto once = median_interval({3, 1, 4, 1.5, 9, 2.6});
  const auto again = median_interval({3, 1, 4, 1.5, 9, 2.6});
  EXPECT_EQ(once.low, again.low);
  EXPECT_EQ(once.high, again.high);
  EXPECT_GE(once.low, 1);
  EXPECT_LE(once.high, 9);
}

TEST(Bootstrap, SaysNothingOfOneRunAndRefusesWhatCannotBe) {
  EXPECT_TRUE(std::isnan(median_interval({1}).low));
  EXPECT_TRUE(std::isnan(median_interval({}).high));
  EXPECT_ERROR(median_interval({1, 2}, 1.5), "between 0 and 1", "1.5");
  EXPECT_ERROR(median_interval({1, std::numeric_limits<double>::quiet_NaN()}), "finite");
}

}  // namespace
