// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/motion/free_space_map.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <limits>
#include <opencv2/core.hpp>
#include <vector>

#include "wall_cells.hpp"

namespace {

using stillpoint::CellLabel;
using stillpoint::CellLabels;
using stillpoint::DepthCells;
using stillpoint::FreeSpaceMap;
using stillpoint::SensorModel;
using stillpoint::wall_cells;

const Eigen::Vector2f kExact = Eigen::Vector2f::Zero();

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
    map_.add({0, Eigen::Isometry3d::Identity(), kExact}, wall_cells(4), dynamic);
  }
  void remember() { remember(std::vector<std::uint8_t>(wall_cells(4).size(), 0)); }

  CellLabels judge(const Eigen::Isometry3d& T_world_camera, const DepthCells& frame) {
    CellLabels evidence;
    map_.judge({0.1, T_world_camera, kExact}, frame, evidence);
    EXPECT_EQ(evidence.size(), frame.size());
    return evidence;
  }

  // Checks every cell but those at the rim, of which nothing is known.
  template <class Expected>
  static void expect(const CellLabels& evidence, const DepthCells& frame, Expected&& expected) {
    for (int y = 0; y < frame.height; ++y)
      for (int x = 0; x < frame.width; ++x) {
        const bool rim = x == 0 || y == 0 || x == frame.width - 1 || y == frame.height - 1;
        EXPECT_EQ(static_cast<int>(evidence[frame.index(x, y)]),
                  static_cast<int>(rim ? CellLabel::kUnknown : expected(x, y)))
            << "cell " << x << ", " << y;
      }
  }

  FreeSpaceMap map_;
};

// Nothing is free where nobody knows how far beside the cells lie.
TEST_F(FreeSpace, SaysNothingOfCellsThatMayLieAnywhere) {
  remember();
  const DepthCells near = wall_cells(2);
  for (const float reach :
       {1e30f, std::numeric_limits<float>::infinity(), std::numeric_limits<float>::quiet_NaN()}) {
    CellLabels labels;
    map_.judge({0.1, Eigen::Isometry3d::Identity(), {reach, reach}}, near, labels);
    expect(labels, near, [](int, int) { return CellLabel::kUnknown; });
  }
}

TEST_F(FreeSpace, TellsWhatStoodThereFromWhatCame) {
  remember();
  DepthCells frame = wall_cells(4);
  for (int y = 8; y < 20; ++y)
    for (int x = 5; x < 11; ++x) frame.depth_m[frame.index(x, y)] = 2;  // somebody
  frame.depth_m[frame.index(30, 10)] = 0;                               // not measured
  frame.depth_m[frame.index(31, 10)] = 6;                               // the wall is gone
  expect(judge(forward(0), frame), frame, [](int x, int y) {
    if (x >= 5 && x < 11 && y >= 8 && y < 20) return CellLabel::kMoved;
    return y == 10 && (x == 30 || x == 31) ? CellLabel::kUnknown : CellLabel::kStatic;
  });
}

TEST_F(FreeSpace, KnowsThePlaceWhereverTheCameraGoes) {
  remember();
  const CellLabels nearer = judge(forward(1), wall_cells(3));
  for (std::size_t i = 0; i < nearer.size(); ++i) EXPECT_EQ(nearer[i], CellLabel::kStatic);
  // From 1 m behind, the outer cells see what was not in view: u = cx + (x - cx) * 5 / 4.
  const DepthCells frame = wall_cells(5);
  expect(judge(forward(-1), frame), frame, [](int x, int y) {
    return x >= 5 && x <= 34 && y >= 4 && y <= 25 ? CellLabel::kStatic : CellLabel::kUnknown;
  });
}

TEST_F(FreeSpace, SaysNothingOfWhatWasNotInView) {
  remember();
  for (const Eigen::Vector3d axis : {Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY()})
    for (const double degrees : {70.0, -70.0, 180.0, 90.0}) {
      const DepthCells frame = wall_cells(2);
      expect(judge(turned(degrees, axis), frame), frame,
             [](int, int) { return CellLabel::kUnknown; });
    }
  // A place right at the camera of before, and one a little behind it.
  for (const float z : {1.0f, 0.9f, 1.2f}) {
    const DepthCells frame = wall_cells(z);
    expect(judge(forward(-1), frame), frame, [](int, int) { return CellLabel::kUnknown; });
  }
}

TEST_F(FreeSpace, DoesNotTakeForStaticWhatWasDynamic) {
  const DepthCells frame = wall_cells(4);
  std::vector<std::uint8_t> dynamic(frame.size(), 0);
  for (int y = 0; y < frame.height; ++y)
    for (int x = 0; x < 20; ++x) dynamic[frame.index(x, y)] = 1;
  remember(dynamic);
  expect(judge(forward(0), frame), frame,
         [](int x, int) { return x < 20 ? CellLabel::kUnknown : CellLabel::kStatic; });
}

TEST_F(FreeSpace, KnowsWhatStoodAlone) {
  const DepthCells frame = wall_cells(4);
  std::vector<std::uint8_t> dynamic(frame.size(), 0), touching(frame.size(), 0);
  for (int y = 0; y < frame.height; ++y)
    for (int x = 0; x < 20; ++x) touching[frame.index(x, y)] = 1;
  map_.add({0, Eigen::Isometry3d::Identity(), kExact}, frame, dynamic, touching);
  CellLabels labels = judge(forward(0), frame);
  labels.find_wide_static();
  const int px = labels.block_px();
  EXPECT_TRUE(labels.known_static({10 * px, 15 * px}));
  EXPECT_FALSE(labels.stood_alone({10 * px, 15 * px}));
  EXPECT_TRUE(labels.known_static({30 * px, 15 * px}));
  EXPECT_TRUE(labels.stood_alone({30 * px, 15 * px}));
  EXPECT_FALSE(labels.stood_alone({-1 + 40 * px, 15 * px})) << "the rim is not even static";
  // One frame in which it stood alone is enough.
  map_.clear();
  map_.add({-0.1, Eigen::Isometry3d::Identity(), kExact}, frame, dynamic);
  map_.add({0, Eigen::Isometry3d::Identity(), kExact}, frame, dynamic, touching);
  labels = judge(forward(0), frame);
  labels.find_wide_static();
  EXPECT_TRUE(labels.stood_alone({10 * px, 15 * px}));
}

// Among three older frames in which it did not, too.
TEST_F(FreeSpace, OneFrameInWhichItStoodAloneIsEnough) {
  const DepthCells frame = wall_cells(4);
  const std::vector<std::uint8_t> none(frame.size(), 0), all(frame.size(), 1);
  for (const double age_s : {1.6, 1.0, 0.6, 0.35, 0.2, 0.1})
    map_.add({0.1 - age_s, Eigen::Isometry3d::Identity(), kExact}, frame, none,
             age_s > 0.3 ? all : none);
  CellLabels labels = judge(forward(0), frame);
  labels.find_wide_static();
  EXPECT_TRUE(labels.stood_alone({20 * labels.block_px(), 15 * labels.block_px()}));
}

// A depth image that comes later than one that was taken after it.
TEST_F(FreeSpace, DoesNotLookIntoTheFuture) {
  remember();
  CellLabels labels;
  map_.judge({-0.1, Eigen::Isometry3d::Identity(), kExact}, wall_cells(2), labels);
  for (std::size_t i = 0; i < labels.size(); ++i) EXPECT_EQ(labels[i], CellLabel::kUnknown);
}

TEST_F(FreeSpace, MovesTheNewestFrameAndForgetsAll) {
  remember();
  const DepthShot kept{0, forward(0.5), kExact}, left_out{0.01, forward(2), kExact};
  map_.correct(kept);
  map_.add(left_out, wall_cells(4), {});
  map_.correct(left_out);
  const CellLabels moved = judge(forward(0.5), wall_cells(5));
  for (std::size_t i = 0; i < moved.size(); ++i) EXPECT_EQ(moved[i], CellLabel::kUnknown);
  const DepthCells frame = wall_cells(4);
  expect(judge(forward(0.5), frame), frame, [](int, int) { return CellLabel::kStatic; });
  map_.clear();
  EXPECT_TRUE(map_.empty());
  const CellLabels forgotten = judge(forward(0), wall_cells(4));
  for (std::size_t i = 0; i < forgotten.size(); ++i) EXPECT_EQ(forgotten[i], CellLabel::kUnknown);
}

// A frame that sees a surface `depth_m` away and nothing at all in the cells of `hole`.
DepthCells with_hole(float depth_m, const cv::Rect& hole) {
  DepthCells frame = wall_cells(depth_m);
  for (int y = hole.y; y < hole.y + hole.height; ++y)
    for (int x = hole.x; x < hole.x + hole.width; ++x) frame.depth_m[frame.index(x, y)] = -1;
  return frame;
}

class Holes : public FreeSpace {
 protected:
  // Lets the map see the end of the range, and forget all but that.
  void learn_range() {
    map_.add({-2, Eigen::Isometry3d::Identity(), kExact}, wall_cells(4),
             std::vector<std::uint8_t>(1200, 1));
    map_.clear();
  }
  // What is said of the hole's middle, after a wall at the end of the range and then `earlier`, for
  // a second, were seen, when something stands there `depth_m` away.
  CellLabel after(const DepthCells& earlier, float depth_m,
                  const std::vector<std::uint8_t>& dynamic, double since_s = -1) {
    learn_range();
    map_.add({since_s, Eigen::Isometry3d::Identity(), kExact}, earlier, dynamic);
    return now(earlier, depth_m, dynamic);
  }
  // The same, of what the map has seen so far and `earlier`.
  CellLabel now(const DepthCells& earlier, float depth_m,
                const std::vector<std::uint8_t>& dynamic) {
    map_.add({0, Eigen::Isometry3d::Identity(), kExact}, earlier, dynamic);
    DepthCells now = earlier;
    now.depth_m[now.index(20, 15)] = depth_m;
    return judge(forward(0), now)[now.index(20, 15)];
  }
  CellLabel after(const DepthCells& earlier, float depth_m) {
    return after(earlier, depth_m, std::vector<std::uint8_t>(earlier.size(), 0));
  }

  const cv::Rect large_{12, 8, 16, 14}, small_{17, 12, 7, 7};
};

TEST_F(Holes, AtTheEndOfTheRangeAreFreeSpace) {
  EXPECT_EQ(after(with_hole(3.8f, large_), 2), CellLabel::kMoved);
  // Too near for the sensor, or as far as it hardly reaches: it may have stood there.
  EXPECT_EQ(after(with_hole(3.8f, large_), 0.9f), CellLabel::kUnknown);
  EXPECT_EQ(after(with_hole(3.8f, large_), 3.3f), CellLabel::kUnknown);
}

TEST_F(Holes, AmidNearSurfacesOrSmallSayNothing) {
  EXPECT_EQ(after(with_hole(2.5f, large_), 2), CellLabel::kUnknown);
  EXPECT_EQ(after(with_hole(3.8f, small_), 2), CellLabel::kUnknown);
}

// Who passes right before the lens is a hole, too, with the wall beside him as its border.
TEST_F(Holes, SayNothingForTheFirstSecond) {
  const std::vector<std::uint8_t> none(1200, 0);
  EXPECT_EQ(after(with_hole(3.8f, large_), 2, none, -0.8), CellLabel::kUnknown);
  EXPECT_EQ(after(with_hole(3.8f, large_), 2, none, -1), CellLabel::kMoved);
}

TEST_F(Holes, StandInSpaceWhileTheCameraRotates) {
  const std::vector<std::uint8_t> none(1200, 0);
  const cv::Rect aside = large_ + cv::Point(10, 0);  // without the large one's middle
  DepthShot before{-1, Eigen::Isometry3d::Identity(), kExact};
  before.T_map_depth.rotate(
      Eigen::AngleAxisd(-std::atan(10 / wall_cells(4).fx), Eigen::Vector3d::UnitY()));
  learn_range();
  map_.add(before, with_hole(3.8f, aside), none);
  EXPECT_EQ(now(with_hole(3.8f, large_), 2, none), CellLabel::kMoved);
  // The same place in the image is another in space: there was a small hole, which says nothing.
  learn_range();
  DepthCells other = with_hole(3.8f, large_);
  for (int y = 12; y < 19; ++y)
    for (int x = 29; x < 33; ++x) other.depth_m[other.index(x, y)] = -1;
  map_.add(before, other, none);
  EXPECT_EQ(now(with_hole(3.8f, large_), 2, none), CellLabel::kUnknown);
}

TEST_F(Holes, SayNothingInARoomShorterThanTheRange) {
  SensorModel sensor;
  sensor.max_range_m = 5;
  map_ = FreeSpaceMap(sensor);
  EXPECT_EQ(after(with_hole(3.8f, large_), 2), CellLabel::kUnknown);
}

// Depth that is registered to color ends before the image does.
TEST_F(Holes, SayNothingWhereTheDepthCameraDoesNotSee) {
  const DepthCells frame = with_hole(3.9f, {30, 0, 10, 30});
  const std::vector<std::uint8_t> none(frame.size(), 0);
  DepthCells now = wall_cells(3.9f);
  for (int y = 0; y < now.height; ++y)
    for (int x = 30; x < now.width; ++x) now.depth_m[now.index(x, y)] = 2;
  const std::size_t in_margin = now.index(35, 15);
  for (const double s : {-1.0, 0.0})
    map_.add({s, Eigen::Isometry3d::Identity(), kExact}, frame, none);
  EXPECT_EQ(judge(forward(0), now)[in_margin], CellLabel::kUnknown);
  // Where it has measured anything, it is no margin.
  map_.add({0.05, Eigen::Isometry3d::Identity(), kExact}, wall_cells(3.9f),
           std::vector<std::uint8_t>(frame.size(), 1));
  map_.clear();
  for (const double s : {-1.0, 0.0})
    map_.add({s, Eigen::Isometry3d::Identity(), kExact}, frame, none);
  EXPECT_EQ(judge(forward(0), now)[in_margin], CellLabel::kMoved);
}

TEST_F(Holes, AreNotBorderedByPeople) {
  // Somebody stands before most of the border; the rest of it is far away.
  DepthCells frame = with_hole(3.8f, large_);
  std::vector<std::uint8_t> dynamic(frame.size(), 0);
  for (int y = 0; y < 30; ++y)
    for (int x = 0; x < 40; ++x)
      if (frame.depth_m[frame.index(x, y)] > 0 && x < 27) frame.depth_m[frame.index(x, y)] = 1.5f;
  EXPECT_EQ(after(frame, 2), CellLabel::kUnknown);
  for (std::size_t i = 0; i < frame.size(); ++i) dynamic[i] = frame.depth_m[i] == 1.5f;
  EXPECT_EQ(after(frame, 2, dynamic), CellLabel::kMoved);
}

TEST_F(Holes, TellFreeSpaceAgainSomeSecondsAfterANoisyPatch) {
  // A patch at 9 m in a room of 4 m, once: then the wall is no longer at the end of the range.
  DepthCells noisy = wall_cells(4);
  for (int y = 10; y < 14; ++y)
    for (int x = 10; x < 14; ++x) noisy.depth_m[noisy.index(x, y)] = 9;
  const std::vector<std::uint8_t> none(noisy.size(), 0);
  map_.add({-20, Eigen::Isometry3d::Identity(), kExact}, noisy, none);
  for (double t = -19.9; t < -2.5; t += 0.1)
    map_.add({t, Eigen::Isometry3d::Identity(), kExact}, wall_cells(4), none);
  EXPECT_EQ(after(with_hole(3.8f, large_), 2), CellLabel::kMoved);
}

TEST_F(FreeSpace, SaysNothingBesideASurfaceThatMayLieAside) {
  // A pillar at 2 m in cells 20 to 24; now it is seen three cells further right.
  DepthCells before = wall_cells(4), now = wall_cells(4);
  for (int y = 0; y < 30; ++y)
    for (int x = 20; x < 25; ++x)
      before.depth_m[before.index(x, y)] = 2, now.depth_m[now.index(x + 3, y)] = 2;
  const std::vector<std::uint8_t> none(before.size(), 0);
  for (const float sideways : {0.0f, 4.0f}) {
    map_.clear();
    map_.add({0, Eigen::Isometry3d::Identity(), {sideways / 2, 0}}, before, none);
    CellLabels labels;
    map_.judge({0.1, Eigen::Isometry3d::Identity(), {sideways / 2, 0}}, now, labels);
    EXPECT_EQ(labels[now.index(27, 15)], sideways > 0 ? CellLabel::kUnknown : CellLabel::kMoved);
  }
}

TEST_F(FreeSpace, FindsWhoGoesStraightAwayButNotWhatComesIntoView) {
  const std::vector<std::uint8_t> none(wall_cells(4).size(), 0);
  const auto person = [](float z) {
    DepthCells frame = wall_cells(4);
    for (int y = 8; y < 20; ++y)
      for (int x = 10; x < 20; ++x) frame.depth_m[frame.index(x, y)] = z;
    return frame;
  };
  for (int i = 0; i < 20; ++i)
    map_.add({0.05 * i, Eigen::Isometry3d::Identity(), kExact},
             person(1.5f + 0.04f * static_cast<float>(i)), none);
  CellLabels labels;
  map_.judge({1, Eigen::Isometry3d::Identity(), kExact}, person(2.3f), labels);
  EXPECT_EQ(labels[wall_cells(4).index(15, 14)], CellLabel::kMoved);
  // What he hid is in view again: it was as far behind him at any time.
  map_.clear();
  for (int i = 0; i < 20; ++i)
    map_.add({0.05 * i, Eigen::Isometry3d::Identity(), kExact}, person(2), none);
  map_.judge({1, Eigen::Isometry3d::Identity(), kExact}, person(2.4f), labels);
  EXPECT_EQ(labels[wall_cells(4).index(15, 14)], CellLabel::kUnknown);
}

// Six images, 1.6 to 0.1 s old, of a wall that was hidden, or away, in some of them.
TEST_F(FreeSpace, BelievesTheOldestImages) {
  const std::vector<std::uint8_t> none(wall_cells(4).size(), 0);
  const std::vector<double> ages_s = {1.6, 1.0, 0.6, 0.35, 0.2, 0.1};
  const auto label = [&](const std::vector<float>& seen_m) {
    map_.clear();
    for (std::size_t i = 0; i < ages_s.size(); ++i)
      map_.add({2 - ages_s[i], Eigen::Isometry3d::Identity(), kExact}, wall_cells(seen_m[i]), none);
    CellLabels labels;
    map_.judge({2, Eigen::Isometry3d::Identity(), kExact}, wall_cells(3), labels);
    const std::size_t middle = wall_cells(3).index(15, 14);
    EXPECT_TRUE(labels.seen(middle));
    EXPECT_EQ(map_.settled(middle), labels[middle] != CellLabel::kMoved);
    return labels[middle];
  };
  EXPECT_EQ(label({3, 3, 3, 3, 3, 3}), CellLabel::kStatic);
  EXPECT_EQ(label({4, 3, 3, 3, 3, 3}), CellLabel::kMoved) << "it has come and stayed";
  EXPECT_EQ(label({2, 2, 2, 2, 2, 4}), CellLabel::kMoved) << "free once, and never the same";
  EXPECT_EQ(label({3, 3, 3, 4, 4, 4}), CellLabel::kStatic) << "it was away for a moment";
  EXPECT_EQ(label({2, 3, 3, 2, 4, 2}), CellLabel::kUnknown) << "as often free as filled";
  EXPECT_EQ(label({2, 3, 2, 4, 4, 2}), CellLabel::kMoved);
}

TEST_F(FreeSpace, ForgetsAnImageWhoseStampWasWrong) {
  const std::vector<std::uint8_t> none(wall_cells(4).size(), 0);
  const auto add = [&](double timestamp, float wall_m) {
    map_.add({timestamp, Eigen::Isometry3d::Identity(), kExact}, wall_cells(wall_m), none);
  };
  const auto oldest_s = [&](double now) {
    std::vector<const stillpoint::DepthKeyView*> views;
    map_.views_at(now, std::array<double, 1>{1.7}, views);
    return views.empty() ? -1 : views[0]->shot.timestamp;
  };
  add(0.45, 4);  // of time 0
  add(0.04, 2);
  EXPECT_EQ(oldest_s(0.5), 0.45) << "one alone may be wrong itself";
  add(0.08, 2);
  EXPECT_EQ(oldest_s(0.5), 0.08);
  for (int i = 3; i < 20; ++i) add(0.04 * i, 2);
  CellLabels labels;
  map_.judge({0.8, Eigen::Isometry3d::Identity(), kExact}, wall_cells(2), labels);
  EXPECT_EQ(labels[wall_cells(2).index(15, 14)], CellLabel::kStatic);
  add(0.2, 4);  // one that is too old is left out, and no other is forgotten for it
  add(0.8, 2);
  add(0.3, 4);
  EXPECT_EQ(oldest_s(0.8), 0.08);
  map_.judge({0.84, Eigen::Isometry3d::Identity(), kExact}, wall_cells(2), labels);
  EXPECT_EQ(labels[wall_cells(2).index(15, 14)], CellLabel::kStatic);
}

TEST_F(FreeSpace, RemembersSecondsNotFrames) {
  const std::vector<std::uint8_t> none(wall_cells(4).size(), 0);
  for (const double hz : {10.0, 30.0, 60.0, 90.0}) {
    SCOPED_TRACE(hz);
    map_.clear();
    for (int i = 0; i < static_cast<int>(1.5 * hz); ++i)
      map_.add({i / hz, Eigen::Isometry3d::Identity(), kExact},
               i < 0.2 * hz ? wall_cells(4) : wall_cells(2),
               std::vector<std::uint8_t>(none.size(), i < 0.2 * hz ? 0 : 1));
    CellLabels labels;
    map_.judge({1.5, Eigen::Isometry3d::Identity(), kExact}, wall_cells(2), labels);
    EXPECT_EQ(labels[wall_cells(4).index(15, 14)], CellLabel::kMoved) << "1.4 s ago it was free";
    map_.judge({3.5, Eigen::Isometry3d::Identity(), kExact}, wall_cells(2), labels);
    EXPECT_EQ(labels[wall_cells(4).index(15, 14)], CellLabel::kUnknown) << "too long ago";
  }
}

}  // namespace
