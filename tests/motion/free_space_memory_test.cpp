// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/motion/free_space_memory.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

namespace {

using stillpoint::CellEvidence;
using stillpoint::CoarseFrame;
using stillpoint::FreeSpaceMemory;

// 40 x 30 cells that see a wall across the view, `depth_m` away.
CoarseFrame wall(float depth_m) {
  CoarseFrame frame;
  frame.width = 40, frame.height = 30;
  frame.fx = frame.fy = 32;
  frame.cx = 19.5f, frame.cy = 14.5f;
  frame.depth_m.assign(frame.size(), depth_m);
  return frame;
}

Eigen::Isometry3d forward(double metres) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation().z() = metres;
  return T;
}

Eigen::Isometry3d turned(double degrees, const Eigen::Vector3d& axis) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = Eigen::AngleAxisd(degrees / 180 * 3.14159265, axis).toRotationMatrix();
  return T;
}

// Remembers a wall 4 m away; the cells with `dynamic` are somebody's.
class FreeSpace : public testing::Test {
 protected:
  void remember(const std::vector<std::uint8_t>& dynamic) {
    memory_.add(0, Eigen::Isometry3d::Identity(), wall(4), dynamic);
  }
  void remember() { remember(std::vector<std::uint8_t>(wall(4).size(), 0)); }

  std::vector<CellEvidence> judge(const Eigen::Isometry3d& T_world_camera,
                                  const CoarseFrame& frame) {
    std::vector<CellEvidence> evidence;
    memory_.judge(0.1, T_world_camera, frame, evidence);
    EXPECT_EQ(evidence.size(), frame.size());
    return evidence;
  }

  // Checks every cell but those at the rim, of which nothing is known.
  template <class Expected>
  static void expect(const std::vector<CellEvidence>& evidence, const CoarseFrame& frame,
                     Expected&& expected) {
    for (int y = 0; y < frame.height; ++y)
      for (int x = 0; x < frame.width; ++x) {
        const bool rim = x == 0 || y == 0 || x == frame.width - 1 || y == frame.height - 1;
        EXPECT_EQ(static_cast<int>(evidence[frame.index(x, y)]),
                  static_cast<int>(rim ? CellEvidence::kUnknown : expected(x, y)))
            << "cell " << x << ", " << y;
      }
  }

  FreeSpaceMemory memory_;
};

TEST_F(FreeSpace, TellsWhatStoodThereFromWhatCame) {
  remember();
  CoarseFrame frame = wall(4);
  for (int y = 8; y < 20; ++y)
    for (int x = 5; x < 11; ++x) frame.depth_m[frame.index(x, y)] = 2;  // somebody
  frame.depth_m[frame.index(30, 10)] = 0;                               // not measured
  frame.depth_m[frame.index(31, 10)] = 6;                               // the wall is gone
  expect(judge(forward(0), frame), frame, [](int x, int y) {
    if (x >= 5 && x < 11 && y >= 8 && y < 20) return CellEvidence::kMoved;
    return y == 10 && (x == 30 || x == 31) ? CellEvidence::kUnknown : CellEvidence::kStatic;
  });
}

TEST_F(FreeSpace, KnowsThePlaceWhereverTheCameraGoes) {
  remember();
  std::vector<CellEvidence> nearer = judge(forward(1), wall(3));
  for (const CellEvidence e : nearer) EXPECT_EQ(e, CellEvidence::kStatic);
  // From 1 m behind, the outer cells see what was not in view: u = cx + (x - cx) * 5 / 4.
  const CoarseFrame frame = wall(5);
  expect(judge(forward(-1), frame), frame, [](int x, int y) {
    return x >= 5 && x <= 34 && y >= 4 && y <= 25 ? CellEvidence::kStatic : CellEvidence::kUnknown;
  });
}

TEST_F(FreeSpace, SaysNothingOfWhatWasNotInView) {
  remember();
  for (const Eigen::Vector3d axis : {Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY()})
    for (const double degrees : {70.0, -70.0, 180.0, 90.0}) {
      const CoarseFrame frame = wall(2);
      expect(judge(turned(degrees, axis), frame), frame,
             [](int, int) { return CellEvidence::kUnknown; });
    }
  // A place right at the camera of before, and one a little behind it.
  for (const float z : {1.0f, 0.9f, 1.2f}) {
    const CoarseFrame frame = wall(z);
    expect(judge(forward(-1), frame), frame, [](int, int) { return CellEvidence::kUnknown; });
  }
}

TEST_F(FreeSpace, DoesNotTakeForStaticWhatWasDynamic) {
  const CoarseFrame frame = wall(4);
  std::vector<std::uint8_t> dynamic(frame.size(), 0);
  for (int y = 0; y < frame.height; ++y)
    for (int x = 0; x < 20; ++x) dynamic[frame.index(x, y)] = 1;
  remember(dynamic);
  expect(judge(forward(0), frame), frame,
         [](int x, int) { return x < 20 ? CellEvidence::kUnknown : CellEvidence::kStatic; });
}

TEST_F(FreeSpace, MovesTheNewestFrameAndForgetsAll) {
  remember();
  memory_.set_newest_pose(forward(0.5));
  for (const CellEvidence e : judge(forward(0.5), wall(5))) EXPECT_EQ(e, CellEvidence::kUnknown);
  const CoarseFrame frame = wall(4);
  expect(judge(forward(0.5), frame), frame, [](int, int) { return CellEvidence::kStatic; });
  memory_.clear();
  EXPECT_TRUE(memory_.empty());
  for (const CellEvidence e : judge(forward(0), wall(4))) EXPECT_EQ(e, CellEvidence::kUnknown);
}

// A frame that sees a surface `depth_m` away and nothing at all in the cells of `hole`.
CoarseFrame with_hole(float depth_m, const cv::Rect& hole) {
  CoarseFrame frame = wall(depth_m);
  for (int y = hole.y; y < hole.y + hole.height; ++y)
    for (int x = hole.x; x < hole.x + hole.width; ++x) frame.depth_m[frame.index(x, y)] = -1;
  return frame;
}

class Holes : public FreeSpace {
 protected:
  // What is said of the hole's middle, after a wall at the end of the range and then `earlier` were
  // seen, when something stands there `depth_m` away.
  CellEvidence after(const CoarseFrame& earlier, float depth_m,
                     const std::vector<std::uint8_t>& dynamic) {
    memory_.add(-2, Eigen::Isometry3d::Identity(), wall(4), std::vector<std::uint8_t>(1200, 1));
    memory_.clear();  // the range stays known
    memory_.add(0, Eigen::Isometry3d::Identity(), earlier, dynamic);
    CoarseFrame now = earlier;
    now.depth_m[now.index(20, 15)] = depth_m;
    return judge(forward(0), now)[now.index(20, 15)];
  }
  CellEvidence after(const CoarseFrame& earlier, float depth_m) {
    return after(earlier, depth_m, std::vector<std::uint8_t>(earlier.size(), 0));
  }

  const cv::Rect large_{12, 8, 16, 14}, small_{17, 12, 7, 7};
};

TEST_F(Holes, AtTheEndOfTheRangeAreFreeSpace) {
  EXPECT_EQ(after(with_hole(3.8f, large_), 2), CellEvidence::kMoved);
  // Too near for the sensor, or as far as it hardly reaches: it may have stood there.
  EXPECT_EQ(after(with_hole(3.8f, large_), 0.9f), CellEvidence::kUnknown);
  EXPECT_EQ(after(with_hole(3.8f, large_), 3.3f), CellEvidence::kUnknown);
}

TEST_F(Holes, AmidNearSurfacesOrSmallSayNothing) {
  EXPECT_EQ(after(with_hole(2.5f, large_), 2), CellEvidence::kUnknown);
  EXPECT_EQ(after(with_hole(3.8f, small_), 2), CellEvidence::kUnknown);
}

TEST_F(Holes, AreNotBorderedByPeople) {
  // Somebody stands before most of the border; the rest of it is far away.
  CoarseFrame frame = with_hole(3.8f, large_);
  std::vector<std::uint8_t> dynamic(frame.size(), 0);
  for (int y = 0; y < 30; ++y)
    for (int x = 0; x < 40; ++x)
      if (frame.depth_m[frame.index(x, y)] > 0 && x < 27) frame.depth_m[frame.index(x, y)] = 1.5f;
  EXPECT_EQ(after(frame, 2), CellEvidence::kUnknown);
  for (std::size_t i = 0; i < frame.size(); ++i) dynamic[i] = frame.depth_m[i] == 1.5f;
  EXPECT_EQ(after(frame, 2, dynamic), CellEvidence::kMoved);
}

}  // namespace
