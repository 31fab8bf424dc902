// SPDX-License-Identifier: BSD-2-Clause
#include "synthetic/writer.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>

#include "../../../tests/io/temporary_folder.hpp"
#include "stillpoint/io/text_file.hpp"
#include "stillpoint/io/tum_sequence.hpp"

namespace stillpoint {
namespace {

namespace fs = std::filesystem;

SyntheticSettings small() {
  SyntheticSettings s;
  s.motion = SyntheticMotion::kRpy, s.frames = 4;
  s.width = 96, s.height = 72;
  return s;
}

std::map<std::string, std::string> contents(const fs::path& root) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(root)) {
    if (!entry.is_regular_file()) continue;
    std::ifstream in(entry.path(), std::ios::binary);
    files[fs::relative(entry.path(), root).string()] = {std::istreambuf_iterator<char>(in), {}};
  }
  return files;
}

TEST(SyntheticWriter, WritesWhatTheReaderReads) {
  const TemporaryFolder folder;
  SyntheticSettings settings = small();
  settings.movers = 1;
  std::vector<int> done;
  const SyntheticSummary summary =
      write_synthetic_sequence((folder.path() / "a").string(), settings, [&](int i, int n) {
        EXPECT_EQ(n, 4);
        done.push_back(i);
      });
  EXPECT_EQ(done, (std::vector<int>{1, 2, 3, 4}));
  EXPECT_EQ(summary.frames, 4);

  const TumSequence read(folder.path() / "a");
  const SyntheticSequence sequence(settings);
  ASSERT_EQ(read.size(), 4u);
  ASSERT_TRUE(read.camera());
  EXPECT_NEAR(read.camera()->fx, sequence.camera().fx, 1e-5);
  EXPECT_NEAR(read.camera()->cy, sequence.camera().cy, 1e-5);
  EXPECT_EQ(read.camera()->depth_units_per_m, 5000);
  for (std::size_t i = 0; i < 4; ++i) {
    const RgbdFrame frame = read.load(i);
    const SyntheticFrame truth = sequence.frame(static_cast<int>(i));
    EXPECT_NEAR(frame.timestamp, truth.timestamp, 1e-6);
    EXPECT_EQ(cv::norm(frame.color, truth.color, cv::NORM_INF), 0);
    EXPECT_EQ(cv::norm(frame.depth, truth.depth, cv::NORM_INF), 0);
    const std::string stem = detail::seconds_text(truth.timestamp) + ".png";
    const cv::Mat labels =
        cv::imread((folder.path() / "a/masks_gt" / stem).string(), cv::IMREAD_UNCHANGED);
    EXPECT_EQ(cv::norm(labels, truth.labels, cv::NORM_INF), 0);
    const cv::Mat movers =
        cv::imread((folder.path() / "a/movers_gt" / stem).string(), cv::IMREAD_UNCHANGED);
    EXPECT_EQ(cv::countNonZero(movers),
              cv::countNonZero(truth.labels >= synthetic::kFirstMoverLabel));
    const cv::Mat masks =
        cv::imread((folder.path() / "a/masks" / stem).string(), cv::IMREAD_UNCHANGED);
    ASSERT_EQ(masks.type(), CV_8UC1);
    EXPECT_EQ(cv::countNonZero(masks >= synthetic::kFirstMoverLabel), 0);
  }
  // The ground truth has each frame's pose, and more between them.
  const Trajectory truth = read.groundtruth();
  EXPECT_EQ(truth.size(), 3u * 7 + 1);
  for (int i = 0; i < 4; ++i) {
    bool found = false;
    for (const StampedPose& pose : truth)
      if (std::abs(pose.timestamp - sequence.timestamp(i)) < 1e-6) {
        found = true;
        const Eigen::Isometry3d T = sequence.T_world_camera(sequence.seconds(i));
        EXPECT_LT((pose.T_world_camera.matrix() - T.matrix()).norm(), 1e-6);
      }
    EXPECT_TRUE(found) << i;
  }
  EXPECT_TRUE(fs::exists(folder.path() / "a/associations.txt"));
  EXPECT_TRUE(fs::exists(folder.path() / "a/blur.csv"));
}

TEST(SyntheticWriter, SameFilesForAnyNumberOfThreads) {
  const TemporaryFolder folder;
  const int before = cv::getNumThreads();
  cv::setNumThreads(1);
  write_synthetic_sequence((folder.path() / "one").string(), small());
  cv::setNumThreads(3);
  write_synthetic_sequence((folder.path() / "three").string(), small());
  cv::setNumThreads(before);
  const auto one = contents(folder.path() / "one"), three = contents(folder.path() / "three");
  EXPECT_EQ(one.size(), 4u * 4 + 6);
  EXPECT_TRUE(one == three);
}

TEST(SyntheticWriter, JpegIsNamedSoInTheLists) {
  const TemporaryFolder folder;
  SyntheticSettings settings = small();
  settings.frames = 1, settings.people = 0;
  SyntheticWriterOptions options;
  options.jpeg = true;
  const SyntheticSummary summary =
      write_synthetic_sequence((folder.path() / "a").string(), settings, {}, options);
  EXPECT_EQ(summary.most_cover, 0);
  EXPECT_EQ(summary.lost_share, 0);
  EXPECT_TRUE(fs::exists(folder.path() / "a/rgb/1300000000.000000.jpg"));
  EXPECT_FALSE(fs::exists(folder.path() / "a/movers_gt"));
  EXPECT_NO_THROW(TumSequence(folder.path() / "a").load(0));
}

TEST(SyntheticWriter, FolderThatCannotBeMadeIsAnError) {
  const TemporaryFolder folder;
  std::ofstream(folder.path() / "file") << "x";
  EXPECT_THROW(write_synthetic_sequence((folder.path() / "file/a").string(), small()), Error);
}

TEST(SyntheticWriter, ErrorFromTheProgressCallbackComesThrough) {
  const TemporaryFolder folder;
  EXPECT_THROW(write_synthetic_sequence((folder.path() / "a").string(), small(),
                                        [](int, int) { throw Error("stop"); }),
               Error);
}

}  // namespace
}  // namespace stillpoint
