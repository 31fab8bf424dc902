// SPDX-License-Identifier: BSD-2-Clause
#include <cstdio>
#include <opencv2/imgproc.hpp>

#include "cli_fixture.hpp"

namespace stillpoint {
namespace {

TEST_F(Cli, BenchComparesAndGoesOn) {
  const std::string command = "bench walk --out b --tracker vo --frames 8";
  const Result r = run(command);
  ASSERT_EQ(r.code, 0) << r.err;
  for (const char* label : {"front end off", "paper preset", "network_only preset",
                            "default preset", "without compensation", "without depth",
                            "without probability", "without any masks", "ground-truth masks"})
    EXPECT_NE(r.out.find(label), std::string::npos) << label;
  const Json rows = rows_of(path("b"));
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
  EXPECT_NE(page.find("data:image/jpeg;base64,"), std::string::npos);
  EXPECT_NE(page.find("ATE with the default preset"), std::string::npos) << "what run takes";
  for (const char* outside : {"src=\"http", "href=\"http", "url(", "{{"})
    EXPECT_EQ(page.find(outside), std::string::npos) << outside;
  // Each row names the command of evo for the file that its error is of.
  for (const Json& row : rows)
    EXPECT_EQ(row["evo"], "evo_ape tum walk/groundtruth.txt b/runs/walk/" +
                              row["variant"].get<std::string>() +
                              ".0.trajectory.txt --align --t_max_diff 0.02");

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
  const Json rows = rows_of(path("merged"));
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
  for (const Json& row : rows_of(path("lacking"))) {
    EXPECT_EQ(row["failed"], row["variant"] == "off" ? "incomplete" : "");
    EXPECT_EQ(row["runs_planned"], 2);
  }
  expect_error("bench walk --partial --out lacking", 2, "--merge");
}

TEST_F(Cli, BenchMergesRunsThatEndedInError) {
  const std::string command =
      "bench walk --tracker vo --frames 4 --variants off,default --runs 2 --shard ";
  for (const char* shard : {"0/2 --out err0", "1/2 --out err1"})
    ASSERT_EQ(run(command + shard).code, 0) << shard;
  fs::copy(path("err1"), path("err1_good"), fs::copy_options::recursive);
  const fs::path file = path("err1") / "runs/walk/off.1.json";
  // In the order of the keys, which the merge compares.
  auto result = nlohmann::ordered_json::parse(text_of(file));
  result.erase("stats");
  result["error"] = "the disk was full";
  std::ofstream(file) << result.dump();

  // The table is there, the row is marked, its error is of the other run, and the exit code says
  // so.
  const Result r = run("bench --merge err0 err1 --out err_merged");
  EXPECT_EQ(r.code, 1) << r.out;
  EXPECT_NE(r.err.find("1 of 4 runs ended in error"), std::string::npos) << r.err;
  EXPECT_NE(r.err.find("runs/walk/off.1.json"), std::string::npos) << r.err;
  EXPECT_NE(r.out.find("the disk was full"), std::string::npos) << r.out;
  for (const Json& row : rows_of(path("err_merged")))
    EXPECT_EQ(row["failed"], row["variant"] == "off" ? "error" : "");
  // A good result of the same run counts, in whatever order the folders come.
  for (const std::string folders : {"err0 err1 err1_good", "err0 err1_good err1"}) {
    const Result good = run("bench --merge " + folders + " --out err_mended");
    EXPECT_EQ(good.code, 0) << good.err;
  }
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

TEST_F(Cli, BenchMarksLostTracks) {
  // Gray images: nothing can be tracked.
  copy_with_blind_frames("dark", 4, 12, 90);
  const Result r = run("bench dark --out d --variants default --tracker vo");
  ASSERT_EQ(r.code, 0) << r.err;
  const Json rows = rows_of(path("d"));
  EXPECT_EQ(rows[0]["failed"], "coverage");
  EXPECT_NEAR(rows[0]["coverage_min"], 4.0 / 12, 1e-9);
  EXPECT_NE(r.out.find("33.3 % !"), std::string::npos) << r.out;
  const std::string page = text_of(path("d") / "index.html");
  EXPECT_NE(page.find("failed: coverage"), std::string::npos);
  // Nothing ran with the front end off, so the page compares with nothing.
  EXPECT_EQ(page.find("ATE with the front end off"), std::string::npos);
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
  for (const char* title : {"Error against dilation_px", "whole image against dilation_px",
                            "ATE against the shutter, motion xyz", "Mask IoU against true motion",
                            "Misses against sharpness"})
    EXPECT_NE(page.find(title), std::string::npos) << title;
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
  const Json rows = rows_of(path("study"));
  for (const Json& row : rows) {
    if (row["variant"] == "dilation_px=0") kept_0 += row["keypoints_static_kept"].get<double>();
    if (row["variant"] == "dilation_px=20") kept_20 += row["keypoints_static_kept"].get<double>();
  }
  EXPECT_GT(kept_0, 0);
  EXPECT_GE(kept_0, kept_20);
}

TEST_F(Cli, BenchCountsNoRunTwiceAndKeepsNoneOfOtherInput) {
  const std::string bench = "bench walk --frames 4 ";
  expect_error(bench + "--out twice --variants off,off", 1, "asked for twice");
  expect_error(bench + "--out twice --variants off --vary dilation_px=5,5", 1, "asked for twice");

  // Another camera of the same name.
  const std::string yaml = text_of(path("walk") / "camera.yaml");
  std::ofstream(path("mine.yaml")) << yaml;
  const std::string mine = bench + "--out mine --variants off --camera mine.yaml";
  ASSERT_EQ(run(mine).code, 0);
  EXPECT_NE(run(mine).out.find("kept from before"), std::string::npos);
  std::ofstream(path("mine.yaml")) << yaml << "# another\n";
  EXPECT_EQ(run(mine).out.find("kept from before"), std::string::npos);

  // Other masks in a folder within a folder.
  fs::copy(path("walk"), path("nested"), fs::copy_options::recursive);
  fs::create_directories(path("nested") / "nets");
  fs::copy(path("walk") / "masks", path("nested") / "nets" / "a", fs::copy_options::recursive);
  const std::string nets =
      "bench nested --frames 4 --out nets --variants default --masks-folder nets/a/";
  ASSERT_EQ(run(nets).code, 0);
  EXPECT_NE(run(nets).out.find("kept from before"), std::string::npos);
  fs::remove(fs::directory_iterator(path("nested") / "nets" / "a")->path());
  EXPECT_EQ(run(nets).out.find("kept from before"), std::string::npos);
}

}  // namespace
}  // namespace stillpoint
