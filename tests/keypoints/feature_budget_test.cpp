// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/keypoints/feature_budget.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "../io/temporary_folder.hpp"

namespace {

using stillpoint::FeatureBudget;

TEST(FeatureBudget, AsksForMoreWhereLessIsStatic) {
  FeatureBudget budget;
  EXPECT_EQ(budget.features_for(1000, 5000), 1000) << "nothing seen";
  budget.add(1000, 1000);
  EXPECT_EQ(budget.features_for(1000, 5000), 1000);
  budget.add(1000, 400);
  EXPECT_EQ(budget.features_for(1000, 5000), 2500);
  budget.add(3000, 2000);
  EXPECT_EQ(budget.features_for(1000, 5000), 2500) << "the worst frame counts";
  EXPECT_EQ(budget.features_for(1000, 2000), 2000);
  for (std::size_t i = 0; i < FeatureBudget::kFrames; ++i) budget.add(1000, 900);
  EXPECT_EQ(budget.features_for(900, 5000), 1000) << "a second later it is forgotten";
}

TEST(FeatureBudget, RemembersTheSameTimeAtAnyRate) {
  for (const double rate_hz : {1.0, 10.0, 30.0, 60.0, 90.0, 1000.0}) {
    FeatureBudget budget;
    const double start_s = 1.6e9;
    int step = 0;
    const auto add = [&](int kept) { budget.add(1000, kept, start_s + step++ / rate_hz); };
    for (int i = 0; i < 10 * rate_hz; ++i) add(900);
    EXPECT_EQ(budget.features_for(900, 5000), 1000) << rate_hz;
    add(400);
    const int bad = step - 1;
    while (step - bad < 0.95 * rate_hz) {
      EXPECT_EQ(budget.features_for(1000, 5000), 2500) << rate_hz << " Hz, frame " << step - bad;
      add(900);
    }
    while (step - bad <= rate_hz) add(900);
    EXPECT_EQ(budget.features_for(900, 5000), 1000) << rate_hz << " Hz: a second later";
  }
}

TEST(FeatureBudget, StartsAnewWhenTimeGoesBack) {
  FeatureBudget budget;
  budget.add(1000, 400, 100);
  budget.add(1000, 900, 100);
  budget.add(1000, 900, 99.9);
  EXPECT_EQ(budget.features_for(1000, 5000), 2500) << "twice the same frame, and a late one";
  budget.add(1000, 900, 5);
  EXPECT_EQ(budget.features_for(900, 5000), 1000);
  EXPECT_ERROR(budget.add(1000, 400, std::nan("")), "timestamp", "expected seconds", "nan");
  EXPECT_EQ(budget.features_for(900, 5000), 1000);
}

TEST(FeatureBudget, SurvivesEmptyFrames) {
  FeatureBudget budget;
  budget.add(0, 0);
  EXPECT_EQ(budget.features_for(1000, 5000), 1000);
  budget.add(500, 0);
  EXPECT_EQ(budget.features_for(1000, 5000), 5000) << "nothing left: all that is allowed";
  EXPECT_ERROR(budget.features_for(0, 10), "0 < wanted", "found wanted 0");
  EXPECT_ERROR(budget.features_for(11, 10), "most 10");
}

}  // namespace
