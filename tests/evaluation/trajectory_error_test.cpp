// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/evaluation/trajectory_error.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <opencv2/core.hpp>
#include <random>
#include <tuple>
#include <vector>

#include "../io/temporary_folder.hpp"
#include "stillpoint/core/random.hpp"
#include "stillpoint/io/trajectory_file.hpp"

namespace {

using stillpoint::ate;
using stillpoint::rpe;
using stillpoint::RpeSettings;
using stillpoint::Trajectory;

double real(std::mt19937& random) { return static_cast<double>(random()) / 4294967296.0 - 0.5; }

Eigen::Isometry3d random_pose(std::mt19937& random) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = Eigen::Quaterniond(real(random), real(random), real(random), real(random))
                   .normalized()
                   .toRotationMatrix();
  for (int i = 0; i < 3; ++i) T.translation()[i] = 4 * real(random);
  return T;
}

Trajectory random_trajectory(std::size_t n, unsigned seed) {
  std::mt19937 random(seed);
  Trajectory t(n);
  for (std::size_t i = 0; i < n; ++i) {
    t[i].timestamp = 100 + static_cast<double>(i) / 30;
    t[i].T_world_camera = random_pose(random);
  }
  return t;
}

TEST(Ate, IsZeroForAnyRigidMotionOfTheGroundTruth) {
  std::mt19937 random(3);
  const Trajectory truth = random_trajectory(50, 1);
  Trajectory estimate = truth;
  const Eigen::Isometry3d T = random_pose(random);
  for (auto& pose : estimate) pose.T_world_camera = T * pose.T_world_camera;
  const auto result = ate(truth, estimate);
  EXPECT_LT(result.max_m, 1e-12);
  EXPECT_EQ(result.pairs, 50u);
  EXPECT_TRUE(result.T_groundtruth_estimate.isApprox(T.inverse(), 1e-12));
}

TEST(Ate, DoesNotCorrectScaleOrMirror) {
  const Trajectory truth = random_trajectory(50, 1);
  Trajectory scaled = truth, mirrored = truth;
  for (auto& pose : scaled) pose.T_world_camera.translation() *= 1.1;
  for (auto& pose : mirrored) pose.T_world_camera.translation().z() *= -1;
  EXPECT_GT(ate(truth, scaled).rmse_m, 0.05);
  EXPECT_GT(ate(truth, mirrored).rmse_m, 0.5);
  EXPECT_NEAR(ate(truth, mirrored).T_groundtruth_estimate.linear().determinant(), 1, 1e-9);
}

TEST(Ate, Sim3CorrectsTheScaleAndNoMirror) {
  std::mt19937 random(9);
  const Trajectory truth = random_trajectory(50, 1);
  Trajectory scaled = truth;
  const Eigen::Isometry3d T = random_pose(random);
  for (auto& pose : scaled) {
    pose.T_world_camera = T * pose.T_world_camera;
    pose.T_world_camera.translation() *= 0.8;
  }
  const auto result = ate(truth, scaled, 0.02, stillpoint::Alignment::kSim3);
  EXPECT_LT(result.max_m, 1e-12);
  EXPECT_NEAR(result.scale, 1.25, 1e-12);
  Trajectory mirrored = truth, still = truth;
  for (auto& pose : mirrored) pose.T_world_camera.translation().z() *= -1;
  EXPECT_GT(ate(truth, mirrored, 0.02, stillpoint::Alignment::kSim3).rmse_m, 0.5);
  for (auto& pose : still) pose.T_world_camera.translation().setOnes();
  EXPECT_EQ(ate(truth, still, 0.02, stillpoint::Alignment::kSim3).scale, 1);
}

TEST(Ate, StatisticsOfKnownErrors) {
  const auto s = stillpoint::error_statistics({3, 1, 2, 6});
  EXPECT_DOUBLE_EQ(s.rmse, std::sqrt(50 / 4.0));
  EXPECT_DOUBLE_EQ(s.sd, std::sqrt(3.5)) << "of the population";
  EXPECT_DOUBLE_EQ(s.mean, 3);
  EXPECT_DOUBLE_EQ(s.median, 2.5);
  EXPECT_DOUBLE_EQ(s.min, 1);
  EXPECT_DOUBLE_EQ(s.max, 6);
  EXPECT_TRUE(std::isnan(stillpoint::error_statistics({}).rmse));
}

// No other motion gives a smaller error: the alignment is tried against random small changes.
TEST(Ate, AlignmentIsTheLeastSquaresOne) {
  std::mt19937 random(5);
  std::vector<Eigen::Vector3d> from, to;
  for (int i = 0; i < 30; ++i) {
    from.push_back(random_pose(random).translation());
    to.push_back(from.back() + 0.5 * random_pose(random).translation());
  }
  const auto cost = [&](const Eigen::Isometry3d& T) {
    double sum = 0;
    for (std::size_t i = 0; i < from.size(); ++i) sum += (T * from[i] - to[i]).squaredNorm();
    return sum;
  };
  const Eigen::Isometry3d best = stillpoint::align(from, to);
  for (int trial = 0; trial < 200; ++trial) {
    Eigen::Isometry3d other = best;
    other.translate(1e-3 * random_pose(random).translation());
    other.rotate(Eigen::AngleAxisd(1e-3 * real(random), random_pose(random).linear().col(0)));
    EXPECT_GE(cost(other), cost(best) - 1e-12);
  }
}

TEST(Ate, WorksForAStraightAndForAStillCamera) {
  Trajectory truth = random_trajectory(20, 1), still = truth;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    truth[i].T_world_camera.translation() = Eigen::Vector3d(static_cast<double>(i), 0, 0);
    still[i].T_world_camera.translation() = Eigen::Vector3d(1, 2, 3);
  }
  EXPECT_LT(ate(truth, truth).rmse_m, 1e-12);
  EXPECT_LT(ate(still, still).rmse_m, 1e-12);
  EXPECT_TRUE(std::isfinite(ate(truth, still).rmse_m));
}

// A camera that turns on the spot, and positions a centimetre off.
TEST(AlignPoses, KnowsTheRotationWhereTheCameraOnlyTurns) {
  stillpoint::RandomGenerator random(7);
  const auto noise = [&] { return 0.01 * (2 * random.uniform() - 1); };
  const Eigen::Isometry3d T_truth_map =
      Eigen::Translation3d(1, 2, 3) * Eigen::AngleAxisd(1.1, Eigen::Vector3d(1, 2, 3).normalized());
  Trajectory truth, estimate;
  for (int i = 0; i < 100; ++i) {
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.translation() << 0.01 * std::sin(0.1 * i), 0, 0;
    T.linear() = Eigen::AngleAxisd(0.5 * std::sin(0.1 * i), Eigen::Vector3d::UnitY()).matrix();
    truth.push_back({0.1 * i, T});
    T.translation() += Eigen::Vector3d(noise(), noise(), noise());
    T.rotate(Eigen::AngleAxisd(noise(), Eigen::Vector3d::UnitX()));
    estimate.push_back({0.1 * i, T_truth_map.inverse() * T});
  }
  const auto by_position = ate(truth, estimate);
  const Eigen::Isometry3d by_pose = stillpoint::align_poses(truth, estimate, by_position.matches);
  const auto off_deg = [&](const Eigen::Isometry3d& T) {
    return Eigen::AngleAxisd((T.inverse() * T_truth_map).linear()).angle() * 180 / 3.14159265;
  };
  EXPECT_LT(off_deg(by_pose), 0.2);
  EXPECT_GT(off_deg(by_position.T_groundtruth_estimate), 2);  // why it is there
  EXPECT_LT((by_pose * T_truth_map.inverse()).translation().norm(), 0.02);
  EXPECT_ERROR(stillpoint::align_poses(truth, estimate, {}), "at least 1 match");
}

TEST(Ate, TooFewPairsIsAnErrorWithCountsAndTimes) {
  const Trajectory truth = random_trajectory(50, 1);
  EXPECT_ERROR(ate(truth, {truth[0], truth[1]}), "at least 3", "found 2",
               "ground truth: 50 poses from 100.0", "to 101.6", "estimate: 2 poses from 100.0");
  EXPECT_ERROR(ate({}, truth), "found 0", "ground truth: 0 poses");
  EXPECT_ERROR(ate(truth, {}), "estimate: 0 poses");
  Trajectory later = truth;
  for (auto& pose : later) pose.timestamp += 1000;
  EXPECT_ERROR(ate(truth, later), "found 0", "from 1100.0", "clock");
}

TEST(Ate, RefusesNaN) {
  const Trajectory truth = random_trajectory(5, 1);
  Trajectory bad = truth;
  bad[2].T_world_camera.translation().x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_ERROR(ate(truth, bad), "finite");
  EXPECT_ERROR(rpe(truth, bad), "finite");
  bad = truth;
  bad[2].timestamp = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(ate(truth, bad), stillpoint::Error);
  EXPECT_THROW(rpe(truth, bad), stillpoint::Error);
  bad[2].timestamp = bad[1].timestamp;
  EXPECT_ERROR(rpe(truth, bad), "estimate[2]", "ascending");
}

// Another road to the same number: all pairs sorted for the association, Horn's quaternion (the
// largest eigenvector of a 4x4 matrix) instead of an SVD for the alignment.
double slow_ate_rmse(const Trajectory& truth, const Trajectory& estimate) {
  std::vector<std::tuple<double, std::size_t, std::size_t>> candidates;
  for (std::size_t i = 0; i < truth.size(); ++i)
    for (std::size_t j = 0; j < estimate.size(); ++j) {
      const double difference = std::abs(truth[i].timestamp - estimate[j].timestamp);
      if (difference < 0.02) candidates.emplace_back(difference, i, j);
    }
  std::sort(candidates.begin(), candidates.end());
  std::vector<char> used_truth(truth.size()), used_estimate(estimate.size());
  std::vector<Eigen::Vector3d> a, b;  // estimate, ground truth
  for (const auto& [difference, i, j] : candidates) {
    if (used_truth[i] || used_estimate[j]) continue;
    used_truth[i] = used_estimate[j] = 1;
    a.push_back(estimate[j].T_world_camera.translation());
    b.push_back(truth[i].T_world_camera.translation());
  }
  Eigen::Vector3d mean_a(0, 0, 0), mean_b(0, 0, 0);
  for (std::size_t i = 0; i < a.size(); ++i) mean_a += a[i] / a.size(), mean_b += b[i] / a.size();
  Eigen::Matrix3d S = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < a.size(); ++i) S += (a[i] - mean_a) * (b[i] - mean_b).transpose();
  cv::Matx44d N(S.trace(), S(1, 2) - S(2, 1), S(2, 0) - S(0, 2), S(0, 1) - S(1, 0),    //
                0, S(0, 0) - S(1, 1) - S(2, 2), S(0, 1) + S(1, 0), S(2, 0) + S(0, 2),  //
                0, 0, S(1, 1) - S(0, 0) - S(2, 2), S(1, 2) + S(2, 1),                  //
                0, 0, 0, S(2, 2) - S(0, 0) - S(1, 1));
  cv::completeSymm(N);
  cv::Vec4d values;
  cv::Matx44d q;  // eigenvectors in rows, that of the largest value first
  cv::eigen(N, values, q);
  const Eigen::Quaterniond rotation(q(0, 0), q(0, 1), q(0, 2), q(0, 3));
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i)
    sum += (rotation * (a[i] - mean_a) - (b[i] - mean_b)).squaredNorm();
  return std::sqrt(sum / static_cast<double>(a.size()));
}

TEST(Ate, EqualsASlowReference) {
  std::mt19937 random(11);
  for (unsigned trial = 0; trial < 20; ++trial) {
    const Trajectory truth = random_trajectory(120, trial);
    const Eigen::Isometry3d T = random_pose(random);
    Trajectory estimate;
    for (const auto& pose : truth) {
      if (random() % 5 == 0) continue;  // lost
      estimate.push_back(pose);
      estimate.back().timestamp += 0.05 * real(random);  // some too far from any
      estimate.back().T_world_camera =
          T * pose.T_world_camera * Eigen::Translation3d(random_pose(random).translation() * 0.2);
    }
    EXPECT_NEAR(ate(truth, estimate).rmse_m, slow_ate_rmse(truth, estimate), 1e-9);
  }
}

// Expected values: the benchmark's definition, computed apart from this library with numpy.
TEST(Ate, AgreesWithTheTumBenchmarkOnRealTrajectories) {
  const std::filesystem::path folder = STILLPOINT_SHARED_DATA "/real/fr3_walking_xyz";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no " << folder;
  struct Expected {
    const char* file;
    std::size_t pairs;
    double rmse, sd, mean, median, min, max;
  };
  const Trajectory truth = stillpoint::read_trajectory(folder / "groundtruth.txt");
  for (const Expected& e : {Expected{"CameraTrajectory_bf.txt", 202, 0.149736224, 0.075708320,
                                     0.129186636, 0.113857171, 0.005559636, 0.335785280},
                            Expected{"CameraTrajectory_cfs.txt", 43, 0.107812476, 0.046036797,
                                     0.097489195, 0.100048131, 0.018412201, 0.170228579},
                            Expected{"CameraTrajectory_rm.txt", 48, 0.107292216, 0.049381455,
                                     0.095252777, 0.096385955, 0.015253778, 0.176939368}}) {
    const auto r = ate(truth, stillpoint::read_trajectory(folder / e.file));
    EXPECT_EQ(r.pairs, e.pairs) << e.file;
    EXPECT_NEAR(r.rmse_m, e.rmse, 1e-8) << e.file;
    EXPECT_NEAR(r.sd_m, e.sd, 1e-8) << e.file;
    EXPECT_NEAR(r.mean_m, e.mean, 1e-8) << e.file;
    EXPECT_NEAR(r.median_m, e.median, 1e-8) << e.file;
    EXPECT_NEAR(r.min_m, e.min, 1e-8) << e.file;
    EXPECT_NEAR(r.max_m, e.max, 1e-8) << e.file;
  }
}

// evo 1.36.5's own output: `evo_ape tum GROUNDTRUTH ESTIMATE --align --t_max_diff 0.01` (and 0.02:
// the same pairs), and with --correct_scale.
TEST(Ate, AgreesWithEvoOnRealTrajectories) {
  const std::filesystem::path folder = STILLPOINT_SHARED_DATA "/real/fr3_walking_xyz";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no " << folder;
  struct Expected {
    const char* file;
    std::size_t pairs;
    double rmse, sd, median, max, sim3_rmse, sim3_sd, sim3_max, scale;
  };
  const Trajectory truth = stillpoint::read_trajectory(folder / "groundtruth.txt");
  for (const Expected& e :
       {Expected{"CameraTrajectory_bf.txt", 202, 0.149736224, 0.075708320, 0.113857171, 0.335785280,
                 0.096447515, 0.047810659, 0.194231741, 0.625020160},
        Expected{"CameraTrajectory_cfs.txt", 43, 0.107812476, 0.046036797, 0.100048131, 0.170228579,
                 0.030421001, 0.019056936, 0.066102259, 0.431021917},
        Expected{"CameraTrajectory_rm.txt", 48, 0.107292216, 0.049381455, 0.096385955, 0.176939368,
                 0.039413699, 0.023455281, 0.093794461, 0.410010792}}) {
    const Trajectory estimate = stillpoint::read_trajectory(folder / e.file);
    for (double apart : {0.01, 0.02}) {
      const auto se3 = ate(truth, estimate, apart);
      EXPECT_EQ(se3.pairs, e.pairs) << e.file;
      EXPECT_NEAR(se3.rmse_m, e.rmse, 1e-8) << e.file;
      EXPECT_NEAR(se3.sd_m, e.sd, 1e-8) << e.file;
      EXPECT_NEAR(se3.median_m, e.median, 1e-8) << e.file;
      EXPECT_NEAR(se3.max_m, e.max, 1e-8) << e.file;
      EXPECT_EQ(se3.scale, 1) << e.file;
      const auto sim3 = ate(truth, estimate, apart, stillpoint::Alignment::kSim3);
      EXPECT_NEAR(sim3.rmse_m, e.sim3_rmse, 1e-8) << e.file;
      EXPECT_NEAR(sim3.sd_m, e.sim3_sd, 1e-8) << e.file;
      EXPECT_NEAR(sim3.max_m, e.sim3_max, 1e-8) << e.file;
      EXPECT_NEAR(sim3.scale, e.scale, 1e-8) << e.file;
    }
  }
}

TEST(Rpe, AgreesWithTheTumBenchmarkOnRealTrajectories) {
  const std::filesystem::path folder = STILLPOINT_SHARED_DATA "/real/fr3_walking_xyz";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no " << folder;
  struct Expected {
    const char* file;
    std::size_t pairs;
    double translation, rotation;
    std::size_t frame_pairs;
    double frame_translation, frame_rotation;
  };
  const Trajectory truth = stillpoint::read_trajectory(folder / "groundtruth.txt");
  for (const Expected& e : {Expected{"CameraTrajectory_bf.txt", 173, 0.383286020, 7.578830948, 201,
                                     0.033874011, 0.693810024},
                            Expected{"CameraTrajectory_cfs.txt", 15, 0.572720755, 11.367707006, 42,
                                     0.038010923, 0.802127975},
                            Expected{"CameraTrajectory_rm.txt", 43, 0.345735886, 6.836420087, 47,
                                     0.028656535, 0.652783182}}) {
    const Trajectory estimate = stillpoint::read_trajectory(folder / e.file);
    const auto second = rpe(truth, estimate, RpeSettings::tum());
    EXPECT_EQ(second.pairs, e.pairs) << e.file;
    EXPECT_NEAR(second.translation_m.rmse, e.translation, 1e-8) << e.file;
    EXPECT_NEAR(second.rotation_deg.rmse, e.rotation, 1e-6) << e.file;
    const auto frame = rpe(truth, estimate);
    EXPECT_EQ(frame.pairs, e.frame_pairs) << e.file;
    EXPECT_NEAR(frame.translation_m.rmse, e.frame_translation, 1e-8) << e.file;
    EXPECT_NEAR(frame.rotation_deg.rmse, e.frame_rotation, 1e-6) << e.file;
  }
}

TEST(Rpe, SeesAKnownDrift) {
  // 1 cm forward and 1 degree per frame too much.
  Trajectory truth(60), estimate(60);
  for (int i = 0; i < 60; ++i) {
    truth[i].timestamp = estimate[i].timestamp = 5 + i / 30.0;
    if (i == 0) continue;
    Eigen::Isometry3d step = Eigen::Isometry3d::Identity();
    step.translate(Eigen::Vector3d(0, 0, 0.01));
    step.rotate(Eigen::AngleAxisd(EIGEN_PI / 180, Eigen::Vector3d::UnitY()));
    estimate[i].T_world_camera = estimate[i - 1].T_world_camera * step;
  }
  const auto r = rpe(truth, estimate);
  EXPECT_EQ(r.pairs, 59u);
  EXPECT_NEAR(r.translation_m.rmse, 0.01, 1e-12);
  EXPECT_NEAR(r.translation_m.sd, 0, 1e-9);
  EXPECT_NEAR(r.rotation_deg.rmse, 1, 1e-9);
  EXPECT_NEAR(rpe(truth, estimate, RpeSettings::over_seconds(1)).rotation_deg.rmse, 30, 1e-9);
}

TEST(Rpe, LeavesOutPairsAcrossAGap) {
  Trajectory truth = random_trajectory(300, 2), estimate;
  for (std::size_t i = 0; i < truth.size(); ++i)
    if (i < 100 || i >= 200) estimate.push_back(truth[i]);
  const auto r = rpe(truth, estimate, RpeSettings::over_seconds(1));
  // 70 to 72 of the first hundred (at most 0.05 s off the second), the last hundred alike.
  EXPECT_GE(r.pairs, 138u);
  EXPECT_LE(r.pairs, 142u);
  EXPECT_LT(r.translation_m.max, 1e-9);
}

TEST(Rpe, ComparesNoPoseWithItself) {
  const Trajectory truth = random_trajectory(60, 2);  // 30 Hz
  EXPECT_EQ(rpe(truth, truth, RpeSettings::over_seconds(0.01)).pairs, 0u);
  EXPECT_EQ(rpe(truth, truth, RpeSettings::over_seconds(0.03)).pairs, 58u);
}

TEST(Rpe, NothingToCompareIsNaNWithoutPairs) {
  const Trajectory truth = random_trajectory(10, 1);
  EXPECT_EQ(rpe(truth, {}).pairs, 0u);
  EXPECT_EQ(rpe({}, truth).pairs, 0u);
  EXPECT_TRUE(std::isnan(rpe(truth, {truth[0]}).translation_m.rmse));
  RpeSettings settings;
  settings.delta_frames = 0;
  EXPECT_THROW(rpe(truth, truth, settings), stillpoint::Error);
}

}  // namespace
