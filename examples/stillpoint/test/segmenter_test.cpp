// SPDX-License-Identifier: BSD-2-Clause
//
// Masks and networks on the command line: late, missing, broken.

#include <cmath>
#include <cstdio>
#include <opencv2/imgproc.hpp>
#include <sstream>

#include "cli_fixture.hpp"
#include "stillpoint/io/trajectory_file.hpp"

namespace stillpoint {
namespace {

TEST_F(Cli, LateMasksArePlayed) {
  const Result r = run("run walk --out late --latency 100");
  ASSERT_EQ(r.code, 0) << r.err;
  EXPECT_NE(r.out.find("as if it took 100 ms"), std::string::npos) << r.out;
  const Json stats = json_of(path("late") / "stats.json");
  EXPECT_EQ(stats["status"]["no_segmentation"], 8) << "the first, then every third of 12";
  EXPECT_EQ(stats["settings"]["latency_ms"], 100);
  EXPECT_GT(stats["masks"]["iou_after"], 0.5);
  ASSERT_EQ(run("run walk --out late_again --latency 100").code, 0);
  EXPECT_EQ(text_of(path("late") / "trajectory.txt"),
            text_of(path("late_again") / "trajectory.txt"));
  EXPECT_EQ(run("run walk --out late --latency 100 --without prediction").code, 0);
  const Result thread = run("run walk --out thread --async");
  EXPECT_EQ(thread.code, 0) << thread.err;
  EXPECT_GT(json_of(path("thread") / "stats.json")["masks"]["iou_after"], 0.5);
  expect_error("run walk --out late --latency 100 --async", 1, "exclude each other");
  expect_error("run walk --out late --latency -5", 2, "--latency");
  expect_error("run walk --out late --segmenter none --latency 100", 1, "--latency: only");
  expect_error("run walk --out late --segmenter none --async", 1, "--async: only");
}

TEST_F(Cli, FramesThatComeTooLateAreDropped) {
  // 4000 features are too slow for 300 Hz on any machine of today.
  fs::copy(path("walk"), path("fast"), fs::copy_options::recursive);
  for (const char* list : {"rgb.txt", "depth.txt"}) {
    std::istringstream in(text_of(path("walk") / list));
    std::ofstream out(path("fast") / list, std::ios::binary);
    double first = 0;
    for (std::string line; std::getline(in, line);) {
      if (line[0] == '#') continue;
      const std::size_t space = line.find(' ');
      const double t = std::stod(line);
      if (first == 0) first = t;
      char stamp[40];
      std::snprintf(stamp, sizeof stamp, "%.6f", first + (t - first) / 10);
      out << stamp << line.substr(space) << "\n";
    }
  }
  const Result r = run("run fast --out rate --real-time-rate --features 4000");
  ASSERT_EQ(r.code, 0) << r.err;
  const Json stats = json_of(path("rate") / "stats.json");
  const int dropped = stats["real_time"]["dropped_frames"];
  EXPECT_GT(dropped, 0);
  EXPECT_EQ(stats["frames"], 12 - dropped);
  EXPECT_NE(r.out.find(std::to_string(dropped) + " frames came too late"), std::string::npos)
      << r.out;
  EXPECT_LE(read_trajectory(path("rate") / "trajectory.txt").size(), 12u - dropped);
  // Without the clock every frame is waited for.
  ASSERT_EQ(run("run walk --out calm --front-end off --without loop_closing").code, 0);
  const Json calm = json_of(path("calm") / "stats.json");
  EXPECT_FALSE(calm.contains("real_time"));
  EXPECT_EQ(calm["settings"]["without"], Json({"loop_closing"}));
  EXPECT_EQ(calm["frames"], 12);
}

TEST_F(Cli, NetworksAreChecked) {
  expect_error("run walk --out net --dynamic person=2", 1, "prior of 0 to 1");
  expect_error("run walk --out net --dynamic person=often", 1, "NAME=PRIOR");
  expect_error("run walk --out net --segmenter mask_files --model a.onnx", 1, "only the segmenter");
  if (run("run walk --out net --segmenter opencv_dnn").code == 2) {
    GTEST_SKIP() << "built without opencv_dnn";
  }
  expect_error("run walk --out net --segmenter opencv_dnn", 1, "--model FILE");
  expect_error("run walk --out net --model none.onnx", 1, "check the path");
  std::ofstream(path("broken.onnx")) << "not a network";
  expect_error("mask walk --network-only --out net --model broken.onnx", 1, "whole ONNX file");
  EXPECT_FALSE(fs::exists(path("net"))) << "bad input is said before anything is written";
}

TEST_F(Cli, TorchScriptIsRunOrNamed) {
  std::ofstream(path("network.pt")) << "not a network";
  // Chosen by the file's ending, also where it was left out of the build.
  const Result r = run("run walk --out net --model network.pt");
  EXPECT_EQ(r.code, 1);
  EXPECT_TRUE(r.err.find("expected a TorchScript file") != std::string::npos ||
              r.err.find("install libtorch-dev") != std::string::npos)
      << r.err;
  expect_error("mask walk --network-only --out net --model network.pt --model-config a.pbtxt", 1,
               "opencv_dnn");
  EXPECT_FALSE(fs::exists(path("net")));
}

TEST_F(Cli, FoldersAndFilesOfAnotherKindAreSaid) {
  expect_error("run walk --out kinds --masks walk/rgb", 1, "expected one channel of 8 bits");
  EXPECT_FALSE(fs::exists(path("kinds")));
  expect_error("bench walk --out kinds --masks-folder maks", 1, "found no \"maks\"");
  expect_error("synth other --size 16x16", 1,
               "SyntheticSettings.width: expected 32 to 8192, found");

  fs::copy(path("walk"), path("garbage"), fs::copy_options::recursive);
  std::ofstream(path("garbage") / "associations.txt") << "garbage\n";
  const Result r = run("run garbage --out kinds --tracker vo --frames 3");
  EXPECT_EQ(r.code, 0);
  EXPECT_NE(r.err.find("associations.txt is broken"), std::string::npos) << r.err;

  // Every mask but the first is none: that is said in the end, and is no success if it is all.
  fs::copy(path("walk"), path("later"), fs::copy_options::recursive);
  std::vector<fs::path> masks;
  for (const auto& entry : fs::directory_iterator(path("later") / "masks"))
    masks.push_back(entry.path());
  std::sort(masks.begin(), masks.end());
  for (std::size_t i = 1; i < masks.size(); ++i) fs::resize_file(masks[i], 20);
  const Result most = run("run later --out kinds --tracker vo --frames 3");
  EXPECT_EQ(most.code, 0) << most.err;
  EXPECT_NE(most.err.find("failed in 2 frames"), std::string::npos) << most.err;
}

TEST_F(Cli, ClassesThatNoSourceKnowsAreRefused) {
  expect_error("run walk --out classes --dynamic persn", 1, "found \"persn\"");
  expect_error("run walk --out classes --dynamic person,chair=0.5", 1, "found \"chair\"");
  expect_error("mask walk --network-only --out classes --masks walk/masks_gt --dynamic persn", 1,
               "\"person\"");
  expect_error("run walk --out classes --segmenter none --dynamic persn", 1, "--segmenter none");
  EXPECT_FALSE(fs::exists(path("classes")));
  EXPECT_EQ(run("run walk --out classes --tracker vo --frames 3 --dynamic person=0.9").code, 0);
}

TEST_F(Cli, NetworksSegment) {
  const std::string graphs = STILLPOINT_TEST_GRAPHS;
  if (!fs::exists(graphs + "/fastestdet.onnx")) GTEST_SKIP() << "no graphs in " << graphs;
  const std::string boxes = " --model '" + graphs + "/fastestdet.onnx' ";
  const Result r = run("mask walk --network-only --out net_masks" + boxes);
  ASSERT_EQ(r.code, 0) << r.err;
  EXPECT_EQ(files_in(path("net_masks"), ".png"), 12u);
  EXPECT_NE(r.out.find("12 with a result"), std::string::npos) << r.out;
  EXPECT_NE(r.out.find(" 36 instances"), std::string::npos) << r.out;
  const Result all = run("mask walk --network-only --out net_all --dynamic person,tv=0.5" + boxes);
  EXPECT_NE(all.out.find("48 instances"), std::string::npos) << all.out;
  expect_error("mask walk --network-only --out net_all --dynamic persn" + boxes, 1,
               "person, bicycle");
  expect_error("run walk --out net --decoder detr" + boxes, 1, "no decoder \"detr\"");
  expect_error("run walk --out net --input-size 100" + boxes, 1, "WIDTHxHEIGHT");
  expect_error("run walk --out net --input-size 128x128" + boxes, 1, "made for, 96x64");
  EXPECT_EQ(run("run walk --out net --decoder fastestdet" + boxes).code, 0);
  EXPECT_EQ(run("run walk --out net --async" + boxes).code, 0);
}

}  // namespace
}  // namespace stillpoint
