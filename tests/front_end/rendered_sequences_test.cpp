// SPDX-License-Identifier: BSD-2-Clause
// Quality of the masks on rendered sequences with a real network's masks and exact ones.
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "stillpoint/evaluation/mask_metrics.hpp"
#include "stillpoint/front_end.hpp"
#include "stillpoint/io/mask_folder.hpp"
#include "stillpoint/io/tum_sequence.hpp"

namespace {

using namespace stillpoint;
namespace fs = std::filesystem;

class RenderedSequences : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!fs::is_directory(root_)) GTEST_SKIP() << "no shared data at " << root_;
  }

  // Masks before dilation against the exact ones, over all frames.
  MaskMetrics run(const std::string& name, const std::string& masks,
                  const FrontEndSettings& settings) const {
    const TumSequence sequence(root_ / name);
    FrontEnd front_end(settings, sequence.camera().value());
    MaskMetrics metrics;
    for (std::size_t i = 0; i < sequence.size(); ++i) {
      const SequenceEntry& entry = sequence.entry(i);
      RgbdFrame frame;
      frame.timestamp = entry.timestamp;
      frame.depth_units_per_m = sequence.camera()->depth_units_per_m;
      frame.depth = read_depth(entry.depth_path);
      // With depth the masks do not depend on the colors: a black image saves the reading.
      frame.color = cv::Mat::zeros(frame.depth.size(), CV_8UC1);
      const cv::Size size = frame.color.size();
      Segmentation given;
      const fs::path file = mask_path(root_ / name / masks, entry.stem);
      given.available = fs::exists(file);
      if (given.available) given.instances = instances_from_labels(read_labels(file, size));
      front_end.compute_mask(frame, given);
      metrics.add(compare_masks(front_end.undilated_mask(),
                                read_mask(mask_path(root_ / name / "masks_gt", entry.stem), size)));
    }
    EXPECT_GE(metrics.frames(), 200u);
    return metrics;
  }

  const fs::path root_ = fs::path(STILLPOINT_SHARED_DATA) / "rendered";
};

TEST_F(RenderedSequences, NetworkOnlyRaisesRecallAndKeepsIou) {
  const MaskMetrics metrics = run("walking_xyz", "masks", FrontEndSettings::network_only());
  // The network's own masks: recall 0.93, IoU 0.82.
  EXPECT_GE(metrics.mean_recall(), 0.96);
  EXPECT_GE(metrics.mean_iou(), 0.82);
}

TEST_F(RenderedSequences, PaperFusionIsThePublishedOne) {
  FrontEndSettings settings = FrontEndSettings::paper();
  settings.use_compensation = false;
  const MaskMetrics metrics = run("walking_xyz", "masks", settings);
  EXPECT_NEAR(metrics.mean_iou(), 0.70, 0.02);
  EXPECT_NEAR(metrics.mean_recall(), 0.93, 0.02);
  EXPECT_NEAR(metrics.mean_precision(), 0.74, 0.02);
}

TEST_F(RenderedSequences, NetworkOnlyHoldsInACrowdBeforeATurningCamera) {
  const MaskMetrics metrics = run("crowd_rpy", "masks", FrontEndSettings::network_only());
  EXPECT_GE(metrics.pixels().recall(), 0.93);
  EXPECT_GE(metrics.pixels().precision(), 0.86);
}

TEST_F(RenderedSequences, NetworkOnlyBridgesWhatIsMissing) {
  // Spells of one to five frames without a result, and a segmenter at 4 Hz. The network's masks
  // alone have recalls of 0.66 and 0.11 there.
  const MaskMetrics blink = run("crowd_rpy", "masks_blink", FrontEndSettings::network_only());
  EXPECT_GE(blink.pixels().recall(), 0.90);
  EXPECT_GE(blink.pixels().precision(), 0.85);
  const MaskMetrics rare = run("crowd_rpy", "masks_4hz", FrontEndSettings::network_only());
  EXPECT_GE(rare.pixels().recall(), 0.85);
  EXPECT_GE(rare.pixels().precision(), 0.85);
}

}  // namespace
