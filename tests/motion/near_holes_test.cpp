// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/motion/near_holes.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "wall_cells.hpp"

namespace {

using stillpoint::CellLabel;
using stillpoint::CellLabels;
using stillpoint::DepthCells;
using stillpoint::DepthShot;
using stillpoint::FreeSpaceMap;
using stillpoint::NearHoles;
using stillpoint::SensorModel;

constexpr int kWidth = 40, kHeight = 30;  // of wall_cells()
constexpr int kMargin = 2;                // cells on all sides that the depth camera never measures
const cv::Rect kImage(0, 0, kWidth, kHeight);
const cv::Rect kMeasured(kMargin, kMargin, kWidth - 2 * kMargin, kHeight - 2 * kMargin);
// Who stands right before the lens, cut off by the left border.
const cv::Rect kClose(0, 0, 14, kHeight);

// A room 3 m away, papered with bright and dark squares, before a camera that stands still.
class NearHolesTest : public testing::Test {
 protected:
  NearHolesTest() : room_(kHeight, kWidth) {
    for (int y = 0; y < kHeight; ++y)
      for (int x = 0; x < kWidth; ++x)
        room_(y, x) = static_cast<uchar>(60 + (x / 4 + y / 4) % 2 * 60);
    set_depth(kImage, 3);
    for (int i = 0; i < 10; ++i) remember();
  }

  // A depth of -1 is a hole.
  void set_depth(const cv::Rect& area, float metres) {
    for (int y = area.y; y < area.br().y; ++y)
      for (int x = area.x; x < area.br().x; ++x)
        cells_.depth_m[cells_.index(x, y)] = kMeasured.contains({x, y}) ? metres : -1;
  }
  void remember() {
    map_.add({now_s_, Eigen::Isometry3d::Identity()}, cells_,
             std::vector<std::uint8_t>(cells_.size(), 0), {}, room_);
    now_s_ += 0.1;
  }

  // Share of an area that is labelled as too near, in the next frame.
  double share_near(const cv::Rect& area, const cv::Mat_<uchar>& gray, bool pose_known = true) {
    CellLabels labels;
    const DepthShot shot{now_s_, Eigen::Isometry3d::Identity()};
    if (pose_known) map_.judge(shot, cells_, labels);
    near_.find(now_s_, cells_, gray, pose_known ? &shot : nullptr, map_, labels);
    now_s_ += 0.1;
    if (labels.empty()) return 0;
    int n = 0;
    for (int y = area.y; y < area.br().y; ++y)
      for (int x = area.x; x < area.br().x; ++x)
        n += labels[cells_.index(x, y)] == CellLabel::kNear;
    return n / static_cast<double>(area.area());
  }

  // The room with somebody before it.
  cv::Mat_<uchar> with(const cv::Rect& area, uchar brightness = 200) const {
    cv::Mat_<uchar> gray = room_.clone();
    gray(area).setTo(brightness);
    return gray;
  }

  DepthCells cells_ = stillpoint::wall_cells(3);
  cv::Mat_<uchar> room_;
  FreeSpaceMap map_{SensorModel::exact()};
  NearHoles near_{SensorModel::exact()};
  double now_s_ = 0;
};

// And into the margin, where depth is never measured.
TEST_F(NearHolesTest, FindsWhoStandsRightBeforeTheLens) {
  set_depth(kClose, -1);
  EXPECT_EQ(share_near(kClose, with(kClose)), 1);
  EXPECT_EQ(share_near({kClose.br().x, 0, kWidth - kClose.width, kHeight}, with(kClose)), 0);
}

TEST_F(NearHolesTest, LetsTheExposureChange) {
  set_depth(kClose, -1);
  EXPECT_EQ(share_near(kClose, with(kClose) + 40), 1);
  EXPECT_EQ(share_near(kClose, room_ + 40), 0);
}

TEST_F(NearHolesTest, LeavesWhereTheSensorFails) {
  set_depth(kClose, -1);
  EXPECT_EQ(share_near(kImage, room_), 0);
  set_depth(kImage, -1);
  EXPECT_EQ(share_near(kImage, room_), 0);
}

// It must be cut off by the border, and large.
TEST_F(NearHolesTest, LeavesHolesOfAnotherShape) {
  const cv::Rect amid(10, 8, 14, 14);
  set_depth(amid, -1);
  EXPECT_EQ(share_near(kImage, with(amid)), 0);
  set_depth(amid, 3);
  const cv::Rect small(0, 8, 6, 10);
  set_depth(small, -1);
  EXPECT_EQ(share_near(kImage, with(small)), 0);
}

// Black things are holes whenever they are looked at, and what is new in view was never measured.
TEST_F(NearHolesTest, LeavesWhatWasNotMeasuredBefore) {
  set_depth(kClose, -1);
  for (int i = 0; i < 20; ++i) remember();
  EXPECT_EQ(share_near(kImage, with(kClose)), 0);
}

// A surface that may be too near itself now is no witness.
TEST_F(NearHolesTest, LeavesTheWallThatTheCameraComesTooCloseTo) {
  set_depth(kImage, 0.9f);
  for (int i = 0; i < 20; ++i) remember();
  set_depth(kClose, -1);
  EXPECT_EQ(share_near(kImage, with(kClose)), 0);
}

// Color and depth are taken at different moments and from different places.
TEST_F(NearHolesTest, LeavesWhatTheImageShowsBesideThem) {
  const cv::Rect hole(0, 0, 28, kHeight);
  set_depth(hole, -1);
  EXPECT_EQ(share_near({0, 0, 12, kHeight}, with(kClose)), 1);
  EXPECT_EQ(share_near({18, 4, 8, 22}, with(kClose)), 0);
  // A pattern that is not the room's is theirs.
  cv::Mat_<uchar> other = room_.clone();
  other(hole) = 240 - room_(hole);
  EXPECT_EQ(share_near(hole, other), 1);
}

TEST_F(NearHolesTest, FollowsThemWhileThePoseIsLost) {
  set_depth(kClose, -1);
  ASSERT_EQ(share_near(kClose, with(kClose)), 1);
  set_depth(kImage, -1);  // more than half of that is new
  EXPECT_EQ(share_near(kImage, with(kImage), false), 0);
  set_depth(kImage, 3), set_depth(kClose, -1);
  ASSERT_EQ(share_near(kClose, with(kClose)), 1);
  const cv::Rect wider(0, 0, 22, kHeight);
  set_depth(wider, -1);
  EXPECT_EQ(share_near(wider, with(wider), false), 1);
  set_depth(wider, 3);
  EXPECT_EQ(share_near(kImage, room_, false), 0);
}

TEST_F(NearHolesTest, FollowsThemForTwoSeconds) {
  set_depth(kClose, -1);
  ASSERT_EQ(share_near(kClose, with(kClose)), 1);
  for (int i = 1; i < 20; ++i) ASSERT_EQ(share_near(kClose, with(kClose), false), 1) << i;
  now_s_ += 0.2;
  EXPECT_EQ(share_near(kImage, with(kClose), false), 0);
}

TEST_F(NearHolesTest, TakesWhatIsMeasuredOfThem) {
  const cv::Rect arm(kClose.br().x, 10, 5, 10), table(kClose.br().x, 22, 20, 6);
  set_depth(table, 0.8f);
  for (int i = 0; i < 20; ++i) remember();  // it has always stood there
  set_depth(kClose, -1), set_depth(arm, 0.7f);
  EXPECT_EQ(share_near(arm, with(kClose)), 1);
  EXPECT_EQ(share_near({table.x + 1, table.y, 18, 5}, with(kClose)), 0);
}

TEST_F(NearHolesTest, ForgetsThem) {
  set_depth(kClose, -1);
  ASSERT_EQ(share_near(kClose, with(kClose)), 1);
  near_.reset();
  EXPECT_EQ(share_near(kImage, with(kClose), false), 0);
}

}  // namespace
