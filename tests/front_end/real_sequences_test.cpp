// SPDX-License-Identifier: BSD-2-Clause
// The front end without any network on real recordings.
#include <gtest/gtest.h>

#include <filesystem>
#include <opencv2/imgproc.hpp>
#include <string>

#include "stillpoint/front_end.hpp"
#include "stillpoint/io/mask_folder.hpp"
#include "stillpoint/io/tum_sequence.hpp"

namespace {

using namespace stillpoint;
namespace fs = std::filesystem;

class RealSequences : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!fs::is_directory(root_)) GTEST_SKIP() << "no shared data at " << root_;
  }

  const fs::path root_ = fs::path(STILLPOINT_SHARED_DATA) / "real";
};

TEST_F(RealSequences, NobodyMovesBeforeAFastKinect) {
  // Up to 261 degrees a second; by the poses of the color images 8 % of the image was dynamic.
  const TumSequence sequence(root_ / "fr1_rpy_fast");
  FrontEnd front_end(FrontEndSettings(), sequence.camera().value());
  double sum = 0;
  for (std::size_t i = 0; i < sequence.size(); ++i) {
    front_end.compute_mask(sequence.load(i), Segmentation());
    sum += front_end.stats().mask_share;
  }
  EXPECT_GT(sequence.size(), 80u);
  EXPECT_LE(sum / static_cast<double>(sequence.size()), 0.005);
}

TEST_F(RealSequences, DelayAndReadOutOfTheDepthAreFound) {
  // Nobody knows the true delay, but by how much a wrong stamp changes it. The read-out, which no
  // stamp changes, is on its way to some 30 ms.
  const TumSequence sequence(root_ / "fr1_rpy_fast");
  double found_s[2] = {0, 0}, readout_s[2] = {0, 0};
  for (const int early : {0, 1}) {
    FrontEnd front_end(FrontEndSettings(), sequence.camera().value());
    for (std::size_t i = 0; i < sequence.size(); ++i) {
      RgbdFrame frame = sequence.load(i);
      frame.depth_timestamp = frame.depth_time() - 0.02 * early;
      front_end.compute_mask(frame, Segmentation());
    }
    found_s[early] = front_end.stats().depth_delay_s;
    readout_s[early] = front_end.stats().depth_readout_s;
  }
  EXPECT_NEAR(found_s[0], -0.012, 0.01);
  EXPECT_NEAR(found_s[1] - found_s[0], 0.02, 0.006);
  EXPECT_NEAR(readout_s[0], 0.02, 0.008);
  EXPECT_NEAR(readout_s[1], readout_s[0], 0.003);
}

TEST_F(RealSequences, AFalsePersonAllOverADeskIsNotBelieved) {
  // Detectors see one in blurred images; this one insists on it, six results in a row.
  const TumSequence sequence(root_ / "fr1_rpy_fast");
  FrontEnd front_end(FrontEndSettings(), sequence.camera().value());
  double sum = 0;
  int doubted = 0;
  for (std::size_t i = 0; i < sequence.size(); ++i) {
    Segmentation found;
    found.available = true;
    if (i % 12 >= 6) {
      found.instances.emplace_back();
      found.instances[0].class_name = "person";
      found.instances[0].box = cv::Rect(20, 10, 600, 460);
    }
    front_end.compute_mask(sequence.load(i), found);
    sum += front_end.stats().mask_share;
    doubted += (front_end.stats().status & kObjectDoubted) != 0;
  }
  EXPECT_GT(doubted, 40);
  EXPECT_LE(sum / static_cast<double>(sequence.size()), 0.02);
}

TEST_F(RealSequences, PeopleBeforeAStillXtionAreFound) {
  const fs::path folder = root_ / "confusao";
  const TumSequence sequence(folder);
  FrontEnd front_end(FrontEndSettings(), sequence.camera().value());
  double hit = 0, missed = 0, wrong = 0;
  for (std::size_t i = 0; i < sequence.size(); ++i) {
    const RgbdFrame frame = sequence.load(i);
    const cv::Mat found = front_end.compute_mask(frame, Segmentation()).image;
    if (i < 4) continue;
    const cv::Mat truth =
        read_mask(mask_path(folder / "masks_gt", sequence.entry(i).stem), frame.color.size());
    const cv::Mat measured = frame.depth > 0;
    cv::Mat near;
    cv::dilate(truth, near, cv::Mat::ones(41, 41, CV_8UC1));
    hit += cv::countNonZero(found & truth & measured);
    missed += cv::countNonZero(~found & truth & measured);
    const int false_px = cv::countNonZero(found & ~near & measured);
    wrong += false_px;
    EXPECT_LT(false_px, 0.1 * frame.color.total()) << i;
  }
  EXPECT_GT(hit / (hit + missed), 0.90);
  EXPECT_GT(hit / (hit + wrong), 0.98);
}

}  // namespace
