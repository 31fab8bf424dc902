// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/io/trajectory_file.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "temporary_folder.hpp"

namespace {

using stillpoint::read_trajectory;
using stillpoint::Trajectory;

TEST(TrajectoryFile, ReadsWhatTumWrites) {
  TemporaryFolder folder;
  const auto path = folder.write("t.txt",
                                 "# ground truth trajectory\r\n"
                                 "1305031449.7996 1.2334 -0.0113 1.6941 0.7907 0.4393 -0.1770 "
                                 "-0.3879\r\n\n"
                                 "  1305031449.8096\t1e-3 0 0 0 0 0 2");
  const Trajectory t = read_trajectory(path);
  ASSERT_EQ(t.size(), 2u);
  EXPECT_DOUBLE_EQ(t[0].timestamp, 1305031449.7996);
  EXPECT_DOUBLE_EQ(t[0].T_world_camera.translation().z(), 1.6941);
  const Eigen::Matrix3d R = t[0].T_world_camera.linear();
  EXPECT_LT((R * R.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-12);
  const Eigen::Quaterniond q(R);
  EXPECT_NEAR(std::abs(q.w()), 0.3879, 1e-4);
  EXPECT_NEAR(q.x() / q.w(), 0.7907 / -0.3879, 1e-9);
  EXPECT_TRUE(t[1].T_world_camera.linear().isIdentity(1e-12)) << "quaternion is normalised";
}

TEST(TrajectoryFile, WritesWhatItReads) {
  TemporaryFolder folder;
  Trajectory t(3);
  for (int i = 0; i < 3; ++i) {
    t[i].timestamp = 1341846313.592026 + i / 30.0;
    t[i].T_world_camera.translation() = Eigen::Vector3d(i * 0.1, -i, 1e-12 * i);
    t[i].T_world_camera.linear() =
        Eigen::AngleAxisd(2.5 * i, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  }
  stillpoint::write_trajectory(folder / "t.txt", t);
  const Trajectory back = read_trajectory(folder / "t.txt");
  ASSERT_EQ(back.size(), 3u);
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(back[i].timestamp, t[i].timestamp, 5e-7);
    EXPECT_TRUE(back[i].T_world_camera.isApprox(t[i].T_world_camera, 1e-8));
  }
  EXPECT_EQ(stillpoint::trajectory_text({t[0]}),
            "1341846313.592026 0.000000000 0.000000000 0.000000000 0.000000000 0.000000000 "
            "0.000000000 1.000000000\n");
}

TEST(TrajectoryFile, EmptyFileIsAnEmptyTrajectory) {
  TemporaryFolder folder;
  EXPECT_TRUE(read_trajectory(folder.write("t.txt", "# nothing\n")).empty());
}

TEST(TrajectoryFile, NamesFileAndLineOfBadInput) {
  TemporaryFolder folder;
  const auto read = [&](const std::string& text) {
    read_trajectory(folder.write("t.txt", "# header\n1 0 0 0 0 0 0 1\n" + text));
  };
  EXPECT_ERROR(read_trajectory(folder / "none.txt"), "none.txt", "no such file");
  EXPECT_ERROR(read_trajectory(folder.path()), "a folder");
  EXPECT_ERROR(read("2 0 0 0 0 0 1"), "t.txt", "line 3", "8 numbers", "found 7");
  EXPECT_ERROR(read("2,0,0,0,0,0,0,1"), "line 3", "commas");
  EXPECT_ERROR(read("nan 0 0 0 0 0 0 1"), "line 3", "timestamp", "\"nan\"");
  EXPECT_ERROR(read("-2 0 0 0 0 0 0 1"), "line 3", "not negative", "\"-2\"");
  EXPECT_ERROR(read("1403636579763555584 0 0 0 0 0 0 1"), "nanoseconds");
  EXPECT_ERROR(read("2 0 nan 0 0 0 0 1"), "line 3", "word 3", "\"nan\"", "lost frames");
  EXPECT_ERROR(read("2 0 0 inf 0 0 0 1"), "word 4");
  EXPECT_ERROR(read("2 0 0 1e999 0 0 0 1"), "word 4");
  EXPECT_ERROR(read("2 0 0 1.5x 0 0 0 1"), "word 4", "1.5x");
  EXPECT_ERROR(read("2 0 0 0 0 0 0 0"), "line 3", "quaternion");
  EXPECT_ERROR(read("1 0 0 0 0 0 0 1"), "line 3", "of line 2", "again", "sort");
  EXPECT_ERROR(read("0.5 0 0 0 0 0 0 1"), "line 3", "of line 2", "out of order");
}

TEST(TrajectoryFile, RefusesToWriteWhatCannotBeRead) {
  TemporaryFolder folder;
  Trajectory t(2);
  EXPECT_ERROR(stillpoint::trajectory_text(t), "trajectory[1]", "after 0.000000");
  t[1].timestamp = std::numeric_limits<double>::quiet_NaN();
  EXPECT_ERROR(stillpoint::trajectory_text(t), "trajectory[1].timestamp");
  t[1].timestamp = 1;
  t[1].T_world_camera.translation().x() = std::numeric_limits<double>::infinity();
  EXPECT_ERROR(stillpoint::trajectory_text(t), "trajectory[1].T_world_camera");
  EXPECT_ERROR(stillpoint::write_trajectory(folder / "no/such/t.txt", {}), "t.txt", "folder");
}

}  // namespace
