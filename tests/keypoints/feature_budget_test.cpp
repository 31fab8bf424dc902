// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/keypoints/feature_budget.hpp"

#include <gtest/gtest.h>

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
