// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/evaluation/coverage.hpp"

#include <gtest/gtest.h>

#include <filesystem>

#include "stillpoint/io/tum_sequence.hpp"

namespace {

using stillpoint::coverage;
using stillpoint::guess_frames;
using stillpoint::Trajectory;

// Poses at `rate` Hz from `begin` to `end` seconds.
Trajectory poses(double begin, double end, double rate) {
  Trajectory t;
  for (int i = 0; begin + i / rate <= end + 1e-9; ++i) {
    t.emplace_back();
    t.back().timestamp = begin + i / rate;
  }
  return t;
}

std::vector<double> times(const Trajectory& t) { return stillpoint::detail::timestamps_of(t); }

TEST(Coverage, CountsFramesWithAPose) {
  const Trajectory truth = poses(10, 20, 100), frames = poses(10, 20, 30);
  Trajectory estimate = frames;
  EXPECT_DOUBLE_EQ(coverage(truth, estimate, times(frames)).share, 1);
  estimate.erase(estimate.begin() + 100, estimate.begin() + 200);
  const auto c = coverage(truth, estimate, times(frames));
  EXPECT_EQ(c.frames, 301u);
  EXPECT_EQ(c.covered, 201u);
  EXPECT_DOUBLE_EQ(c.share, 201 / 301.0);
  EXPECT_EQ(coverage(truth, {}, times(frames)).share, 0);
  EXPECT_EQ(coverage({}, estimate, times(frames)).share, 0);
}

TEST(Coverage, APoseServesOneFrame) {
  // At 60 Hz a neighbor's pose is only 0.0167 s away; it must not cover the lost frame.
  const Trajectory truth = poses(10, 20, 100), frames = poses(10, 20, 60);
  Trajectory estimate;
  for (std::size_t i = 0; i < frames.size(); i += 2) estimate.push_back(frames[i]);
  EXPECT_NEAR(coverage(truth, estimate, times(frames)).share, 0.5, 0.01);
}

TEST(Coverage, DropoutsOfTheGroundTruthDoNotCount) {
  Trajectory truth = poses(10, 13, 100), late = poses(16, 20, 100);
  truth.insert(truth.end(), late.begin(), late.end());
  const Trajectory frames = poses(10, 20, 30);
  EXPECT_DOUBLE_EQ(coverage(truth, frames, times(frames)).share, 1);
  Trajectory estimate;  // lost during the dropout only
  for (const auto& pose : frames)
    if (pose.timestamp < 13.1 || pose.timestamp > 15.9) estimate.push_back(pose);
  EXPECT_DOUBLE_EQ(coverage(truth, estimate, times(frames)).share, 1);
  EXPECT_NEAR(coverage(truth, estimate).share, 1, 1e-9) << "frames guessed";
}

TEST(Coverage, GuessesTheFramesFromTheTrajectories) {
  const Trajectory truth = poses(10, 20, 100), all = poses(10, 20, 30);
  EXPECT_DOUBLE_EQ(coverage(truth, all).share, 1);
  EXPECT_EQ(coverage(truth, all).frames, 301u);
  const Trajectory start(all.begin(), all.begin() + 36);  // the first 12 %
  EXPECT_NEAR(coverage(truth, start).share, 0.12, 0.005);
  const Trajectory end(all.end() - 36, all.end());
  EXPECT_NEAR(coverage(truth, end).share, 0.12, 0.005);
  Trajectory half;
  for (std::size_t i = 0; i < all.size(); i += 2) half.push_back(all[i]);
  EXPECT_NEAR(coverage(truth, half).share, 0.5, 0.005) << "an estimate of every other frame";
  EXPECT_NEAR(coverage(truth, poses(10, 20, 60)).share, 1, 1e-9) << "a faster camera";
  EXPECT_EQ(coverage(truth, poses(50, 60, 30)).share, 0) << "another time";
  EXPECT_EQ(coverage(truth, {}).share, 0);
  EXPECT_EQ(coverage({}, all).share, 0);
}

TEST(Coverage, RefusesGroundTruthInAnotherUnit) {
  Trajectory truth = poses(10, 20, 1), estimate = poses(10, 20, 30);
  truth.back().timestamp = 1e10;
  EXPECT_THROW(guess_frames(truth, estimate), stillpoint::Error);
}

TEST(Coverage, OfRealTrajectories) {
  const std::filesystem::path data = STILLPOINT_SHARED_DATA "/real";
  if (!std::filesystem::exists(data)) GTEST_SKIP() << "no " << data;
  const Trajectory truth = stillpoint::read_trajectory(data / "fr3_walking_xyz/groundtruth.txt");
  std::vector<double> frames;
  for (const auto& e : stillpoint::read_associations(data / "associations/fr3_walking_xyz.txt", {}))
    frames.push_back(e.timestamp);
  ASSERT_EQ(frames.size(), 827u);
  const Trajectory estimate =
      stillpoint::read_trajectory(data / "fr3_walking_xyz/CameraTrajectory_bf.txt");
  // 203 of the frames have a pose; the first lies before the ground truth.
  const auto c = coverage(truth, estimate, frames);
  EXPECT_EQ(c.covered, 202u);
  EXPECT_GE(c.frames, 820u);
  EXPECT_LE(c.frames, 826u);
  // Guessed frames cannot know which ones the camera dropped: a little lower.
  EXPECT_NEAR(coverage(truth, estimate).share, c.share, 0.03);
  EXPECT_LE(coverage(truth, estimate).share, c.share);
}

}  // namespace
