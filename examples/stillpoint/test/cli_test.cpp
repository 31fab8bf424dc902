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

  // A truncated image.
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

}  // namespace
}  // namespace stillpoint
