// SPDX-License-Identifier: BSD-2-Clause
#include <cstdio>
#include <opencv2/imgproc.hpp>

#include "cli_fixture.hpp"
#include "stillpoint/io/trajectory_file.hpp"

namespace stillpoint {
namespace {

TEST_F(Cli, BenchJudgesOtherSystemsByTheSameRules) {
  ASSERT_EQ(run("run walk --out other --preset default --tracker vo").code, 0);
  // The first quarter only: its error is small, and it is no result.
  const Trajectory all = read_trajectory(path("other") / "trajectory.txt");
  write_trajectory(path("short_walk.txt"), Trajectory(all.begin(), all.begin() + 4));
  const Result r =
      run("bench walk --out e --variants default --tracker vo --jobs 2 --estimate "
          "whole=other/trajectory.txt --estimate 'cut=short_{}.txt'");
  ASSERT_EQ(r.code, 0) << r.err;
  const Json rows = rows_of(path("e"));
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
  const Json rows = rows_of(path("trunc"));
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
  // The real frames' times; that the images are none makes our own row an error, as it should.
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
  const Json rows = rows_of(path("real_bench"));
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
  fs::copy(path("walk"), path("data") / "rgbd_bonn_balloon", fs::copy_options::recursive);
  fs::remove_all(path("data") / "rgbd_bonn_crowd2" / "masks");
  const std::string quick = " --frames 5 --tracker vo ";
  const Result r = run("bench --paper data --out paper --runs 1 --features 500" + quick);
  ASSERT_EQ(r.code, 0) << r.err;
  for (const char* words :
       {"freiburg3_walking_xyz: not in data (scripts/download_tum", "rgbd_bonn_crowd: not in data",
        "rgbd_bonn_crowd2: no folder masks", "--frames: parts of sequences", "Table 1.", "Table 2.",
        "Table 3.", "Table 4.", "Further sequences", ".729/.386", "1.311/.257", ".0064/.0032",
        "39.47"})
    EXPECT_NE(r.out.find(words), std::string::npos) << words << "\n" << r.out;
  // Our number stands in the line of its sequence, behind the published ones; what was not run has
  // a dash.
  const auto line_of = [&](const std::string& begin) {
    const std::size_t at = r.out.find("\n" + begin);
    return at == std::string::npos ? "" : r.out.substr(at + 1, r.out.find('\n', at + 1) - at - 1);
  };
  const Json rows = rows_of(path("paper"));
  for (const Json& row : rows)
    if (row["variant"] == "paper") {
      char number[32];
      std::snprintf(number, sizeof number, "  %.4f/", row["ate_rmse_mean_m"].get<double>());
      EXPECT_NE(line_of("w/static ").find(number), std::string::npos) << line_of("w/static ");
    }
  EXPECT_EQ(line_of("w/half ").back(), '-');
  EXPECT_NE(line_of("balloon ").find_first_of("123456789"), std::string::npos) << r.out;
  EXPECT_NE(line_of("w/static, ours: default ").find_first_of("123456789"), std::string::npos);
  EXPECT_NE(text_of(path("paper") / "index.html").find("Table 4."), std::string::npos);

  // As the paper: five runs, 3000 keypoints; the camera of the data set where there is no other.
  const fs::path bonn_folder = path("data") / "rgbd_bonn_crowd2";
  fs::remove(bonn_folder / "camera.yaml");
  for (const char* kind : {"rgb", "depth"})
    for (const auto& entry : fs::directory_iterator(bonn_folder / kind)) {
      cv::Mat image = cv::imread(entry.path().string(), cv::IMREAD_UNCHANGED);
      cv::resize(image, image, {640, 480}, 0, 0, cv::INTER_NEAREST);
      cv::imwrite(entry.path().string(), image);
    }
  fs::remove_all(bonn_folder / "masks_gt");
  ASSERT_EQ(run("bench --paper data --out paper5 --variants off --frames 3 --tracker vo").code, 0);
  const Json five = rows_of(path("paper5"));
  for (const Json& row : five) EXPECT_EQ(row["runs"], 5);
  EXPECT_EQ(five.size(), 3u);
  const Json bonn = json_of(path("paper5") / "runs/rgbd_bonn_crowd2/off.0.json");
  EXPECT_EQ(bonn["job"]["features"], 3000);
  EXPECT_NEAR(bonn["stats"]["camera"]["fx"], 542.8, 0.1);

  expect_error("bench --paper walk --out paper", 1, "at least one of the ten sequences");
  expect_error("bench walk --paper data --out paper", 2, "takes no SEQUENCE");
  expect_error("bench --merge paper --paper data --out paper", 2, "runs nothing");
}

TEST_F(Cli, BenchJudgesAnEstimateOverTheSameFrames) {
  ASSERT_EQ(run("run walk --front-end off --out whole").code, 0);
  const Result r =
      run("bench walk --frames 6 --variants off --estimate mine=whole/trajectory.txt --out part");
  ASSERT_EQ(r.code, 0) << r.err;
  const Json estimate = json_of(path("part") / "runs" / "walk" / "estimate_mine.0.json");
  EXPECT_EQ(estimate.at("stats").at("evaluation").at("pairs"), 6) << estimate.dump(1);
}

}  // namespace
}  // namespace stillpoint
