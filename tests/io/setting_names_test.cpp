// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/io/setting_names.hpp"

#include <gtest/gtest.h>

#include "temporary_folder.hpp"

namespace {

using namespace stillpoint;

TEST(SettingNames, SetByPathOrByALastNameThatOnlyOneHas) {
  FrontEndSettings settings;
  set_setting(settings, "depth.dilation_px", "3");
  EXPECT_EQ(settings.depth.dilation_px, 3);
  set_setting(settings, "dilation_px", "4");
  EXPECT_EQ(settings.depth.dilation_px, 4);
  set_setting(settings, "use_motion", "true");
  EXPECT_TRUE(settings.use_motion);
  set_setting(settings, "use_depth", "0");  // the stage, not compensation.use_depth
  EXPECT_FALSE(settings.use_depth);
  EXPECT_TRUE(settings.compensation.use_depth);
  set_setting(settings, "trigger", "global");
  EXPECT_EQ(settings.compensation.trigger, SegmentationCompensatorSettings::Trigger::kGlobal);
  set_setting(settings, "depth.method", "paper");
  EXPECT_EQ(settings.depth.method, DepthMaskFuserSettings::Method::kPaper);
}

TEST(SettingNames, RefuseWhatIsNone) {
  FrontEndSettings settings;
  EXPECT_ERROR(set_setting(settings, "dilaton_px", "3"), "nearest is depth.dilation_px");
  EXPECT_ERROR(set_setting(settings, "growth_m", "3"), "depth.growth_m", "motion.movers.growth_m");
  EXPECT_ERROR(set_setting(settings, "dilation_px", "2.5"), "whole number", "2.5");
  EXPECT_ERROR(set_setting(settings, "dilation_px", ""), "a number");
  EXPECT_ERROR(set_setting(settings, "seed", "-1"), "at least 0");
  EXPECT_ERROR(set_setting(settings, "use_motion", "2"), "true or false");
  EXPECT_ERROR(set_setting(settings, "method", "literal"), "paper or connected", "literal");
}

TEST(SettingNames, ValuesAreTakenBack) {
  FrontEndSettings settings = FrontEndSettings::paper();
  settings.sensor = SensorModel::realsense_d400();
  settings.probability.threshold = 0.1f + 0.2f;
  settings.large_mask_share = 1.0 / 3;
  FrontEndSettings again;
  for (const auto& [path, value] : setting_values(settings)) set_setting(again, path, value);
  EXPECT_EQ(setting_values(again), setting_values(settings));
  EXPECT_EQ(again.probability.threshold, settings.probability.threshold);
  EXPECT_EQ(again.large_mask_share, settings.large_mask_share);
  EXPECT_EQ(again.compensation.trigger, settings.compensation.trigger);
}

}  // namespace
