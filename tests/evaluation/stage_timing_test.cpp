// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/evaluation/stage_timing.hpp"

#include <gtest/gtest.h>

namespace {

TEST(StageTiming, SummarisesEachStage) {
  stillpoint::StageTiming timing;
  for (int i = 100; i >= 1; --i) timing.add("fusion", i);
  timing.add("compensation", 3);
  EXPECT_EQ(timing.stages(), (std::vector<std::string>{"fusion", "compensation"}));
  const auto s = timing.summary("fusion");
  EXPECT_EQ(s.count, 100u);
  EXPECT_DOUBLE_EQ(s.mean_ms, 50.5);
  EXPECT_DOUBLE_EQ(s.median_ms, 50.5);
  EXPECT_DOUBLE_EQ(s.p95_ms, 95);
  EXPECT_DOUBLE_EQ(s.max_ms, 100);
  const auto one = timing.summary("compensation");
  EXPECT_DOUBLE_EQ(one.median_ms, 3);
  EXPECT_DOUBLE_EQ(one.p95_ms, 3);
}

TEST(StageTiming, AnUnknownStageHasNoSamples) {
  const auto s = stillpoint::StageTiming().summary("none");
  EXPECT_EQ(s.count, 0u);
  EXPECT_TRUE(s.median_ms != s.median_ms);
}

}  // namespace
