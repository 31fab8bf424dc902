// SPDX-License-Identifier: BSD-2-Clause
//
// Drives the built program as a user would: exit codes, messages, files.

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "stillpoint/io/trajectory_file.hpp"

namespace stillpoint {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

std::string text_of(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

Json json_of(const fs::path& path) { return Json::parse(text_of(path)); }

std::size_t files_in(const fs::path& folder, const std::string& ending) {
  std::size_t n = 0;
  for (const auto& entry : fs::directory_iterator(folder)) n += entry.path().extension() == ending;
  return n;
}

long lines_of(const std::string& text) { return std::count(text.begin(), text.end(), '\n'); }

struct Result {
  int code = -1;
  std::string out, err;
};

class Cli : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new fs::path(fs::temp_directory_path() /
                           ("stillpoint_cli_test_" + std::to_string(getpid())));
    fs::remove_all(*folder_);
    fs::create_directories(*folder_);
    const Result made =
        run("synth walk --motion xyz --people 2 --frames 12 --size 320x240 --shutter-ms 10");
    ASSERT_EQ(made.code, 0) << made.err;
  }
  static void TearDownTestSuite() {
    std::error_code ignored;
    fs::remove_all(*folder_, ignored);
    delete folder_;
  }

  /// Runs the program in the test's folder with arguments as written in a shell.
  static Result run(const std::string& arguments) {
    const fs::path out = *folder_ / "stdout.txt", err = *folder_ / "stderr.txt";
    const std::string command = "cd '" + folder_->string() + "' && '" STILLPOINT_CLI "' " +
                                arguments + " >'" + out.string() + "' 2>'" + err.string() + "'";
    const int status = std::system(command.c_str());
    Result result;
    result.code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    result.out = text_of(out);
    result.err = text_of(err);
    return result;
  }

  /// One line "stillpoint: ..." on stderr with `words`, and the exit code.
  static void expect_error(const std::string& arguments, int code, const std::string& words) {
    const Result r = run(arguments);
    EXPECT_EQ(r.code, code) << arguments << "\n" << r.err;
    EXPECT_EQ(r.err.compare(0, 12, "stillpoint: "), 0) << arguments << "\n" << r.err;
    EXPECT_EQ(lines_of(r.err), 1) << arguments << "\n" << r.err;
    EXPECT_NE(r.err.find(words), std::string::npos) << arguments << "\n" << r.err;
  }

  static fs::path path(const std::string& name) { return *folder_ / name; }

  /// A copy of the sequence whose frames from `begin` on, before `end`, are of one gray.
  static void copy_with_blind_frames(const std::string& name, std::size_t begin, std::size_t end,
                                     int gray) {
    fs::copy(path("walk"), path(name), fs::copy_options::recursive);
    std::vector<fs::path> pictures;
    for (const auto& entry : fs::directory_iterator(path(name) / "rgb"))
      pictures.push_back(entry.path());
    std::sort(pictures.begin(), pictures.end());
    ASSERT_LE(end, pictures.size());
    for (std::size_t i = begin; i < end; ++i)
      cv::imwrite(pictures[i].string(), cv::Mat(240, 320, CV_8UC3, cv::Scalar::all(gray)));
  }

  static fs::path* folder_;
};
fs::path* Cli::folder_ = nullptr;

TEST_F(Cli, HelpTeaches) {
  const Result all = run("--help");
  EXPECT_EQ(all.code, 0);
  for (const char* word : {"synth", "run", "evaluate", "segment", "bench", "metres"})
    EXPECT_NE(all.out.find(word), std::string::npos) << word;
  for (const char* command : {"synth", "run", "evaluate", "segment", "bench"}) {
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
  expect_error("segment walk --segmenter none --out masks", 1, "--segmenter");
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
  expect_error(start + "dilation_px=2.5", 2, "a whole number, found 2.5");
  expect_error(start + "use_motion=2", 2, "true or false, found 2");
  expect_error(start + "dilation_px", 2, "NAME=NUMBER");
  expect_error(start + "dilation_px=-1", 1, "dilation_px");
  expect_error("run walk --out b --sensor kinect", 2, "realsense_d400");
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
  fs::copy(path("walk"), path("factor"), fs::copy_options::recursive);
  std::string yaml = text_of(path("factor") / "camera.yaml");
  const std::string key = "DepthMapFactor: 5000";
  yaml.replace(yaml.find(key), key.size(), "DepthMapFactor: 1");
  std::ofstream(path("factor") / "camera.yaml") << yaml;
  const Result r = run("run factor --out factor_out --frames 2");
  EXPECT_EQ(r.code, 0) << r.err;
  EXPECT_EQ(r.err.compare(0, 21, "stillpoint: warning: "), 0) << r.err;
  EXPECT_NE(r.err.find("5000 would give"), std::string::npos) << r.err;
  EXPECT_FALSE(json_of(path("factor_out") / "stats.json")["notes"].empty());
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

TEST_F(Cli, SegmentCopiesMasksInItsFormat) {
  const Result r = run("segment walk --masks walk/masks_gt --out seg");
  ASSERT_EQ(r.code, 0) << r.err;
  EXPECT_EQ(files_in(path("seg"), ".png"), 12u);
  for (const auto& entry : fs::directory_iterator(path("seg"))) {
    const cv::Mat made = cv::imread(entry.path().string(), cv::IMREAD_UNCHANGED);
    const cv::Mat truth = cv::imread((path("walk") / "masks_gt" / entry.path().filename()).string(),
                                     cv::IMREAD_UNCHANGED);
    EXPECT_EQ(cv::countNonZero((made > 0) != (truth > 0)), 0) << entry.path();
  }
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
  expect_error("segment walk --out net --model broken.onnx", 1, "whole ONNX file");
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
  expect_error("segment walk --out net --model network.pt --model-config a.pbtxt", 1, "opencv_dnn");
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
  expect_error("segment walk --out classes --masks walk/masks_gt --dynamic persn", 1, "\"person\"");
  expect_error("run walk --out classes --segmenter none --dynamic persn", 1, "--segmenter none");
  EXPECT_FALSE(fs::exists(path("classes")));
  EXPECT_EQ(run("run walk --out classes --tracker vo --frames 3 --dynamic person=0.9").code, 0);
}

TEST_F(Cli, NetworksSegment) {
  const std::string graphs = STILLPOINT_TEST_GRAPHS;
  if (!fs::exists(graphs + "/fastestdet.onnx")) GTEST_SKIP() << "no graphs in " << graphs;
  const std::string boxes = " --model '" + graphs + "/fastestdet.onnx' ";
  const Result r = run("segment walk --out net_masks" + boxes);
  ASSERT_EQ(r.code, 0) << r.err;
  EXPECT_EQ(files_in(path("net_masks"), ".png"), 12u);
  EXPECT_NE(r.out.find("12 with a result, 36 instances"), std::string::npos) << r.out;
  const Result all = run("segment walk --out net_all --dynamic person,tv=0.5" + boxes);
  EXPECT_NE(all.out.find("48 instances"), std::string::npos) << all.out;
  expect_error("segment walk --out net_all --dynamic persn" + boxes, 1, "person, bicycle");
  expect_error("run walk --out net --decoder detr" + boxes, 1, "no decoder \"detr\"");
  expect_error("run walk --out net --input-size 100" + boxes, 1, "WIDTHxHEIGHT");
  expect_error("run walk --out net --input-size 128x128" + boxes, 1, "made for, 96x64");
  EXPECT_EQ(run("run walk --out net --decoder fastestdet" + boxes).code, 0);
  EXPECT_EQ(run("run walk --out net --async" + boxes).code, 0);
}

TEST_F(Cli, BenchComparesAndGoesOn) {
  const std::string command = "bench walk --out b --tracker vo --frames 8";
  const Result r = run(command);
  ASSERT_EQ(r.code, 0) << r.err;
  for (const char* label : {"front end off", "paper preset", "network_only preset",
                            "default preset", "without compensation", "without depth",
                            "without probability", "without any masks", "ground-truth masks"})
    EXPECT_NE(r.out.find(label), std::string::npos) << label;
  const Json rows = json_of(path("b") / "results.json")["rows"];
  ASSERT_EQ(rows.size(), 9u);
  for (const Json& row : rows) {
    EXPECT_EQ(row["runs"], 1);
    EXPECT_EQ(row["failed"], "") << row["label"];
    EXPECT_DOUBLE_EQ(row["coverage_min"], 1) << row["label"];
    EXPECT_TRUE(row["ate_rmse_m"].is_number()) << row["label"];
  }
  EXPECT_DOUBLE_EQ(rows[8]["mask_iou_after"], 1);
  EXPECT_EQ(lines_of(text_of(path("b") / "results.csv")), 10);

  const std::string page = text_of(path("b") / "index.html");
  EXPECT_NE(page.find("<svg"), std::string::npos);
  EXPECT_NE(page.find("data:image/jpeg;base64,"), std::string::npos);
  EXPECT_NE(page.find("; with the default preset: <b>"), std::string::npos) << "what run takes";
  for (const char* outside : {"src=\"http", "href=\"http", "<script", "url("})
    EXPECT_EQ(page.find(outside), std::string::npos) << outside;

  // Again: nothing runs, unless a result is gone or its settings differ.
  EXPECT_EQ(run(command).out.find(" s)"), std::string::npos);
  fs::remove(path("b") / "runs/walk/default.0.json");
  const Result again = run(command);
  const auto count = [](const std::string& text, const std::string& word) {
    std::size_t n = 0;
    for (std::size_t at = 0; (at = text.find(word, at)) != std::string::npos; ++at) ++n;
    return n;
  };
  EXPECT_EQ(count(again.out, "kept from before"), 8u) << again.out;
  EXPECT_EQ(count(run(command + " --features 300").out, "kept from before"), 0u);
}

TEST_F(Cli, BenchShardsAreMerged) {
  const std::string command =
      "bench walk --tracker vo --frames 6 --variants off,default --runs 2 --shard ";
  for (const char* shard : {"0/2 --out s0", "1/2 --out s1"})
    ASSERT_EQ(run(command + shard).code, 0) << shard;
  EXPECT_FALSE(fs::exists(path("s0") / "index.html"));
  const Result r = run("bench --merge s0 s1 --out merged");
  ASSERT_EQ(r.code, 0) << r.err;
  const Json rows = json_of(path("merged") / "results.json")["rows"];
  ASSERT_EQ(rows.size(), 2u);
  for (const Json& row : rows) EXPECT_EQ(row["runs"], 2);
  EXPECT_TRUE(fs::exists(path("merged") / "index.html"));

  // A run that is missing is named with its shard, and merged without only if told so.
  fs::remove(path("s1") / "runs/walk/off.1.json");
  expect_error("bench --merge s0 s1 --out lacking", 1, "1 of 4 runs are missing: runs/walk/off.1");
  expect_error("bench --merge s0 --out lacking", 1, "(shard 1/2)");
  EXPECT_FALSE(fs::exists(path("lacking")));
  const Result part = run("bench --merge s0 s1 --partial --out lacking");
  ASSERT_EQ(part.code, 0) << part.err;
  EXPECT_NE(part.out.find("front end off (1 of 2 runs)"), std::string::npos) << part.out;
  EXPECT_NE(part.out.find("incomplete: 1 of 4 runs"), std::string::npos) << part.out;
  EXPECT_NE(text_of(path("lacking") / "index.html").find("(1 of 2 runs)"), std::string::npos);
  for (const Json& row : json_of(path("lacking") / "results.json")["rows"]) {
    EXPECT_EQ(row["failed"], row["variant"] == "off" ? "incomplete" : "");
    EXPECT_EQ(row["runs_planned"], 2);
  }
  expect_error("bench walk --partial --out lacking", 2, "--merge");
}

TEST_F(Cli, BenchMergesNoMixture) {
  const std::string command = "bench walk --tracker vo --frames 4 --variants off --runs 2 --shard ";
  for (const char* shard : {"0/2 --out mix0", "1/2 --out mix1"})
    ASSERT_EQ(run(command + shard).code, 0) << shard;
  ASSERT_EQ(run("bench walk --tracker vo --frames 4 --variants off --runs 2 --features 300 "
                "--shard 0/2 --out mix_stale")
                .code,
            0);
  ASSERT_EQ(run("bench walk --tracker vo --frames 4 --variants off --runs 1 --out mix_short").code,
            0);
  for (const char* folders : {"mix_stale mix0 mix1", "mix0 mix1 mix_stale"})
    expect_error("bench --out mixed --merge " + std::string(folders), 1, "features of runs/walk/");
  expect_error("bench --merge mix0 mix1 mix_short --out mixed", 1, "off.1.json");
  fs::create_directories(path("mix_none"));
  expect_error("bench --merge mix0 mix1 mix_none --out mixed", 1, "mix_none/plan.json");
  EXPECT_FALSE(fs::exists(path("mixed")));
  // The results of an earlier bench in a shard's folder are none of this one.
  fs::copy(path("mix_stale") / "runs/walk/off.0.json", path("mix0") / "runs/walk/off.0.json",
           fs::copy_options::overwrite_existing);
  expect_error("bench --merge mix0 mix1 --out mixed", 1, "missing: runs/walk/off.0.json");
}

TEST_F(Cli, NamesOfTheLastVersionAreTakenWithANote) {
  Result r = run("run walk --out named --preset motion --tracker vo --frames 3");
  EXPECT_EQ(r.code, 0) << r.err;
  EXPECT_NE(r.err.find("motion is now called default"), std::string::npos) << r.err;
  EXPECT_EQ(json_of(path("named") / "stats.json")["settings"]["preset"], "default");
  r = run("run walk --out named --preset network_only --tracker vo --frames 3");
  EXPECT_EQ(r.err.find("now called"), std::string::npos) << r.err;
  EXPECT_EQ(json_of(path("named") / "stats.json")["settings"]["all"]["use_motion"], false);
  r = run("bench walk --out bench_named --variants motion,motion_alone --tracker vo --frames 3");
  EXPECT_EQ(r.code, 0) << r.err;
  EXPECT_NE(r.err.find("motion_alone is now called no_masks"), std::string::npos) << r.err;
  EXPECT_TRUE(fs::exists(path("bench_named") / "runs/walk/default.0.json"));
  EXPECT_TRUE(fs::exists(path("bench_named") / "runs/walk/no_masks.0.json"));
}

TEST_F(Cli, BenchJudgesOtherSystemsByTheSameRules) {
  ASSERT_EQ(run("run walk --out other --preset default --tracker vo").code, 0);
  // The first quarter only: its error is small, and it is no result.
  const Trajectory all = read_trajectory(path("other") / "trajectory.txt");
  write_trajectory(path("short_walk.txt"), Trajectory(all.begin(), all.begin() + 4));
  const Result r =
      run("bench walk --out e --variants default --tracker vo --jobs 2 --estimate "
          "whole=other/trajectory.txt --estimate 'cut=short_{}.txt'");
  ASSERT_EQ(r.code, 0) << r.err;
  const Json rows = json_of(path("e") / "results.json")["rows"];
  ASSERT_EQ(rows.size(), 3u);
  for (const Json& row : rows) {
    const std::string label = row["label"];
    EXPECT_EQ(row["failed"], label == "cut" ? "coverage" : "") << label;
    if (label == "whole") {
      EXPECT_NEAR(row["ate_rmse_m"], rows[0]["ate_rmse_m"], 1e-6);
    }
  }
  expect_error("bench walk --out e --estimate nothing", 1, "NAME=FILE");
}

TEST_F(Cli, BenchNeverCallsATruncatedEstimateTheBest) {
  // The first 12 % of the frames, without any error: better than every row, and no result.
  ASSERT_EQ(run("synth long --people 1 --frames 26 --size 160x120 --shutter-ms 0").code, 0);
  const Trajectory truth = read_trajectory(path("long") / "groundtruth.txt");
  const double begin = truth.front().timestamp;
  Trajectory cut, whole = truth;
  for (const StampedPose& pose : truth)
    if (pose.timestamp < begin + 2.1 / 30) cut.push_back(pose);
  for (std::size_t i = 0; i < whole.size(); i += 2)
    whole[i].T_world_camera.translation().x() += 0.003;
  write_trajectory(path("cut.txt"), cut);
  write_trajectory(path("whole.txt"), whole);
  whole[0].T_world_camera.translation().x() += 1e-5;  // worse, but in no digit that is printed
  write_trajectory(path("like.txt"), whole);
  const Result r =
      run("bench long --out trunc --tracker vo --variants off --frames 26 --estimate cut=cut.txt "
          "--estimate whole=whole.txt --estimate like=like.txt");
  ASSERT_EQ(r.code, 0) << r.err;
  const Json rows = json_of(path("trunc") / "results.json")["rows"];
  ASSERT_EQ(rows.size(), 4u);
  int best = 0;
  double smallest = 1;
  for (const Json& row : rows) {
    if (row["label"] == "cut") {
      EXPECT_EQ(row["failed"], "coverage");
      EXPECT_NEAR(row["coverage_min"], 3.0 / 26, 1e-9);
      EXPECT_LT(row["ate_rmse_m"], 1e-6);
      EXPECT_EQ(row["best"], false);
    } else if (row["ate_rmse_m"].is_number()) {
      smallest = std::min(smallest, row["ate_rmse_m"].get<double>());
    }
    if (row["best"] == true) {
      ++best;
      EXPECT_EQ(row["failed"], "");
    }
  }
  EXPECT_EQ(best, 2);
  for (const Json& row : rows) {
    if (row["best"] == true) {
      EXPECT_NEAR(row["ate_rmse_m"].get<double>(), smallest, 5e-5);
    }
  }
}

TEST_F(Cli, EvaluateAndBenchAgreeOnRealTrajectories) {
  const fs::path real = STILLPOINT_SHARED_DATA "/real";
  const fs::path list = real / "associations/fr3_walking_xyz.txt";
  if (!fs::exists(list)) GTEST_SKIP() << "no " << list;
  // The real frames' times; that the pictures are none makes our own row an error, as it should.
  fs::create_directories(path("real") / "rgb");
  fs::create_directories(path("real") / "depth");
  cv::imwrite((path("real") / "none.png").string(), cv::Mat::zeros(1, 1, CV_8UC1));
  std::ofstream rgb(path("real") / "rgb.txt"), depth(path("real") / "depth.txt");
  std::ifstream lines(list);
  for (std::string t, color, td, d; lines >> t >> color >> td >> d;) {
    rgb << t << " " << color << "\n";
    depth << td << " " << d << "\n";
    fs::create_hard_link(path("real") / "none.png", path("real") / color);
    fs::create_hard_link(path("real") / "none.png", path("real") / d);
  }
  rgb.close(), depth.close();
  fs::copy(real / "fr3_walking_xyz/groundtruth.txt", path("real"));
  std::string estimates;
  for (const char* name : {"bf", "cfs", "rm"}) {
    fs::copy(real / ("fr3_walking_xyz/CameraTrajectory_" + std::string(name) + ".txt"),
             path("real_" + std::string(name) + ".txt"));
    estimates += " --estimate " + std::string(name) + "=real_" + name + ".txt";
  }
  EXPECT_EQ(run("bench real --camera fr3 --variants off --out real_bench" + estimates).code, 1);
  const Json rows = json_of(path("real_bench") / "results.json")["rows"];
  ASSERT_EQ(rows.size(), 4u);
  for (const Json& row : rows) {
    if (row["variant"] == "off") {
      EXPECT_EQ(row["failed"], "error");
      continue;
    }
    const std::string name = row["label"];
    const Result r =
        run("evaluate --json --groundtruth real/groundtruth.txt --frames real/rgb.txt "
            "--estimate real_" +
            name + ".txt");
    ASSERT_EQ(r.code, 0) << r.err;
    const Json one = Json::parse(r.out);
    for (const char* key : {"ate_rmse_m", "ate_sd_m", "rpe_trans_m", "rpe_rot_deg"})
      EXPECT_DOUBLE_EQ(row[key], one[key]) << name << " " << key;
    EXPECT_DOUBLE_EQ(row["coverage_min"], one["coverage"]) << name;
    // Keyframes of a part of the sequence only: their error is no result.
    EXPECT_EQ(row["failed"], "coverage") << name;
    EXPECT_EQ(row["best"], false) << name;
  }
}

TEST_F(Cli, BenchPutsThePapersTablesBesideOurs) {
  // Two of the ten are there: one without masks, none with the camera of the data set needed.
  fs::create_directories(path("data"));
  fs::copy(path("walk"), path("data") / "rgbd_bonn_crowd2", fs::copy_options::recursive);
  fs::copy(path("walk"), path("data") / "rgbd_dataset_freiburg3_walking_static",
           fs::copy_options::recursive);
  fs::remove_all(path("data") / "rgbd_bonn_crowd2" / "masks");
  const std::string quick = " --frames 5 --tracker vo ";
  const Result r = run("bench --paper data --out paper --runs 1 --features 500" + quick);
  ASSERT_EQ(r.code, 0) << r.err;
  for (const char* words :
       {"freiburg3_walking_xyz: not in data (scripts/download_tum", "rgbd_bonn_crowd: not in data",
        "rgbd_bonn_crowd2: no folder masks", "--frames: parts of sequences", "Table 1.", "Table 2.",
        "Table 3.", "Table 4.", ".729/.386", "1.311/.257", ".0064/.0032", "39.47"})
    EXPECT_NE(r.out.find(words), std::string::npos) << words << "\n" << r.out;
  // Our number stands in the line of its sequence, behind the published ones; what was not run has
  // a dash.
  const auto line_of = [&](const std::string& begin) {
    const std::size_t at = r.out.find("\n" + begin);
    return at == std::string::npos ? "" : r.out.substr(at + 1, r.out.find('\n', at + 1) - at - 1);
  };
  const Json rows = json_of(path("paper") / "results.json")["rows"];
  for (const Json& row : rows)
    if (row["variant"] == "paper") {
      char number[32];
      std::snprintf(number, sizeof number, "  %.4f/", row["ate_rmse_mean_m"].get<double>());
      EXPECT_NE(line_of("w/static ").find(number), std::string::npos) << line_of("w/static ");
    }
  EXPECT_EQ(line_of("w/half ").back(), '-');
  EXPECT_NE(line_of("w/static, ours: default ").find_first_of("123456789"), std::string::npos);
  EXPECT_NE(text_of(path("paper") / "index.html").find("Table 4."), std::string::npos);

  // As the paper: five runs, 3000 keypoints; the camera of the data set where there is no other.
  const fs::path bonn_folder = path("data") / "rgbd_bonn_crowd2";
  fs::remove(bonn_folder / "camera.yaml");
  for (const char* kind : {"rgb", "depth"})
    for (const auto& entry : fs::directory_iterator(bonn_folder / kind)) {
      cv::Mat picture = cv::imread(entry.path().string(), cv::IMREAD_UNCHANGED);
      cv::resize(picture, picture, {640, 480}, 0, 0, cv::INTER_NEAREST);
      cv::imwrite(entry.path().string(), picture);
    }
  fs::remove_all(bonn_folder / "masks_gt");
  ASSERT_EQ(run("bench --paper data --out paper5 --variants off --frames 3 --tracker vo").code, 0);
  const Json five = json_of(path("paper5") / "results.json")["rows"];
  for (const Json& row : five) EXPECT_EQ(row["runs"], 5);
  EXPECT_EQ(five.size(), 2u);
  const Json bonn = json_of(path("paper5") / "runs/rgbd_bonn_crowd2/off.0.json");
  EXPECT_EQ(bonn["job"]["features"], 3000);
  EXPECT_NEAR(bonn["stats"]["camera"]["fx"], 542.8, 0.1);

  expect_error("bench --paper walk --out paper", 1, "at least one of the ten sequences");
  expect_error("bench walk --paper data --out paper", 2, "takes no SEQUENCE");
  expect_error("bench --merge paper --paper data --out paper", 2, "runs nothing");
}

TEST_F(Cli, BenchStudiesDilationAndBlur) {
  for (const char* shutter : {"00", "40"})
    ASSERT_EQ(run(std::string("synth xyz_") + shutter +
                  "ms --frames 21 --size 320x240 --shutter-ms " + shutter)
                  .code,
              0);
  const Result r =
      run("bench xyz_00ms xyz_40ms --out study --tracker vo --variants off,default --vary "
          "dilation_px=0,20");
  ASSERT_EQ(r.code, 0) << r.err;
  const std::string page = text_of(path("study") / "index.html");
  for (const char* title : {"Error against dilation_px", "whole picture against dilation_px",
                            "ATE against the shutter, motion xyz", "Mask IoU against true motion",
                            "Misses against sharpness"})
    EXPECT_NE(page.find(title), std::string::npos) << title;
  EXPECT_NE(text_of(path("study") / "blur.svg").find("exposure time"), std::string::npos);
  EXPECT_NE(text_of(path("study") / "settings.svg").find("dilation_px"), std::string::npos);
  expect_error("bench walk --out b --vary dilation=3", 1, "nearest is depth.dilation_px");
  expect_error("bench walk --out b --vary growth_m=3", 1,
               "depth.growth_m and motion.movers.growth_m");
  expect_error("bench walk --out b --vary dilation_px=", 1, "NAME=NUMBER");
  expect_error("bench walk --out b --vary dilation_px", 1, "NAME=NUMBER");

  const auto sum = [](const Json& values) {
    double total = 0;
    for (const Json& v : values) total += v.is_number() ? v.get<double>() : 0;
    return total;
  };
  const auto series = [&](const std::string& file) {
    return json_of(path("study") / "runs" / file)["stats"]["series"];
  };
  const Json sharp = series("xyz_00ms/default.0.json"), blurred = series("xyz_40ms/default.0.json");
  EXPECT_EQ(sum(sharp["people_motion_px"]), 0);
  EXPECT_GT(sum(blurred["people_motion_px"]), 21);
  EXPECT_GT(sum(sharp["sharpness"]), sum(blurred["sharpness"]));
  for (const char* key : {"iou_before", "iou_after", "missed_before", "missed_after"})
    EXPECT_EQ(blurred[key].size(), 21u) << key;
  // A wider mask removes no fewer keypoints.
  double kept_0 = 0, kept_20 = 0;
  const Json rows = json_of(path("study") / "results.json")["rows"];
  for (const Json& row : rows) {
    if (row["variant"] == "dilation_px=0") kept_0 += row["keypoints_static_kept"].get<double>();
    if (row["variant"] == "dilation_px=20") kept_20 += row["keypoints_static_kept"].get<double>();
  }
  EXPECT_GT(kept_0, 0);
  EXPECT_GE(kept_0, kept_20);
}

TEST_F(Cli, BenchKilledLosesOnlyTheUnfinishedRun) {
  const std::string arguments =
      "bench walk --tracker vo --variants off,default --runs 12 --frames 6 --shard 1/2 --out "
      "killed";
  const std::string script =
      "cd '" + folder_->string() + "' && { '" STILLPOINT_CLI "' " + arguments +
      " >/dev/null 2>&1 & pid=$!; for i in $(seq 1200); do "
      "[ $(ls killed/runs/walk 2>/dev/null | grep -c json$) -ge 2 ] && break; sleep 0.05; done; "
      "kill -9 $pid; wait $pid; } 2>/dev/null";
  std::system(script.c_str());
  std::size_t finished = 0;
  for (const auto& entry : fs::directory_iterator(path("killed") / "runs/walk"))
    if (entry.path().extension() == ".json") {
      EXPECT_TRUE(json_of(entry.path()).contains("stats")) << entry.path() << " is half a file";
      ++finished;
    }
  ASSERT_GE(finished, 2u);
  ASSERT_LT(finished, 12u) << "it was not killed in time";
  const Result again = run(arguments);
  EXPECT_EQ(again.code, 0) << again.err;
  std::size_t kept = 0;
  for (std::size_t at = 0; (at = again.out.find("kept from before", at)) != std::string::npos; ++at)
    ++kept;
  EXPECT_EQ(kept, finished) << again.out;
  EXPECT_EQ(files_in(path("killed") / "runs/walk", ".json"), 12u);
}

TEST_F(Cli, PageIsDrawnByABrowser) {
  if (std::system("command -v chromium >/dev/null 2>&1") != 0)
    GTEST_SKIP() << "chromium is not installed (apt-get install chromium)";
  ASSERT_EQ(
      run("bench walk --out shown --tracker vo --variants off,default --vary dilation_px=0,10")
          .code,
      0);
  const fs::path picture = path("page.png");
  const auto draw = [&](const fs::path& file, const char* size) {
    fs::remove(picture);
    const std::string command =
        "HOME='" + folder_->string() +
        "' timeout 120 chromium --headless --no-sandbox --disable-gpu --hide-scrollbars "
        "--force-device-scale-factor=1 --window-size=" +
        std::string(size) + " --screenshot='" + picture.string() + "' 'file://" + file.string() +
        "' >/dev/null 2>&1";
    EXPECT_EQ(std::system(command.c_str()), 0) << command;
    return cv::imread(picture.string());
  };
  const auto pixels = [](const cv::Mat& image, const cv::Scalar& bgr) {
    cv::Mat found;
    cv::inRange(image, bgr, bgr, found);
    return cv::countNonZero(found);
  };
  const cv::Mat page = draw(path("shown") / "index.html", "1200,5200");
  ASSERT_EQ(page.size(), cv::Size(1200, 5200));
  // Curves of the front end off and on, heads of tables, and pictures (many colors) are drawn.
  EXPECT_GT(pixels(page, {0x00, 0x5e, 0xd5}), 300);
  EXPECT_GT(pixels(page, {0xb2, 0x72, 0x00}), 300);
  EXPECT_GT(pixels(page, {0xf7, 0xf5, 0xf4}), 5000);
  EXPECT_GT(pixels(page, {0xff, 0xff, 0xff}), 1000000);
  cv::Mat gray, histogram;
  cv::cvtColor(page, gray, cv::COLOR_BGR2GRAY);
  const int channel = 0, bins = 256;
  const float range[] = {0, 256};
  const float* ranges = range;
  cv::calcHist(&gray, 1, &channel, cv::Mat(), histogram, 1, &bins, &ranges);
  EXPECT_GT(cv::countNonZero(histogram > 200), 200);
}

TEST_F(Cli, BenchMarksLostTracks) {
  // Gray pictures: nothing can be tracked.
  copy_with_blind_frames("dark", 4, 12, 90);
  const Result r = run("bench dark --out d --variants default --tracker vo");
  ASSERT_EQ(r.code, 0) << r.err;
  const Json rows = json_of(path("d") / "results.json")["rows"];
  EXPECT_EQ(rows[0]["failed"], "coverage");
  EXPECT_NEAR(rows[0]["coverage_min"], 4.0 / 12, 1e-9);
  EXPECT_NE(r.out.find("33.3 % !"), std::string::npos) << r.out;
  const std::string page = text_of(path("d") / "index.html");
  EXPECT_NE(page.find("failed: coverage"), std::string::npos);
  // Nothing ran with the front end off, so no plot may say so.
  EXPECT_EQ(page.find("front end off and on"), std::string::npos);
}

}  // namespace
}  // namespace stillpoint
