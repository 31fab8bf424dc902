// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/io/run_sequence.hpp"

#include <gtest/gtest.h>

#include "stillpoint/front_end.hpp"
#include "temporary_folder.hpp"

namespace {

using namespace stillpoint;

/// Six frames at 1 to 6 s.
struct Recording : TemporaryFolder {
  Recording() {
    std::string color, depth;
    std::filesystem::create_directories(path() / "rgb");
    std::filesystem::create_directories(path() / "depth");
    for (const char* n : {"1", "2", "3", "4", "5", "6"}) {
      const std::string name = std::string(n) + ".png";
      color += std::string(n) + " rgb/" + name + "\n";
      depth += std::string(n) + " depth/" + name + "\n";
      write_image(path() / "rgb" / name, cv::Mat(24, 32, CV_8UC3, cv::Scalar::all(90)));
      write_image(path() / "depth" / name, cv::Mat(24, 32, CV_16UC1, cv::Scalar(10000)));
    }
    write("rgb.txt", color);
    write("depth.txt", depth);
  }
};

/// Keeps a protocol of its calls; lost in the frame at 3 s.
class Scripted final : public Tracker {
 public:
  const std::vector<cv::KeyPoint>& extract(const RgbdFrame& frame, const DynamicMask& m) override {
    calls += "extract" + std::to_string(cvRound(frame.timestamp)) + " ";
    EXPECT_EQ(m.timestamp, frame.timestamp);
    return keypoints_;
  }
  std::optional<Eigen::Isometry3d> track(const RgbdFrame& frame, const DynamicMask&,
                                         const Selection& selection) override {
    calls += "track" + std::to_string(selection.kept.size()) + " ";
    if (frame.timestamp == 3) return std::nullopt;
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.translation().x() = frame.timestamp;
    trajectory_.push_back({frame.timestamp, pose});
    return pose;
  }
  Trajectory trajectory() const override { return trajectory_; }
  void finish() override { calls += "finish"; }

  std::string calls;

 private:
  std::vector<cv::KeyPoint> keypoints_{{5, 5, 1}, {20, 9, 1}};
  Trajectory trajectory_;
};

/// Keeps the poses that it is told.
struct Listening : NoFrontEnd {
  void correct_pose(const Eigen::Isometry3d& pose) { told.push_back(pose.translation().x()); }
  std::vector<double> told;
};

TEST(RunSequence, RunsEachFrameThroughAndWritesTheTrajectory) {
  Recording folder;
  Scripted tracker;
  Listening front_end;
  SequenceRun run;
  run.frames = 4;
  run.trajectory = folder / "out.txt";
  std::string seen;
  run.loaded = [&](std::size_t i, const RgbdFrame&) { seen += "loaded" + std::to_string(i) + " "; };
  run.tracked = [&](const TrackedFrame& t) {
    seen += (t.T_world_camera ? "tracked" : "lost") + std::to_string(t.index) + " ";
    EXPECT_EQ(t.keypoints.size(), 2u);
    EXPECT_EQ(t.selection.kept, (std::vector<int>{0, 1}));
    EXPECT_GE(t.total_ms, t.tracking_ms);
  };
  const Trajectory poses = run_sequence(TumSequence(folder.path()), front_end, tracker, run);
  EXPECT_EQ(tracker.calls,
            "extract1 track2 extract2 track2 extract3 track2 extract4 track2 finish");
  EXPECT_EQ(seen, "loaded0 tracked0 loaded1 tracked1 loaded2 lost2 loaded3 tracked3 ");
  EXPECT_EQ(front_end.told, (std::vector<double>{1, 2, 4}));
  ASSERT_EQ(poses.size(), 3u);
  EXPECT_EQ(trajectory_text(read_trajectory(folder / "out.txt")), trajectory_text(poses));
}

TEST(RunSequence, DropsFramesForWhoeverIsLate) {
  Recording folder;
  Scripted tracker;
  NoFrontEnd front_end;
  SequenceRun run;
  run.choose = [](std::size_t i) { return i == 1 ? std::size_t{4} : i; };
  run_sequence(TumSequence(folder.path()), front_end, tracker, run);
  EXPECT_EQ(tracker.calls, "extract1 track2 extract5 track2 extract6 track2 finish");
}

TEST(RunSequence, KeepsWhatWasTrackedBeforeAFailure) {
  Recording folder;
  folder.write("rgb/5.png", "no image");
  folder.write("out.txt", "of an earlier run");
  Scripted tracker;
  NoFrontEnd front_end;
  SequenceRun run;
  run.trajectory = folder / "out.txt";
  EXPECT_ERROR(run_sequence(TumSequence(folder.path()), front_end, tracker, run), "5.png");
  EXPECT_EQ(read_file(folder / "out.txt", "trajectory"), "of an earlier run");
  EXPECT_EQ(read_trajectory(folder / "out.txt.partial").size(), 3u);
}

TEST(RunSequence, TakesTheFrontEnd) {
  Recording folder;
  Scripted tracker;
  FrontEnd front_end;
  run_sequence(TumSequence(folder.path()), front_end, tracker);
  EXPECT_DOUBLE_EQ(front_end.stats().timestamp, 6);
  EXPECT_EQ(front_end.stats().keypoints, 2);
}

}  // namespace
