// SPDX-License-Identifier: BSD-2-Clause
//
// What `run` writes and says.

#include <cmath>
#include <cstdio>
#include <opencv2/imgproc.hpp>
#include <sstream>

#include "cli_fixture.hpp"
#include "stillpoint/io/trajectory_file.hpp"

namespace stillpoint {
namespace {

TEST_F(Cli, RunWritesTheObjects) {
  const Result r = run("run walk --out followed --save-objects followed.csv --save-overlays 6");
  ASSERT_EQ(r.code, 0) << r.err;
  const std::string csv = text_of(path("followed.csv"));
  EXPECT_EQ(csv.compare(0, 22, "timestamp,id,class,sco"), 0) << csv.substr(0, 80);
  EXPECT_GE(lines_of(csv), 1 + 12) << "two people in 12 frames";
  EXPECT_NE(csv.find(",person,"), std::string::npos);
  EXPECT_EQ(files_in(path("followed") / "overlays", ".png"), 2u);
  const Result off = run("run walk --out followed --save-objects no.csv --front-end off");
  EXPECT_EQ(off.code, 1);
  EXPECT_NE(off.err.find("--save-objects"), std::string::npos) << off.err;
  EXPECT_FALSE(fs::exists(path("no.csv")));
}

TEST_F(Cli, RunWritesWhatItSays) {
  const Result r = run("run walk --out out --save-masks --save-keypoints --save-overlays 5");
  ASSERT_EQ(r.code, 0) << r.err;
  EXPECT_TRUE(r.err.empty()) << r.err;
  EXPECT_NE(r.out.find("mask_files (walk/masks)"), std::string::npos) << r.out;

  const Json stats = json_of(path("out") / "stats.json");
  EXPECT_EQ(stats["frames"], 12);
  EXPECT_EQ(stats["tracked"], 12);
  EXPECT_DOUBLE_EQ(stats["coverage"], 1);
  EXPECT_LT(stats["evaluation"]["ate_rmse_m"], 0.05);
  EXPECT_EQ(stats["evaluation"]["pairs"], 12);
  for (const char* stage :
       {"segmentation", "compensation", "depth", "probability", "extraction", "tracking", "total"})
    for (const char* key : {"median", "p95"})
      EXPECT_TRUE(stats["times_ms"][stage][key].is_number()) << stage;
  for (const char* key : {"stillpoint", "opencv", "eigen", "compiler"})
    EXPECT_FALSE(stats["versions"][key].get<std::string>().empty()) << key;
  for (const char* key : {"iou_before", "iou_after"}) {
    EXPECT_GT(stats["masks"][key], 0.3) << key;
    EXPECT_LE(stats["masks"][key], 1.0) << key;
  }
  EXPECT_TRUE(stats["status"].is_object());
  EXPECT_EQ(stats["settings"]["segmenter"], "mask_files");
  EXPECT_GT(stats["keypoints"]["kept"], 50);
  EXPECT_GT(stats["keypoints"]["recall"], 0.5);
  EXPECT_TRUE(stats["lost"].empty());
  EXPECT_GT(stats["tracker"]["keyframes"], 0);
  EXPECT_GT(stats["map"]["voxels"], 500);
  EXPECT_LT(stats["map"]["ghost_share"], 0.02);
  EXPECT_NE(r.out.find("% ghosts of people"), std::string::npos) << r.out;

  EXPECT_EQ(read_trajectory(path("out") / "trajectory.txt").size(), 12u);
  EXPECT_EQ(text_of(path("out") / "map.ply").compare(0, 4, "ply\n"), 0);
  EXPECT_EQ(files_in(path("out") / "masks", ".png"), 12u);
  EXPECT_EQ(files_in(path("out") / "overlays", ".png"), 3u);
  const std::string csv = text_of(path("out") / "keypoints.csv");
  EXPECT_EQ(csv.compare(0, 31, "timestamp,x,y,probability,kept\n"), 0);
  EXPECT_GT(lines_of(csv), 12 * 50);

  // The final mask, by the color file's stem, with 255 for dynamic and nothing else.
  for (const auto& entry : fs::directory_iterator(path("walk") / "rgb")) {
    const cv::Mat mask = cv::imread((path("out") / "masks" / entry.path().stem()).string() + ".png",
                                    cv::IMREAD_UNCHANGED);
    ASSERT_EQ(mask.type(), CV_8UC1);
    ASSERT_EQ(mask.size(), cv::Size(320, 240));
    EXPECT_EQ(cv::countNonZero(mask), cv::countNonZero(mask == 255));
    EXPECT_GT(cv::countNonZero(mask), 0);
  }
}

TEST_F(Cli, RunThatBreaksOffKeepsTheLastGoodResults) {
  fs::copy(path("walk"), path("ends"), fs::copy_options::recursive);
  const std::string command = "run ends --out ends_out --tracker vo --save-keypoints --save-masks";
  ASSERT_EQ(run(command).code, 0);
  const auto contents = [] {
    std::string all;
    for (const char* file : {"trajectory.txt", "stats.json", "map.ply", "keypoints.csv"})
      all += text_of(path("ends_out") / file);
    return all + std::to_string(files_in(path("ends_out") / "masks", ".png"));
  };
  const std::string good = contents();
  std::vector<fs::path> images;
  for (const auto& entry : fs::directory_iterator(path("ends") / "rgb"))
    images.push_back(entry.path());
  std::sort(images.begin(), images.end());
  fs::resize_file(images.back(), 0);
  expect_error(command, 1, "what was tracked before it is in ends_out/trajectory.txt.partial");
  EXPECT_EQ(contents(), good);
  EXPECT_EQ(read_trajectory(path("ends_out") / "trajectory.txt.partial").size(), 11u);

  // The next run that ends well clears up.
  fs::copy(path("walk") / "rgb" / images.back().filename(), images.back(),
           fs::copy_options::overwrite_existing);
  ASSERT_EQ(run("run ends --out ends_out --tracker vo --frames 6").code, 0);
  EXPECT_EQ(read_trajectory(path("ends_out") / "trajectory.txt").size(), 6u);
  EXPECT_FALSE(fs::exists(path("ends_out") / "keypoints.csv")) << "not this run's";
  for (const auto& entry : fs::directory_iterator(path("ends_out")))
    EXPECT_NE(entry.path().extension(), ".partial") << entry.path();

  // A broken ground truth is found before a frame is tracked.
  std::ofstream(path("ends") / "groundtruth.txt") << "1.0 nothing\n";
  expect_error("run ends --out ends_late", 1, "groundtruth.txt");
  EXPECT_FALSE(fs::exists(path("ends_late")));
}

TEST_F(Cli, SameInputGivesTheSameBytes) {
  for (const char* out : {"one", "two"})
    ASSERT_EQ(run("run walk --save-masks --save-keypoints --out " + std::string(out)).code, 0);
  for (const char* file : {"trajectory.txt", "keypoints.csv", "map.ply"})
    EXPECT_EQ(text_of(path("one") / file), text_of(path("two") / file)) << file;
  for (const auto& entry : fs::directory_iterator(path("one") / "masks"))
    EXPECT_EQ(text_of(entry.path()), text_of(path("two") / "masks" / entry.path().filename()));
  ASSERT_EQ(
      run("synth again --motion xyz --people 2 --frames 12 --size 320x240 --shutter-ms 10").code,
      0);
  for (const auto& entry : fs::recursive_directory_iterator(path("walk"))) {
    if (!entry.is_regular_file()) continue;
    const fs::path other = path("again") / fs::relative(entry.path(), path("walk"));
    EXPECT_EQ(text_of(entry.path()), text_of(other)) << other;
  }
}

TEST_F(Cli, AnotherSeedIsAnotherChanceForEveryVariant) {
  const auto run_of = [](const std::string& out, const std::string& seed) {
    const Result r = run("run walk --front-end off --seed " + seed + " --out " + out);
    EXPECT_EQ(r.code, 0) << r.err;
    return text_of(path(out) / "trajectory.txt");
  };
  const std::string as_it_is = run_of("chance_0", "0"), once = run_of("chance_1", "1");
  EXPECT_EQ(once, run_of("chance_1_again", "1"));
  EXPECT_NE(once, as_it_is);
  EXPECT_NE(once, run_of("chance_2", "2"));
  // What is left out is the tracker's affair: statistics are of what the front end kept.
  EXPECT_EQ(json_of(path("chance_1") / "stats.json")["keypoints"]["kept"],
            json_of(path("chance_0") / "stats.json")["keypoints"]["kept"]);
}

TEST_F(Cli, WorstFramesAreFoundByTheirMasks) {
  // One frame's mask is all wrong.
  fs::copy(path("walk"), path("wrong"), fs::copy_options::recursive);
  std::vector<fs::path> masks;
  for (const auto& entry : fs::directory_iterator(path("wrong") / "masks_gt"))
    masks.push_back(entry.path());
  std::sort(masks.begin(), masks.end());
  const cv::Mat truth = cv::imread(masks[6].string(), cv::IMREAD_UNCHANGED);
  cv::imwrite(masks[6].string(), cv::Mat(truth == 0));
  const Result r = run("run wrong --out worst_out --save-worst 2");
  ASSERT_EQ(r.code, 0) << r.err;
  EXPECT_NE(r.out.find("worst/"), std::string::npos) << r.out;
  // Twelve frames are 0.4 s: there is room for two, a quarter of a second apart.
  const std::size_t found = files_in(path("worst_out") / "worst", ".png");
  EXPECT_GE(found, 1u);
  EXPECT_LE(found, 2u);
  const cv::Mat sheet = cv::imread(
      (path("worst_out") / "worst" / ("01_" + masks[6].stem().string() + ".png")).string());
  EXPECT_EQ(sheet.size(), cv::Size(3 * 160, 2 * (120 + 26))) << "the worst one comes first";

  fs::remove_all(path("wrong") / "masks_gt");
  expect_error("run wrong --out none --save-worst 2", 1, "masks_gt");
}

TEST_F(Cli, FrontEndCanBeSwitchedOff) {
  Result r = run("run walk --out off --front-end off --save-masks --frames 6");
  ASSERT_EQ(r.code, 0) << r.err;
  const Json off = json_of(path("off") / "stats.json");
  EXPECT_EQ(off["frames"], 6);
  EXPECT_EQ(off["settings"]["front_end"], "off");
  EXPECT_FALSE(off.contains("masks"));
  EXPECT_GT(off["keypoints"]["kept_on_people"], 0.02);
  EXPECT_GT(off["map"]["ghost_share"], 0.02);

  r = run("run walk --out part --without depth --without compensation --tracker vo --preset paper");
  ASSERT_EQ(r.code, 0) << r.err;
  const Json part = json_of(path("part") / "stats.json");
  EXPECT_EQ(part["settings"]["without"], Json({"depth", "compensation"}));
  EXPECT_EQ(part["settings"]["preset"], "paper");
  // Nothing repaired: the masks are the given ones.
  EXPECT_DOUBLE_EQ(part["masks"]["iou_before"], part["masks"]["iou_after"]);
  EXPECT_LT(part["keypoints"]["kept_on_people"], off["keypoints"]["kept_on_people"]);
}

TEST_F(Cli, SegmenterIsChosenAndSaid) {
  fs::copy(path("walk"), path("bare"), fs::copy_options::recursive);
  fs::remove_all(path("bare") / "masks");
  fs::remove_all(path("bare") / "masks_gt");
  fs::remove(path("bare") / "groundtruth.txt");
  const Result r = run("run bare --out bare_out --frames 4");
  ASSERT_EQ(r.code, 0) << r.err;
  EXPECT_NE(r.out.find("no folder masks"), std::string::npos) << r.out;
  const Json stats = json_of(path("bare_out") / "stats.json");
  EXPECT_FALSE(stats.contains("evaluation"));
  EXPECT_FALSE(stats.contains("masks"));
  EXPECT_EQ(stats["coverage_of"], "frames");
  EXPECT_EQ(stats["status"]["never_segmented"], 4);
}

TEST_F(Cli, WrongDepthFactorIsCalledOut) {
  const auto with_factor = [&](const std::string& name, const std::string& factor) {
    fs::copy(path("walk"), path(name), fs::copy_options::recursive);
    std::string yaml = text_of(path(name) / "camera.yaml");
    const std::string key = "DepthMapFactor: 5000";
    yaml.replace(yaml.find(key), key.size(), "DepthMapFactor: " + factor);
    std::ofstream(path(name) / "camera.yaml") << yaml;
  };
  for (const std::string factor : {"1000", "1"}) {
    with_factor("factor" + factor, factor);
    const Result r = run("run factor" + factor + " --out factor_out");
    EXPECT_EQ(r.err.compare(0, 21, "stillpoint: warning: "), 0) << r.err;
    EXPECT_NE(r.err.find("metre) of " + factor + " is likely wrong"), std::string::npos) << r.err;
    EXPECT_NE(r.err.find("5000 would give"), std::string::npos) << r.err;
    const Json stats = json_of(path("factor_out") / "stats.json");
    EXPECT_FALSE(stats["notes"].empty());
    // No pose at all is a failure, with the results there to look at.
    EXPECT_EQ(r.code, stats["tracked"] == 0 ? 1 : 0) << r.err;
    EXPECT_EQ(stats["tracked"] == 0, r.err.find("no frame was tracked") != std::string::npos);
  }
  // Millimetres that are read as 5000 units per metre.
  fs::copy(path("walk"), path("mm"), fs::copy_options::recursive);
  for (const auto& entry : fs::directory_iterator(path("mm") / "depth")) {
    cv::Mat depth = cv::imread(entry.path().string(), cv::IMREAD_UNCHANGED);
    depth.convertTo(depth, CV_16U, 0.2);
    cv::imwrite(entry.path().string(), depth);
  }
  const Result r = run("run mm --out mm_out --front-end off");
  EXPECT_NE(r.err.find("1000 would give"), std::string::npos) << r.err;
}

TEST_F(Cli, HalfTheDepthIsNoticedBesideGroundTruth) {
  fs::copy(path("walk"), path("half"), fs::copy_options::recursive);
  std::string camera = text_of(path("half") / "camera.yaml");
  camera.replace(camera.find("DepthMapFactor: 5000"), 20, "DepthMapFactor: 10000");
  std::ofstream(path("half") / "camera.yaml") << camera;
  const Result r = run("run half --out half_out");
  EXPECT_EQ(r.code, 0) << r.err;
  EXPECT_NE(r.err.find("; about 50"), std::string::npos) << r.err;
  const std::string notes = json_of(path("half_out") / "stats.json")["notes"].dump();
  EXPECT_NE(notes.find("in place of 10000 would fit"), std::string::npos) << notes;
}

TEST_F(Cli, ATrackerThatNeverTracksIsAFailure) {
  copy_with_blind_frames("blind", 0, 12, 0);
  for (const auto& entry : fs::directory_iterator(path("blind") / "depth")) {
    const cv::Mat depth = cv::imread(entry.path().string(), cv::IMREAD_UNCHANGED);
    cv::imwrite(entry.path().string(), cv::Mat::zeros(depth.size(), CV_16UC1));
  }
  const Result r = run("run blind --out blind_out --segmenter none");
  EXPECT_EQ(json_of(path("blind_out") / "stats.json")["tracked"], 0);
  EXPECT_EQ(r.code, 1) << r.err;
  EXPECT_NE(r.err.find("no frame was tracked"), std::string::npos) << r.err;
}

TEST_F(Cli, AScaleThatIsWrongIsSaid) {
  Trajectory truth, small;
  for (int i = 0; i < 20; ++i) {
    StampedPose pose;
    pose.timestamp = 1 + i * 0.1;
    pose.T_world_camera.setIdentity();
    pose.T_world_camera.translation() << 0.1 * i, std::sin(0.5 * i), 0.3;
    truth.push_back(pose);
    pose.T_world_camera.translation() *= 0.2;
    small.push_back(pose);
  }
  write_trajectory(path("scale_truth.txt"), truth);
  write_trajectory(path("scale_small.txt"), small);
  const Result wrong = run("evaluate --groundtruth scale_truth.txt --estimate scale_small.txt");
  EXPECT_NE(wrong.err.find("is 0.20 times as large"), std::string::npos) << wrong.err;
  EXPECT_NE(wrong.err.find("depth factor (units per metre) right? One 0.20 times as large"),
            std::string::npos)
      << wrong.err;
  // A camera that stood, and an estimate that a passer-by carried away: no scale explains that.
  for (std::size_t i = 0; i < truth.size(); ++i) {
    truth[i].T_world_camera.translation() *= 0.001;
    truth[i].T_world_camera.translation().x() += i % 2 == 0 ? 0.003 : -0.003;
  }
  write_trajectory(path("scale_still.txt"), truth);
  const Result still = run("evaluate --groundtruth scale_still.txt --estimate scale_small.txt");
  EXPECT_TRUE(still.err.empty()) << still.err;
  const Result right = run("evaluate --groundtruth scale_truth.txt --estimate scale_truth.txt");
  EXPECT_TRUE(right.err.empty()) << right.err;
}

TEST_F(Cli, LostFramesAreSaid) {
  copy_with_blind_frames("black", 5, 8, 0);
  const Result r = run("run black --out black_out");
  ASSERT_EQ(r.code, 0) << r.err;
  const Json stats = json_of(path("black_out") / "stats.json");
  EXPECT_EQ(stats["tracked"], 9);
  EXPECT_NEAR(stats["coverage"], 0.75, 1e-9);
  ASSERT_EQ(stats["lost"].size(), 1u);
  EXPECT_EQ(stats["lost"][0]["frames"], 3);
  EXPECT_NEAR(stats["lost"][0]["from_s"], 5 / 30.0, 1e-3);
  EXPECT_TRUE(stats["lost"][0]["found_again"]);
  EXPECT_EQ(stats["status"]["no_keypoints"], 3);
  EXPECT_LT(stats["evaluation"]["ate_rmse_m"], 0.05);
  EXPECT_NE(r.out.find("3 frames from 0.17 to 0.23 s, then found again"), std::string::npos)
      << r.out;
}

TEST_F(Cli, WhatIsLeftOutOrCannotBeIsSaid) {
  fs::copy(path("walk"), path("sparse"), fs::copy_options::recursive);
  std::ifstream list(path("walk") / "depth.txt");
  std::ofstream third(path("sparse") / "depth.txt");
  int n = 0;
  for (std::string line; std::getline(list, line);)
    if (line[0] != '#' && n++ % 3 == 0) third << line << "\n";
  third.close();
  const std::string words = "8 of 12 listed color images have no depth within 0.02 s";
  const Result sparse = run("run sparse --front-end off --out sparse_out");
  EXPECT_EQ(sparse.code, 0) << sparse.err;
  EXPECT_NE(sparse.err.find(words), std::string::npos) << sparse.err;
  EXPECT_NE(run("mask sparse --out sparse_masks").err.find(words), std::string::npos);
  EXPECT_EQ(run("run walk --front-end off --out walk_out").err.find("listed"), std::string::npos);

  std::string yaml = text_of(path("walk") / "camera.yaml");
  const std::size_t cx = yaml.find("Camera.cx:");
  ASSERT_NE(cx, std::string::npos);
  yaml.replace(cx, yaml.find('\n', cx) - cx, "Camera.cx: 640");
  std::ofstream(path("large.yaml")) << yaml;
  const Result large = run("run walk --frames 3 --front-end off --camera large.yaml --out large");
  EXPECT_NE(large.err.find("principal point, 640.0"), std::string::npos) << large.err;

  expect_error("run walk --out nofile --save-objects no/such/file.csv", 1,
               "found no folder no/such");
  EXPECT_FALSE(fs::exists(path("nofile") / "stats.json"));
}

TEST_F(Cli, TwoPosesOfGroundTruthEndNoRun) {
  fs::copy(path("walk"), path("short"), fs::copy_options::recursive);
  std::vector<double> times;
  std::ifstream list(path("walk") / "rgb.txt");
  for (std::string line; std::getline(list, line);)
    if (line[0] != '#') times.push_back(std::stod(line));
  std::ofstream truth(path("short") / "groundtruth.txt");
  truth.precision(17);
  for (const std::size_t i : {3, 7}) truth << (times[i] + times[i + 1]) / 2 << " 0 0 0 0 0 0 1\n";
  truth.close();
  const Result r = run("run short --front-end off --out short_out");
  EXPECT_EQ(r.code, 0) << r.err;
  EXPECT_NE(r.err.find("fewer than three pairs"), std::string::npos) << r.err;
  EXPECT_FALSE(json_of(path("short_out") / "stats.json").contains("evaluation"));
}

}  // namespace
}  // namespace stillpoint
