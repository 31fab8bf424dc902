// SPDX-License-Identifier: BSD-2-Clause
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <stillpoint/backends/mask_files.hpp>
#include <stillpoint/testing/segmenter_conformance.hpp>
#include <vector>

#include "../../tests/io/temporary_folder.hpp"

namespace {

using stillpoint::FrameName;
using stillpoint::MaskFilesSegmenter;
using stillpoint::RgbdFrame;
using stillpoint::Segmentation;

const cv::Size kSize(40, 30);

RgbdFrame frame_at(double timestamp) {
  RgbdFrame frame;
  frame.color = cv::Mat::zeros(kSize, CV_8UC3);
  frame.timestamp = timestamp;
  return frame;
}

void write_mask(const TemporaryFolder& folder, const std::string& stem, int value) {
  cv::Mat labels = cv::Mat::zeros(kSize, CV_8UC1);
  labels(cv::Rect(3, 4, 10, 12)) = value;
  stillpoint::write_image(folder / (stem + ".png"), labels);
}

const std::vector<FrameName> kFrames{
    {1341846313.592026, "a"}, {1341846313.625, "b"}, {1341846313.658, "c"}};

TEST(MaskFiles, FindsTheMaskOfAFrameByItsStem) {
  TemporaryFolder folder;
  write_mask(folder, "a", 3);
  write_mask(folder, "c", 0);
  MaskFilesSegmenter segmenter(folder.path(), kFrames);
  EXPECT_EQ(segmenter.masks(), 2u);

  const Segmentation seen = segmenter.segment(frame_at(1341846313.592026));
  EXPECT_TRUE(seen.available);
  EXPECT_DOUBLE_EQ(seen.timestamp, 1341846313.592026);
  ASSERT_EQ(seen.instances.size(), 1u);
  EXPECT_EQ(seen.instances[0].box, cv::Rect(3, 4, 10, 12));
  EXPECT_EQ(seen.instances[0].class_name, "person");
  EXPECT_EQ(segmenter.classes(), std::vector<std::string>{"person"});
  EXPECT_NO_THROW(check_segmentation(seen, kSize));

  EXPECT_FALSE(segmenter.segment(frame_at(1341846313.625)).available) << "no file: no result";
  const Segmentation nobody = segmenter.segment(frame_at(1341846313.658));
  EXPECT_TRUE(nobody.available) << "an empty image: segmented, nobody seen";
  EXPECT_TRUE(nobody.instances.empty());
}

TEST(MaskFiles, DoesNotGiveAFrameItsNeighborsMask) {
  TemporaryFolder folder;
  write_mask(folder, "a", 1);
  MaskFilesSegmenter segmenter(folder.path(), kFrames);
  EXPECT_TRUE(segmenter.segment(frame_at(1341846313.592)).available) << "a rounded timestamp";
  EXPECT_FALSE(segmenter.segment(frame_at(1341846313.600)).available);
  EXPECT_FALSE(segmenter.segment(frame_at(1341846313.625)).available);
  EXPECT_FALSE(segmenter.segment(frame_at(0)).available);
  EXPECT_THROW(segmenter.segment(frame_at(std::numeric_limits<double>::quiet_NaN())),
               stillpoint::Error);
}

TEST(MaskFiles, TakesTimestampsFromFileNames) {
  TemporaryFolder folder;
  write_mask(folder, "1341846313.592026", 1);
  write_mask(folder, "1341846313.725000", 2);
  write_mask(folder, "notes", 2);
  MaskFilesSegmenter segmenter(folder.path());
  EXPECT_EQ(segmenter.masks(), 2u);
  EXPECT_TRUE(segmenter.segment(frame_at(1341846313.592026)).available);
  EXPECT_TRUE(segmenter.segment(frame_at(1341846313.725)).available);
  EXPECT_FALSE(segmenter.segment(frame_at(1341846313.65)).available);
}

TEST(MaskFiles, SplitsZeroAnd255AndObeysItsSettings) {
  TemporaryFolder folder;
  write_mask(folder, "a", 255);
  cv::Mat labels = stillpoint::read_labels(folder / "a.png", kSize);
  labels(cv::Rect(25, 5, 8, 8)) = 255;
  labels(cv::Rect(35, 25, 3, 3)) = 255;
  stillpoint::write_image(folder / "a.png", labels);
  MaskFilesSegmenter segmenter(folder.path(), kFrames);
  EXPECT_EQ(segmenter.segment(frame_at(kFrames[0].timestamp)).instances.size(), 2u);
  MaskFilesSegmenter::Settings settings;
  settings.min_area_px = 9;
  settings.class_name = "dog";
  MaskFilesSegmenter fine(folder.path(), kFrames, settings);
  const auto instances = fine.segment(frame_at(kFrames[0].timestamp)).instances;
  ASSERT_EQ(instances.size(), 3u);
  EXPECT_EQ(instances[2].class_name, "dog");
}

TEST(MaskFiles, WrongFolderIsAnErrorAtOnce) {
  TemporaryFolder folder;
  EXPECT_ERROR(MaskFilesSegmenter(folder / "none", kFrames), "none", "folder");
  EXPECT_ERROR(MaskFilesSegmenter(folder / "none"), "none", "folder");
  EXPECT_ERROR(MaskFilesSegmenter(folder.path(), kFrames), "a.png", "found 0 PNGs");
  EXPECT_ERROR(MaskFilesSegmenter(folder.path()), "timestamps", "found 0 PNGs");
  write_mask(folder, "000001", 1);
  EXPECT_ERROR(MaskFilesSegmenter(folder.path(), kFrames), "expected PNGs named by the color files",
               "e.g. a.png", "found 1 PNGs of other names, e.g. 000001.png", "name each mask");
  EXPECT_ERROR(MaskFilesSegmenter(folder / "000001.png", kFrames), "000001.png", "folder");
  EXPECT_ERROR(MaskFilesSegmenter(folder.path(), std::vector<FrameName>()), "no frame");
  EXPECT_ERROR(MaskFilesSegmenter(folder.path(), {{std::nan(""), "000001"}}), "000001");
  write_mask(folder, "frame1", 1);
  std::filesystem::remove(folder / "000001.png");
  EXPECT_ERROR(MaskFilesSegmenter(folder.path()), "timestamps", "frame1.png");
}

TEST(MaskFiles, BadMasksAreErrorsThatNameTheFile) {
  TemporaryFolder folder;
  write_mask(folder, "a", 1);
  MaskFilesSegmenter segmenter(folder.path(), kFrames);
  const auto segment = [&] { segmenter.segment(frame_at(kFrames[0].timestamp)); };
  const auto path = folder / "a.png";
  stillpoint::write_image(path, cv::Mat::zeros(kSize, CV_8UC3));
  EXPECT_ERROR(segment(), "a.png", "CV_8UC1", "found CV_8UC3", "save it");
  stillpoint::write_image(path, cv::Mat::zeros(kSize, CV_16UC1));
  EXPECT_ERROR(segment(), "a.png", "found CV_16UC1", "save it");
  stillpoint::write_image(path, cv::Mat::zeros(15, 20, CV_8UC1));
  EXPECT_ERROR(segment(), "a.png", "40x30", "found 20x15", "resize");
  folder.write("a.png", stillpoint::read_file(path, "mask").substr(0, 50));
  EXPECT_ERROR(segment(), "a.png", "truncated");
  std::filesystem::remove(path);
  EXPECT_ERROR(segment(), "a.png", "no such file");
}

TEST(MaskFiles, ReadsARenderedSequence) {
  const std::filesystem::path folder = STILLPOINT_SHARED_DATA "/rendered/crowd_rpy";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no " << folder;
  const stillpoint::TumSequence sequence(folder);
  MaskFilesSegmenter each(folder / "masks", frame_names(sequence));
  MaskFilesSegmenter seldom(folder / "masks_4hz", frame_names(sequence));
  EXPECT_EQ(each.masks(), 200u);
  EXPECT_EQ(seldom.masks(), 25u);
  std::size_t available = 0;
  for (std::size_t i = 0; i < sequence.size(); i += 4) {
    RgbdFrame frame;
    frame.timestamp = sequence.entry(i).timestamp;
    frame.color = cv::Mat(480, 640, CV_8UC3);
    available += seldom.segment(frame).available;
    EXPECT_TRUE(each.segment(frame).available);
  }
  EXPECT_EQ(available, 25u) << "every eighth frame, looked at every fourth";
}

}  // namespace

namespace stillpoint::testing {

// Reads what it wrote; images of other sizes than its mask are refused.
struct MakeMaskFiles {
  std::unique_ptr<Segmenter> operator()() const {
    static const TemporaryFolder folder;
    std::vector<FrameName> names;
    for (int i = 1; i <= 20; ++i) {
      names.push_back({static_cast<double>(i), std::to_string(i)});
      cv::Mat labels = cv::Mat::zeros(480, 640, CV_8UC1);
      labels(cv::Rect(10 * i, 40, 100, 300)) = 1;
      labels(cv::Rect(400, 5 * i, 60, 300)) = 2;
      write_image(folder / (std::to_string(i) + ".png"), labels);
    }
    return std::make_unique<MaskFilesSegmenter>(folder.path(), names);
  }
};

STILLPOINT_TEST_SEGMENTER(MaskFiles, MakeMaskFiles);

}  // namespace stillpoint::testing
