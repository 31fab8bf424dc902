// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/io/tum_sequence.hpp"

#include <gtest/gtest.h>

#include <sstream>

#include "temporary_folder.hpp"

namespace {

using stillpoint::TumSequence;
using stillpoint::write_image;

const char kCamera[] =
    "Camera.fx: 50\nCamera.fy: 50\nCamera.cx: 8\nCamera.cy: 6\nCamera.width: 16\n"
    "Camera.height: 12\nDepthMapFactor: 1000\n";

// Three color images at 1, 2, 3 s; depth near the first and the last.
struct SmallSequence : TemporaryFolder {
  SmallSequence() {
    write("rgb.txt",
          "# color images\n1.000000 rgb/1.000000.png\n2.000000 rgb/2.000000.jpg\n"
          "3.000000 rgb/3.000000.png\n");
    write("depth.txt",
          "# depth maps\n1.004000 depth/1.004000.png\n2.500000 depth/2.500000.png\n"
          "2.990000 depth/2.990000.png\n");
    std::filesystem::create_directories(path() / "rgb");
    std::filesystem::create_directories(path() / "depth");
    for (const char* name : {"1.000000.png", "2.000000.jpg", "3.000000.png"})
      write_image(path() / "rgb" / name, cv::Mat(12, 16, CV_8UC3, cv::Scalar::all(90)));
    for (const char* name : {"1.004000.png", "2.500000.png", "2.990000.png"})
      write_image(path() / "depth" / name, cv::Mat(12, 16, CV_16UC1, cv::Scalar(2000)));
  }
};

TEST(TumSequence, PairsNearestTimestampsWithinTheLimit) {
  SmallSequence folder;
  const TumSequence sequence(folder.path());
  ASSERT_EQ(sequence.size(), 2u);
  EXPECT_DOUBLE_EQ(sequence.entry(0).timestamp, 1.0);
  EXPECT_DOUBLE_EQ(sequence.entry(0).depth_timestamp, 1.004);
  EXPECT_EQ(sequence.entry(0).stem, "1.000000");
  EXPECT_EQ(sequence.entry(1).stem, "3.000000");
  EXPECT_EQ(sequence.entry(1).depth_path.filename(), "2.990000.png");
  EXPECT_EQ(sequence.without_depth(), 1u);
  EXPECT_EQ(sequence.missing_images(), 0u);
  EXPECT_EQ(sequence.timestamps(), (std::vector<double>{1, 3}));
  EXPECT_FALSE(sequence.camera());
  EXPECT_FALSE(sequence.has_groundtruth());
}

TEST(TumSequence, LoadsAFrame) {
  SmallSequence folder;
  folder.write("camera.yaml", kCamera);
  folder.write("groundtruth.txt", "1 0 0 0 0 0 0 1\n");
  const TumSequence sequence(folder.path());
  const stillpoint::RgbdFrame frame = sequence.load(0);
  EXPECT_NO_THROW(check_frame(frame));
  EXPECT_DOUBLE_EQ(frame.timestamp, 1.0);
  EXPECT_EQ(frame.color.type(), CV_8UC3);
  EXPECT_FLOAT_EQ(depth_m_at(frame, 3, 3), 2.0f) << "the camera file's depth units";
  ASSERT_TRUE(sequence.camera());
  EXPECT_DOUBLE_EQ(sequence.camera()->fx, 50);
  EXPECT_TRUE(sequence.has_groundtruth());
  EXPECT_EQ(sequence.groundtruth().size(), 1u);
  EXPECT_THROW(sequence.load(2), stillpoint::Error);

  TumSequence::Settings settings;
  settings.camera = stillpoint::Camera();
  settings.camera->depth_units_per_m = 5000;
  EXPECT_FLOAT_EQ(depth_m_at(TumSequence(folder.path(), settings).load(0), 3, 3), 0.4f);
}

TEST(TumSequence, UsesAGivenAssociationsFile) {
  SmallSequence folder;
  const auto file =
      folder.write("mine.txt", "2.000000 rgb/2.000000.jpg 2.500000 depth/2.500000.png\n");
  TumSequence::Settings settings;
  settings.associations = file;
  const TumSequence sequence(folder.path(), settings);
  ASSERT_EQ(sequence.size(), 1u);
  EXPECT_EQ(sequence.entry(0).stem, "2.000000");
  EXPECT_EQ(sequence.load(0).color.cols, 16);

  // Depth first, as `associate.py depth.txt rgb.txt` writes it.
  folder.write("mine.txt", "2.500000 depth/2.500000.png 2.000000 rgb/2.000000.jpg\n");
  EXPECT_DOUBLE_EQ(TumSequence(folder.path(), settings).entry(0).timestamp, 2.0);

  folder.write("mine.txt", "2.000000 rgb/2.000000.jpg\n");
  EXPECT_ERROR(TumSequence(folder.path(), settings), "mine.txt", "line 1", "timestamp depth_file");
  folder.write("mine.txt", "2.000000 rgb/2.000000.jpg 12.500000 depth/2.500000.png\n");
  EXPECT_ERROR(TumSequence(folder.path(), settings), "mine.txt", "line 1", "0.5", "12.500000");
}

TEST(TumSequence, FallsBackOnItsOwnAssociationsFile) {
  SmallSequence folder;
  folder.write("associations.txt", "2.000000 rgb/2.000000.jpg 2.500000 depth/2.500000.png\n");
  EXPECT_EQ(TumSequence(folder.path()).size(), 2u) << "rgb.txt and depth.txt come first";
  std::filesystem::remove(folder / "depth.txt");
  EXPECT_EQ(TumSequence(folder.path()).size(), 1u);
}

TEST(TumSequence, DepthCanBeLeftOutWhenAskedFor) {
  SmallSequence folder;
  std::filesystem::remove(folder / "depth.txt");
  EXPECT_ERROR(TumSequence(folder.path()), "depth.txt", "no such file");
  TumSequence::Settings settings;
  settings.depth_required = false;
  const TumSequence sequence(folder.path(), settings);
  ASSERT_EQ(sequence.size(), 3u);
  EXPECT_TRUE(sequence.load(1).depth.empty());
}

TEST(TumSequence, LeavesOutAndCountsMissingPictures) {
  SmallSequence folder;
  std::filesystem::remove(folder / "rgb/1.000000.png");
  const TumSequence sequence(folder.path());
  ASSERT_EQ(sequence.size(), 1u);
  EXPECT_EQ(sequence.missing_images(), 1u);
  std::filesystem::remove_all(folder / "depth");
  EXPECT_ERROR(TumSequence(folder.path()), "found none of 2 pairs", "1.000000.png");
}

TEST(TumSequence, SaysWhatIsWrongWithTheFolder) {
  SmallSequence folder;
  EXPECT_ERROR(TumSequence(folder / "none"), "none", "no such folder");
  EXPECT_ERROR(TumSequence(folder / "rgb.txt"), "a file");
  EXPECT_ERROR(TumSequence(folder / "rgb"), "rgb.txt", "no such file");
  const auto with_list = [&](const std::string& text) {
    folder.write("rgb.txt", text);
    TumSequence sequence(folder.path());
  };
  EXPECT_ERROR(with_list(""), "at least one image", "rgb.txt");
  EXPECT_ERROR(with_list("# only a comment\n"), "at least one image");
  EXPECT_ERROR(with_list("1.0\n"), "rgb.txt", "line 1", "timestamp filename");
  EXPECT_ERROR(with_list("nan rgb/1.000000.png\n"), "line 1", "\"nan\"");
  EXPECT_ERROR(with_list("-1.0 rgb/1.000000.png\n"), "line 1", "not negative");
  EXPECT_ERROR(with_list("2.0 rgb/2.000000.jpg\n1.0 rgb/1.000000.png\n"), "line 2", "of line 1",
               "out of order");
  EXPECT_ERROR(with_list("1.0 rgb/1.000000.png\n1.0 rgb/2.000000.jpg\n"), "line 2", "again");
  EXPECT_ERROR(with_list("7.0 rgb/1.000000.png\n"), "0.02", "no such pair");
}

TEST(TumSequence, ReadsARepeatedLineOnce) {
  SmallSequence folder;
  const TumSequence before(folder.path());
  std::istringstream lines(stillpoint::read_file(folder / "depth.txt", "list"));
  std::string twice;
  for (std::string line; std::getline(lines, line);) twice += line + "\n" + line + "\n";
  folder.write("depth.txt", twice);
  const TumSequence sequence(folder.path());
  ASSERT_EQ(sequence.size(), before.size());
  for (std::size_t i = 0; i < sequence.size(); ++i)
    EXPECT_EQ(sequence.entry(i).depth_path, before.entry(i).depth_path);
}

TEST(TumSequence, SaysWhichPictureIsBad) {
  SmallSequence folder;
  const auto load = [&] { TumSequence(folder.path()).load(0); };
  write_image(folder / "depth/1.004000.png", cv::Mat(10, 16, CV_16UC1, cv::Scalar(9)));
  EXPECT_ERROR(load(), "1.004000.png", "16x12", "16x10", "register");
  write_image(folder / "depth/1.004000.png", cv::Mat(12, 16, CV_8UC3));
  EXPECT_ERROR(load(), "1.004000.png", "CV_8UC3");
  folder.write("depth/1.004000.png", "");
  EXPECT_ERROR(load(), "1.004000.png", "empty file");
  write_image(folder / "rgb/1.000000.png", cv::Mat(24, 32, CV_8UC3));
  folder.write("camera.yaml", kCamera);
  EXPECT_ERROR(load(), "1.000000.png", "the camera's 16x12", "32x24");
}

TEST(TumSequence, OpensRealFramesOfFr1Desk) {
  const std::filesystem::path folder = STILLPOINT_SHARED_DATA "/real/fr1_desk";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no " << folder;
  TumSequence::Settings settings;
  settings.camera = stillpoint::Camera::tum_fr1();
  const TumSequence sequence(folder, settings);
  // Nine images of each kind are there; the lists name over 590.
  EXPECT_EQ(sequence.size(), 9u);
  EXPECT_GT(sequence.missing_images(), 500u);
  EXPECT_EQ(sequence.entry(0).stem, "1305031453.359684");
  EXPECT_EQ(sequence.entry(0).depth_path.stem(), "1305031453.374112");
  EXPECT_NO_THROW(check_frame(sequence.load(8)));
  EXPECT_EQ(sequence.groundtruth().size(), 2335u);
}

TEST(TumSequence, OpensARenderedSequence) {
  const std::filesystem::path folder = STILLPOINT_SHARED_DATA "/rendered/walking_xyz";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no " << folder;
  const TumSequence sequence(folder);
  ASSERT_EQ(sequence.size(), 200u);
  ASSERT_TRUE(sequence.camera());
  EXPECT_DOUBLE_EQ(sequence.camera()->exposure_s, 0.025);
  EXPECT_EQ(sequence.entry(1).stem, "1300000000.033333");
  EXPECT_EQ(sequence.load(199).color.size(), cv::Size(640, 480));
}

}  // namespace
