// SPDX-License-Identifier: BSD-2-Clause
//
// Drives the built program as a user would: exit codes, messages, files.

#include <cmath>
#include <cstdio>
#include <opencv2/imgproc.hpp>
#include <sstream>

#include "cli_fixture.hpp"
#include "stillpoint/io/trajectory_file.hpp"

namespace stillpoint {
namespace {

TEST_F(Cli, HelpTeaches) {
  const Result all = run("--help");
  EXPECT_EQ(all.code, 0);
  for (const char* word : {"synth", "run", "evaluate", "mask", "bench", "metres"})
    EXPECT_NE(all.out.find(word), std::string::npos) << word;
  for (const char* command : {"synth", "run", "evaluate", "mask", "bench"}) {
    const Result r = run(std::string(command) + " --help");
    EXPECT_EQ(r.code, 0) << command;
    EXPECT_NE(r.out.find("Example"), std::string::npos) << command;
    std::istringstream lines(r.out);
    for (std::string line; std::getline(lines, line);) EXPECT_LE(line.size(), 110u) << line;
  }
  EXPECT_NE(run("--version").out.find("stillpoint "), std::string::npos);
}

TEST_F(Cli, MisuseIsAnswered) {
  expect_error("", 2, "--help");
  expect_error("walk", 2, "unknown command \"walk\"");
  expect_error("run", 2, "SEQUENCE");
  expect_error("run walk", 2, "--out");
  expect_error("run walk --out out --preset best", 2, "default,network_only,paper");
  expect_error("run walk --out out --front-end maybe", 2, "on,off");
  expect_error("run walk --out out --without everything", 2, "compensation,depth,probability");
  expect_error("run walk --out out --segmenter oracle", 2, "mask_files");
  expect_error("run walk --out out --frames 0", 2, "--frames");
  expect_error("run walk --out out --save-overlays often", 2, "--save-overlays");
  expect_error("run walk --out out --no-such-option", 2, "--no-such-option");
  expect_error("synth other --size 320", 2, "WIDTHxHEIGHT");
  expect_error("synth other --motion dance", 2, "halfsphere");
  expect_error("synth other --people many", 2, "--people");
  expect_error("bench --out b", 2, "SEQUENCE");
  expect_error("bench walk --out b --shard 2/2", 2, "I/N");
  expect_error("bench walk --out b --variants best", 2, "no_depth");
  expect_error("evaluate --estimate a", 2, "--groundtruth");
}

TEST_F(Cli, BadInputIsNamed) {
  expect_error("run nowhere --out out", 1, "nowhere");
  expect_error("run walk --out out --camera fr9", 1, "fr1, fr2, fr3, bonn");
  expect_error("run walk --out out --masks nowhere", 1, "nowhere");
  expect_error("run walk --out out --masks walk/rgb --segmenter none", 1, "mask_files");
  expect_error("run walk --out walk", 1, "sequence itself");
  expect_error("run walk --out walk/rgb.txt", 1, "rgb.txt");
  expect_error("evaluate --groundtruth walk/groundtruth.txt --estimate nowhere", 1, "nowhere");
  expect_error("evaluate --groundtruth walk/groundtruth.txt --estimate walk/rgb.txt", 1, "line");
  expect_error("mask walk --network-only --segmenter none --out masks", 1, "needs a segmenter");
  expect_error("bench nowhere --out b", 1, "nowhere");
  expect_error("bench --merge nowhere --out b", 1, "nowhere");

  fs::copy(path("walk"), path("foreign"), fs::copy_options::recursive);
  std::ofstream(path("foreign") / "rgb.txt") << "# color images\n1.0 rgb/1.0.png\n";
  expect_error("synth foreign --frames 2 --size 64x48", 1, "another folder");

  // No camera: the choices are listed, and the name of the folder is read.
  fs::copy(path("walk"), path("freiburg3_walk"), fs::copy_options::recursive);
  fs::remove(path("freiburg3_walk") / "camera.yaml");
  expect_error("run freiburg3_walk --out out", 1, "--camera fr1, fr2, fr3, bonn");
  expect_error("run freiburg3_walk --out out", 1, "speaks of --camera fr3");

  // A truncated picture.
  fs::copy(path("walk"), path("cut"), fs::copy_options::recursive);
  for (const auto& entry : fs::directory_iterator(path("cut") / "rgb"))
    fs::resize_file(entry.path(), fs::file_size(entry.path()) / 2);
  expect_error("run cut --out out", 1, "truncated");
}

TEST_F(Cli, SettingsAreChangedByTheirNames) {
  const auto settings = [&](const std::string& options) {
    const Result r = run("run walk --out changed --tracker vo --frames 3 " + options);
    EXPECT_EQ(r.code, 0) << r.err;
    return json_of(path("changed") / "stats.json")["settings"];
  };
  const Json plain = settings("");
  EXPECT_EQ(plain["all"]["depth.dilation_px"], 10);
  EXPECT_EQ(plain["all"]["use_motion"], true);
  const Json changed =
      settings("--sensor realsense_d400 --set dilation_px=3 --set late.predict=false");
  EXPECT_EQ(changed["all"]["depth.dilation_px"], 3);
  EXPECT_EQ(changed["all"]["late.predict"], false);
  EXPECT_EQ(changed["all"]["sensor.max_range_m"], 3);
  EXPECT_EQ(changed["changed"], Json({"dilation_px=3", "late.predict=false"}));

  const std::string start = "run walk --out b --set ";
  expect_error(start + "dilaton_px=3", 2, "nearest is depth.dilation_px");
  expect_error(start + "growth_m=3", 2, "depth.growth_m and motion.movers.growth_m");
  expect_error(start + "dilation_px=2.5", 2, "a whole number, found \"2.5\"");
  expect_error(start + "use_motion=2", 2, "true or false, found \"2\"");
  expect_error(start + "dilation_px", 2, "NAME=VALUE");
  expect_error(start + "depth.method=literal", 2, "paper or connected");
  expect_error(start + "dilation_px=-1", 1, "dilation_px");
  expect_error("run walk --out b --sensor kinect", 2, "realsense_d400");
}

TEST_F(Cli, SettingsComeFromAFileAndGoIntoOne) {
  const auto settings = [&](const std::string& options, const std::string& out) {
    const Result r = run("run walk --tracker vo --frames 3 --out " + out + " " + options);
    EXPECT_EQ(r.code, 0) << r.err;
    return json_of(path(out) / "stats.json")["settings"];
  };
  std::ofstream(path("mine.yaml")) << "depth:\n  dilation_px: 5\n  method: paper\n"
                                      "motion.movers: {min_moved_cells: 9}\n"
                                      "threshold: 0.3\nsensor.max_range_m: 6\n"
                                      "dynamic_classes: [[person, 0.75]]\n";
  const Json mine = settings("--settings mine.yaml --set depth.dilation_px=7 --seed 3", "mine");
  EXPECT_EQ(mine["all"]["depth.dilation_px"], 7);  // --set wins
  EXPECT_EQ(mine["all"]["depth.method"], "paper");
  EXPECT_EQ(mine["all"]["motion.movers.min_moved_cells"], 9);
  EXPECT_NEAR(mine["all"]["probability.threshold"], 0.3, 1e-6);
  EXPECT_EQ(mine["all"]["sensor.max_range_m"], 6);
  EXPECT_EQ(mine["dynamic_classes"]["person"], 0.75);
  EXPECT_EQ(mine["settings_file"], "mine.yaml");

  // What a run writes gives the same settings, and the same file, over any preset.
  const Json again = settings("--preset paper --settings mine/settings.yaml --seed 3", "again");
  EXPECT_EQ(again["all"], mine["all"]);
  EXPECT_EQ(again["dynamic_classes"], mine["dynamic_classes"]);
  EXPECT_EQ(text_of(path("again") / "settings.yaml"), text_of(path("mine") / "settings.yaml"));
  EXPECT_EQ(text_of(path("again") / "trajectory.txt"), text_of(path("mine") / "trajectory.txt"));
  EXPECT_EQ(run("run walk --tracker vo --frames 2 --out none --segmenter none --settings "
                "mine/settings.yaml")
                .code,
            0);
  expect_error("bench walk --out b --settings mine/settings.yaml --variants paper,default", 1,
               "the presets paper and default different");

  const auto refused = [&](const std::string& yaml, const std::string& words) {
    std::ofstream(path("bad.yaml")) << yaml;
    expect_error("run walk --out refused --settings bad.yaml", 1, words);
    expect_error("bench walk --out refused --settings bad.yaml", 1, words);
    EXPECT_FALSE(fs::exists(path("refused")));
  };
  refused("depth:\n  dilaton_px: 3\n", "bad.yaml, line 2: setting \"depth.dilaton_px\"");
  refused("depth:\n  dilaton_px: 3\n", "the nearest is depth.dilation_px");
  refused("growth_m: 3\n", "depth.growth_m and motion.movers.growth_m");
  refused("use_depth: perhaps\n", "line 1: setting use_depth: expected true or false");
  refused("depth: 3\n", "line 1: setting \"depth\"");
  refused("dilation_px: [3]\n", "expected a value of dilation_px");
  refused("dilation_px: 3\ndepth: {dilation_px: 4}\n", "depth.dilation_px: found twice");
  refused("- dilation_px\n", "expected lines of `name: value`");
  refused("depth: {dilation_px\n", "expected YAML");
  refused("dynamic_classes: [[person, most]]\n", "a list of names or [name, prior]");
  expect_error("run walk --out refused --settings absent.yaml", 1, "no such file");
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
  std::vector<fs::path> pictures;
  for (const auto& entry : fs::directory_iterator(path("ends") / "rgb"))
    pictures.push_back(entry.path());
  std::sort(pictures.begin(), pictures.end());
  fs::resize_file(pictures.back(), 0);
  expect_error(command, 1, "what was tracked before it is in ends_out/trajectory.txt.partial");
  EXPECT_EQ(contents(), good);
  EXPECT_EQ(read_trajectory(path("ends_out") / "trajectory.txt.partial").size(), 11u);

  // The next run that ends well clears up.
  fs::copy(path("walk") / "rgb" / pictures.back().filename(), pictures.back(),
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
  EXPECT_NE(wrong.err.find("depth factor"), std::string::npos) << wrong.err;
  const Result right = run("evaluate --groundtruth scale_truth.txt --estimate scale_truth.txt");
  EXPECT_TRUE(right.err.empty()) << right.err;
}

TEST_F(Cli, EvaluatePrintsItsKeys) {
  ASSERT_EQ(run("run walk --out eval --tracker vo").code, 0);
  const std::string files = "--groundtruth walk/groundtruth.txt --estimate eval/trajectory.txt";
  const Result r = run("evaluate --json " + files);
  ASSERT_EQ(r.code, 0) << r.err;
  const Json json = Json::parse(r.out);
  for (const char* key : {"ate_rmse_m", "ate_sd_m", "ate_mean_m", "ate_median_m", "ate_max_m",
                          "rpe_trans_m", "rpe_rot_deg", "coverage", "pairs"})
    EXPECT_TRUE(json[key].is_number()) << key;
  EXPECT_EQ(json["pairs"], 12);
  EXPECT_DOUBLE_EQ(json["coverage"], 1);
  // The file has a finite number of digits.
  EXPECT_NEAR(json["ate_rmse_m"], json_of(path("eval") / "stats.json")["evaluation"]["ate_rmse_m"],
              1e-7);
  EXPECT_NE(run("evaluate " + files).out.find("ATE"), std::string::npos);

  // A quarter of the poses: a small error, and said to be a failure.
  const Trajectory all = read_trajectory(path("eval") / "trajectory.txt");
  write_trajectory(path("eval") / "short.txt", Trajectory(all.begin(), all.begin() + 4));
  const Result cut =
      run("evaluate --groundtruth walk/groundtruth.txt --estimate eval/short.txt --frames "
          "walk/rgb.txt");
  EXPECT_EQ(cut.code, 0);
  EXPECT_NE(cut.out.find("33.3 %"), std::string::npos) << cut.out;
  EXPECT_NE(cut.out.find("FAILED"), std::string::npos) << cut.out;
}

TEST_F(Cli, EvaluateAndRunAgreeOnTheCoverage) {
  // A camera that dropped two frames, and one color picture without depth: neither is lost track.
  fs::copy(path("walk"), path("gaps"), fs::copy_options::recursive);
  fs::remove(path("gaps") / "associations.txt");
  const auto shorten = [&](const char* list, std::vector<int> dropped) {
    std::istringstream in(text_of(path("walk") / list));
    std::ofstream out(path("gaps") / list, std::ios::binary);
    int frame = 0;
    for (std::string line; std::getline(in, line);)
      if (line[0] == '#' || std::find(dropped.begin(), dropped.end(), frame++) == dropped.end())
        out << line << "\n";
  };
  shorten("rgb.txt", {4, 5});
  shorten("depth.txt", {4, 5, 8});
  ASSERT_EQ(run("run gaps --out gaps_out --tracker vo").code, 0);
  const Json stats = json_of(path("gaps_out") / "stats.json");
  EXPECT_EQ(stats["coverage"], 1.0);
  const std::string files =
      "evaluate --json --groundtruth gaps/groundtruth.txt --estimate gaps_out/trajectory.txt";
  for (const char* frames : {"", " --frames gaps/rgb.txt"}) {
    const Result r = run(files + frames);
    ASSERT_EQ(r.code, 0) << r.err;
    EXPECT_EQ(Json::parse(r.out)["coverage"], stats["coverage"]) << frames;
    EXPECT_EQ(Json::parse(r.out)["frames_from"], "gaps/rgb.txt") << frames;
  }
  // Nothing but trajectories: a guess, said to be one.
  fs::copy(path("gaps") / "groundtruth.txt", path("alone.txt"));
  EXPECT_NE(run("evaluate --groundtruth alone.txt --estimate gaps_out/trajectory.txt")
                .out.find("frames are guessed"),
            std::string::npos);
}

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
