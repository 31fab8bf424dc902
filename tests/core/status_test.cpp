// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/core/status.hpp"

#include <gtest/gtest.h>

namespace {

using namespace stillpoint;
using Names = std::vector<std::string>;

TEST(FrameStatus, NamesEachBit) {
  EXPECT_EQ(status_names(kOk), Names());
  EXPECT_EQ(status_names(kNoSegmentation | kRestored), (Names{"no_segmentation", "restored"}));
  EXPECT_EQ(status_names(kNeverSegmented), Names{"never_segmented"});
  EXPECT_EQ(status_names(kMaskStale), Names{"mask_stale"});
  EXPECT_EQ(status_names(kMaskTooLarge), Names{"mask_too_large"});
  EXPECT_EQ(status_names(kNoDepth), Names{"no_depth"});
  EXPECT_EQ(status_names(kNoKeypoints), Names{"no_keypoints"});
  EXPECT_EQ(status_names(kKeypointFloor), Names{"keypoint_floor"});
  EXPECT_EQ(status_names(kSegmenterFailed), Names{"segmenter_failed"});
  EXPECT_EQ(status_names(kTimestampOrder), Names{"timestamp_order"});
}

}  // namespace
