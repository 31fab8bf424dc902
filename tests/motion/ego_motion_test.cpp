// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/motion/ego_motion.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <opencv2/core.hpp>
#include <optional>

namespace {

using namespace stillpoint;

Eigen::Isometry3d moved(double x, double deg = 0) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation().x() = x;
  T.linear() = Eigen::AngleAxisd(deg * CV_PI / 180, Eigen::Vector3d::UnitY()).toRotationMatrix();
  return T;
}

// A camera that sees nothing of its own motion: what is known comes from the host.
struct Driver {
  EgoMotion ego;
  FrameContext context;

  std::optional<Eigen::Isometry3d> track(
      double t, const std::optional<Eigen::Isometry3d>& host = std::nullopt) {
    RgbdFrame frame;
    frame.color = cv::Mat(48, 64, CV_8UC1, cv::Scalar(90));
    frame.timestamp = t;
    context.begin(frame, Camera());
    ego.track(context, host);
    return context.T_current_last;
  }
};

TEST(EgoMotion, TakesTheHostsPredictionAndThenItsPose) {
  Driver d;
  d.track(0);
  d.ego.correct(moved(5));
  ASSERT_TRUE(d.track(0.1, moved(-0.02)));
  EXPECT_NEAR(d.ego.pose().translation().x(), 0.02, 1e-12);
  d.ego.correct(moved(5.03));
  EXPECT_NEAR(d.ego.pose().translation().x(), 0.03, 1e-12) << "better than the prediction";
  EXPECT_NEAR(d.ego.motion()->translation().x(), -0.03, 1e-12);
  EXPECT_NEAR(d.ego.speed_m_s(), 0.3, 1e-9);
  EXPECT_NEAR(d.ego.pose_at(0.15).translation().x(), 0.045, 1e-9) << "on at the same speed";
}

TEST(EgoMotion, OfSeveralPosesForAFrameTheLastCounts) {
  Driver d;
  d.track(0);
  d.ego.correct(moved(4));
  d.ego.correct(moved(5));
  d.track(0.1, moved(-0.02));
  d.ego.correct(moved(5.1));
  d.ego.correct(moved(5.03));
  EXPECT_NEAR(d.ego.motion()->translation().x(), -0.03, 1e-12);
  EXPECT_NEAR(d.ego.pose().translation().x(), 0.03, 1e-12);
  d.track(0.2, moved(-0.02));
  d.ego.correct(moved(5.06));
  EXPECT_NEAR(d.ego.pose().translation().x(), 0.06, 1e-12);
}

TEST(EgoMotion, OfSeveralPosesForAFrameTheLastCountsWhereTheFirstIsFarOff) {
  for (const bool predicted : {false, true}) {
    SCOPED_TRACE(predicted);
    Driver d;
    d.track(0);
    d.ego.correct(moved(0));
    if (predicted)
      d.track(0.1, moved(-0.08));
    else
      d.track(0.1);
    const int chain = d.ego.chain();
    d.ego.correct(moved(0.17));
    d.ego.correct(moved(0.01));
    EXPECT_NEAR(d.ego.motion()->translation().x(), -0.01, 1e-12);
    EXPECT_NEAR(d.ego.pose().translation().x(), 0.01, 1e-12);
    EXPECT_EQ(d.ego.chain(), predicted ? chain : chain - 1) << "bridged once";
  }
}

TEST(EgoMotion, TellsTheRotationPerSecond) {
  Driver d;
  d.track(0);
  d.track(0.05, moved(0, 3));
  EXPECT_NEAR(d.ego.angular_velocity().norm(), 60 * CV_PI / 180, 1e-9);
  const Eigen::Isometry3d ahead = d.ego.pose().inverse() * d.ego.pose_at(0.06);
  EXPECT_NEAR(Eigen::AngleAxisd(ahead.linear()).angle(), 0.6 * CV_PI / 180, 1e-9);
}

TEST(EgoMotion, RefusesWhatIsNoRigidMotion) {
  Eigen::Isometry3d scaled = moved(0.01);
  scaled.linear() *= 1.1;
  Eigen::Isometry3d mirrored = moved(0.01);
  mirrored.linear().col(0) *= -1;
  for (const Eigen::Isometry3d& bad :
       {moved(std::nan("")), moved(std::numeric_limits<double>::infinity()), scaled, mirrored}) {
    Driver d;
    d.track(0);
    d.ego.correct(moved(1));
    d.track(0.1, moved(-0.01));
    d.ego.correct(moved(1.01));
    const Eigen::Isometry3d before = d.ego.pose();
    EXPECT_FALSE(d.track(0.2, bad)) << "as if nothing had been told";
    EXPECT_TRUE(d.ego.status() & kPoseRefused);
    EXPECT_TRUE(d.ego.pose().isApprox(before));
    d.ego.correct(moved(1.02));
    d.track(0.3, moved(-0.01));
    EXPECT_FALSE(d.ego.status() & kPoseRefused) << "the next frame is as any other";
    d.ego.correct(bad);
    EXPECT_TRUE(d.ego.status() & kPoseRefused);
    EXPECT_NEAR(d.ego.pose().translation().x(), 0.03, 1e-12);
  }
}

TEST(EgoMotion, BridgesAGapWithTheHostsPose) {
  Driver d;
  d.track(0);
  d.ego.correct(moved(1));
  d.track(0.1, moved(-0.01));
  d.ego.correct(moved(1.01));
  const int chain = d.ego.chain();
  EXPECT_FALSE(d.track(0.2));
  EXPECT_NE(d.ego.chain(), chain) << "no motion is known";
  d.ego.correct(moved(1.02));
  EXPECT_EQ(d.ego.chain(), chain);
  EXPECT_NEAR(d.ego.pose().translation().x(), 0.02, 1e-12);
}

TEST(EgoMotion, KnowsAHostThatJumps) {
  Driver d;
  d.track(0);
  d.ego.correct(moved(1));
  d.track(0.1, moved(-0.01));
  const int chain = d.ego.chain();
  d.ego.correct(moved(3));  // it closed a loop
  EXPECT_NEAR(d.ego.pose().translation().x(), 0.01, 1e-12);
  d.track(0.2, moved(-0.01));
  d.ego.correct(moved(3.012));
  EXPECT_NEAR(d.ego.pose().translation().x(), 0.022, 1e-12);
  EXPECT_EQ(d.ego.chain(), chain);
}

TEST(EgoMotion, StartsAnewAtACutAndWhereTimeGoesBack) {
  Driver d;
  d.track(0);
  d.track(0.1, moved(-0.01));
  const int chain = d.ego.chain();
  EXPECT_FALSE(d.track(0.2, moved(-2)));
  EXPECT_NE(d.ego.chain(), chain);
  d.track(0.3, moved(-0.01));
  const int after = d.ego.chain();
  EXPECT_EQ(d.ego.status(), static_cast<std::uint32_t>(kOk));
  d.track(0.1);
  EXPECT_NE(d.ego.chain(), after);
  EXPECT_TRUE(d.ego.status() & kTimestampOrder);
}

}  // namespace
