// SPDX-License-Identifier: BSD-2-Clause
//
// The errors that `run`, `evaluate` and `bench` say, and how else to get them.
#include "cli_fixture.hpp"
#include "stillpoint/evaluation/bonn_ground_truth.hpp"
#include "stillpoint/io/trajectory_file.hpp"

namespace stillpoint {
namespace {

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
  // A camera that dropped two frames, and one color image without depth: neither is lost track.
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

TEST_F(Cli, OnlinePosesStandBesideTheFinalOnes) {
  const Result r = run("run walk --out online --frames 12");
  ASSERT_EQ(r.code, 0) << r.err;
  const Json stats = json_of(path("online") / "stats.json");
  for (const char* kind : {"", "_online"}) {
    const std::string name = std::string("trajectory") + kind + ".txt";
    EXPECT_EQ(read_trajectory(path("online") / name).size(), 12u) << name;
    const Json judged = Json::parse(
        run("evaluate --json --groundtruth walk/groundtruth.txt --estimate online/" + name).out);
    for (const char* key : {"ate_rmse_m", "rpe_trans_m", "ate_sim3_rmse_m", "scale"})
      EXPECT_NEAR(stats[std::string("evaluation") + kind][key], judged[key], 1e-6) << name << key;
  }
  EXPECT_NE(r.out.find("of the poses as each frame had them"), std::string::npos) << r.out;
  // The odometry never looks back.
  ASSERT_EQ(run("run walk --out odometry --tracker vo").code, 0);
  EXPECT_EQ(text_of(path("odometry") / "trajectory.txt"),
            text_of(path("odometry") / "trajectory_online.txt"));

  ASSERT_EQ(run("bench walk --out online_bench --variants off,default --tracker vo --runs 3").code,
            0);
  for (const Json& row : rows_of(path("online_bench"))) {
    EXPECT_DOUBLE_EQ(row["ate_online_rmse_m"], row["ate_rmse_m"]) << row["label"];
    EXPECT_LE(row["ate_rmse_low_m"], row["ate_rmse_m"]);
    EXPECT_GE(row["ate_rmse_high_m"], row["ate_rmse_m"]);
    EXPECT_LE(row["ate_rmse_high_m"], row["ate_rmse_worst_m"]);
    EXPECT_TRUE(row["rpe_1s_trans_m"].is_null() || row["rpe_1s_trans_m"] >= 0);
    EXPECT_EQ(row["groundtruth_of"], "camera");
  }
}

TEST_F(Cli, ErrorsNameTheCommandOfEvo) {
  const Result r = run("run walk --out evo --tracker vo");
  EXPECT_NE(r.out.find("evo_ape tum walk/groundtruth.txt evo/trajectory.txt --align --t_max_diff "
                       "0.02\n"),
            std::string::npos)
      << r.out;
  fs::copy(path("evo") / "trajectory.txt", path("a name.txt"));
  const Result e =
      run("evaluate --groundtruth walk/groundtruth.txt --estimate 'a name.txt' --rpe-seconds 0.1");
  EXPECT_NE(e.out.find("evo_ape tum walk/groundtruth.txt 'a name.txt' --align --t_max_diff 0.02\n"),
            std::string::npos)
      << e.out;
  for (const char* words : {"aligned in SE(3), pairs within 0.02 s, ground truth of the camera",
                            "with the scale aligned, too", "0.10 s apart", "over a second"})
    EXPECT_NE(e.out.find(words), std::string::npos) << words << "\n" << e.out;
}

// A sequence whose ground truth is of Bonn's body of markers: turned, it is the camera's again.
TEST_F(Cli, GroundTruthOfTheBodyIsTurned) {
  fs::copy(path("walk"), path("body"), fs::copy_options::recursive);
  Trajectory truth = read_trajectory(path("walk") / "groundtruth.txt");
  const Eigen::Isometry3d T_m =
      camera_of_bonn_body({{0, Eigen::Isometry3d::Identity()}})[0].T_world_camera;
  Eigen::Isometry3d T_ros = Eigen::Isometry3d::Identity();
  T_ros.linear() << -1, 0, 0, 0, 0, 1, 0, 1, 0;
  for (StampedPose& pose : truth)
    pose.T_world_camera = T_ros * pose.T_world_camera * T_m.inverse() * T_ros.inverse();
  write_trajectory(path("body") / "groundtruth.txt", truth);

  ASSERT_EQ(run("run walk --out of_camera --tracker vo").code, 0);
  const Result r = run("run body --out of_body --tracker vo --groundtruth-of body");
  ASSERT_EQ(r.code, 0) << r.err;
  const Json stats = json_of(path("of_body") / "stats.json");
  const Json expected = json_of(path("of_camera") / "stats.json")["evaluation"];
  EXPECT_EQ(stats["groundtruth_of"], "body");
  for (const char* key : {"ate_rmse_m", "rpe_trans_m", "rpe_rot_deg"})
    EXPECT_NEAR(stats["evaluation"][key], expected[key], 1e-5) << key;
  EXPECT_NE(r.out.find("ground truth of the body"), std::string::npos) << r.out;
  // evo gets the turned one.
  EXPECT_NE(r.out.find("evo_ape tum of_body/groundtruth.txt of_body/trajectory.txt"),
            std::string::npos)
      << r.out;
  EXPECT_FALSE(fs::exists(path("of_camera") / "groundtruth.txt"));

  const std::string files =
      "evaluate --json --estimate of_body/trajectory.txt --groundtruth body/groundtruth.txt ";
  EXPECT_NEAR(Json::parse(run(files + "--groundtruth-of body").out)["ate_rmse_m"],
              expected["ate_rmse_m"], 1e-5);
  const Json as_it_is = Json::parse(run(files).out);
  EXPECT_GT(std::abs(as_it_is["rpe_trans_m"].get<double>() - expected["rpe_trans_m"].get<double>()),
            1e-5);
  EXPECT_EQ(as_it_is["groundtruth_of"], "camera");
  expect_error("evaluate --groundtruth-of wheels --estimate a --groundtruth b", 2, "camera,body");

  ASSERT_EQ(run("bench body --out body_bench --variants off --tracker vo --groundtruth-of body "
                "--estimate other=of_body/trajectory.txt")
                .code,
            0);
  const Json rows = rows_of(path("body_bench"));
  ASSERT_EQ(rows.size(), 2u);
  for (const Json& row : rows) EXPECT_EQ(row["groundtruth_of"], "body");
  EXPECT_NE(rows[0]["evo"].get<std::string>().find("off.0.groundtruth.txt"), std::string::npos);
  EXPECT_TRUE(fs::exists(path("body_bench") / "runs/body/off.0.groundtruth.txt"));
  EXPECT_EQ(rows[1]["evo"], "") << "no file holds the turned ground truth of an estimate";
  EXPECT_NEAR(rows[1]["ate_rmse_m"], expected["ate_rmse_m"], 1e-5);
}

// What `bench` says of real sequences: how much of the image is called dynamic, and with masks_gt
// recall and precision where there is depth.
TEST_F(Cli, BenchSaysTheDynamicShareAndTheMasks) {
  const Result r = run("bench walk --out real --variants off,default,truth --tracker vo");
  ASSERT_EQ(r.code, 0) << r.err;
  const Json rows = rows_of(path("real"));
  ASSERT_EQ(rows.size(), 3u);
  EXPECT_TRUE(rows[0]["mask_share"].is_null());
  EXPECT_GT(rows[1]["mask_share"], 0.01);
  EXPECT_LT(rows[1]["mask_share"], 0.9);
  EXPECT_GT(rows[1]["mask_recall_measured"], 0.5);
  EXPECT_DOUBLE_EQ(rows[2]["mask_recall_measured"], 1);
  EXPECT_DOUBLE_EQ(rows[2]["mask_precision_measured"], 1);
  for (const char* column : {"online", "dynamic", "recall", "precision", "front end off"})
    EXPECT_NE(r.out.find(column), std::string::npos) << column;
  // The few columns that matter come first.
  EXPECT_LT(r.out.find("limit"), r.out.find("recall")) << r.out;
}

TEST_F(Cli, EvaluateTakesTheFramesOfAListWithoutItsImages) {
  ASSERT_EQ(run("run walk --front-end off --out listed").code, 0);
  fs::create_directories(path("lists"));
  for (const char* name : {"rgb.txt", "depth.txt", "groundtruth.txt"})
    fs::copy_file(path("walk") / name, path("lists") / name);
  const Result r =
      run("evaluate --groundtruth lists/groundtruth.txt --estimate listed/trajectory.txt");
  EXPECT_EQ(r.code, 0) << r.err;
  EXPECT_NE(r.out.find("of 12 frames"), std::string::npos) << r.out;
}

}  // namespace
}  // namespace stillpoint
