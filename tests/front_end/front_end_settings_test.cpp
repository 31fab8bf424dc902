// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/front_end_settings.hpp"

#include <gtest/gtest.h>

namespace stillpoint {
namespace {

TEST(FrontEndSettings, TheBestIsTheDefault) {
  const FrontEndSettings settings;
  EXPECT_TRUE(settings.use_motion && settings.use_compensation && settings.use_depth &&
              settings.use_probability);
  EXPECT_EQ(settings.depth.cell_px, 5);
  EXPECT_EQ(settings.depth.dilation_per_blur_px, 0.5);
  EXPECT_EQ(DepthMaskFuserSettings().cell_px, 5) << "a component alone is no worse";
}

TEST(FrontEndSettings, NetworkOnlyAndPaperLeaveTheMotionCheckOut) {
  const FrontEndSettings network_only = FrontEndSettings::network_only();
  EXPECT_FALSE(network_only.use_motion);
  EXPECT_EQ(network_only.depth.cell_px, 6);
  EXPECT_EQ(network_only.depth.dilation_per_blur_px, 0);
  const FrontEndSettings paper = FrontEndSettings::paper();
  EXPECT_FALSE(paper.use_motion);
  EXPECT_EQ(paper.depth.method, DepthMaskFuserSettings::Method::kPaper);
  EXPECT_EQ(paper.depth.dilation_per_blur_px, 0);
}

TEST(FrontEndSettings, APresetHasAName) {
  EXPECT_TRUE(FrontEndSettings::preset("default").use_motion);
  EXPECT_EQ(FrontEndSettings::preset("network_only").depth.cell_px, 6);
  EXPECT_EQ(FrontEndSettings::preset("paper").depth.method, DepthMaskFuserSettings::Method::kPaper);
  try {
    FrontEndSettings::preset("motion");
    FAIL() << "expected an Error";
  } catch (const Error& error) {
    const std::string text = error.what();
    EXPECT_NE(text.find("default, network_only or paper, found \"motion\""), std::string::npos);
  }
}

#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wdeprecated-declarations"
#endif
TEST(FrontEndSettings, TheOldNameIsTheDefault) {
  const FrontEndSettings settings = FrontEndSettings::with_motion();
  EXPECT_TRUE(settings.use_motion);
  EXPECT_EQ(settings.depth.cell_px, 5);
}

}  // namespace
}  // namespace stillpoint
