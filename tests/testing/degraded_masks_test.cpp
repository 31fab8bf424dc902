// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/testing/degraded_masks.hpp"

#include <gtest/gtest.h>

namespace stillpoint {
namespace {

/// Two people (body, head, arms, legs as bars) and a mover.
struct Scene {
  cv::Mat labels{240, 320, CV_8UC1, cv::Scalar(0)}, limbs{240, 320, CV_8UC1, cv::Scalar(0)};
  Scene() {
    person(1, 40), person(2, 180);
    labels(cv::Rect(260, 60, 50, 100)).setTo(synthetic::kFirstMoverLabel);
  }
  void person(int label, int x) {
    const auto bar = [&](cv::Rect r, synthetic::Limb limb) {
      labels(r).setTo(label), limbs(r).setTo(limb);
    };
    bar({x + 20, 20, 20, 20}, synthetic::kHead), bar({x + 15, 40, 30, 70}, synthetic::kTorso);
    bar({x, 45, 14, 60}, synthetic::kLeftArm), bar({x + 46, 45, 14, 60}, synthetic::kRightArm);
    bar({x + 15, 110, 13, 90}, synthetic::kLeftLeg);
    bar({x + 32, 110, 13, 90}, synthetic::kRightLeg);
  }
};

double lost_share(const Scene& scene, double blur_px, int frames, std::uint64_t seed = 1) {
  double lost = 0, all = 0;
  for (int i = 0; i < frames; ++i) {
    const cv::Mat masks = degrade_masks(
        scene.labels, scene.limbs, i, [&](int, int) { return blur_px; }, seed);
    for (int y = 0; y < masks.rows; ++y)
      for (int x = 0; x < masks.cols; ++x) {
        const int truth = scene.labels.at<uchar>(y, x);
        if (truth == 0 || truth >= synthetic::kFirstMoverLabel) continue;
        all += 1, lost += masks.at<uchar>(y, x) == 0;
      }
  }
  return lost / all;
}

TEST(DegradedMasks, BlurLosesMore) {
  const Scene scene;
  const double sharp = lost_share(scene, 0, 60), some = lost_share(scene, 4, 60),
               much = lost_share(scene, 12, 60);
  EXPECT_LT(sharp, 0.10);
  EXPECT_GT(sharp, 0.005);
  EXPECT_GT(some, sharp + 0.02);
  EXPECT_GT(much, some + 0.05);
  EXPECT_LT(much, 0.6);
}

TEST(DegradedMasks, MoversAreUnknownAndLabelsStayTheirPersons) {
  const Scene scene;
  for (int i = 0; i < 30; ++i) {
    const cv::Mat masks = degrade_masks(scene.labels, scene.limbs, i, [](int, int) { return 2.0; });
    ASSERT_EQ(masks.type(), CV_8UC1);
    double most = 0;
    cv::minMaxLoc(masks, nullptr, &most);
    EXPECT_LE(most, 2);
    EXPECT_EQ(cv::countNonZero(masks.colRange(290, 320)), 0);
    EXPECT_EQ(cv::countNonZero(masks.colRange(0, 140) == 2), 0);
    EXPECT_EQ(cv::countNonZero(masks.colRange(150, 250) == 1), 0);
  }
}

TEST(DegradedMasks, MissesComeInSpellsOfOneToFiveFrames) {
  const Scene scene;
  MaskDamage damage;
  damage.miss_chance = 0.02, damage.miss_chance_per_px = 0;
  damage.limb_chance = damage.limb_chance_per_px = 0;
  damage.border_px = damage.border_px_per_px = 0;
  int run = 0, runs = 0, longest = 0, missed = 0;
  for (int i = 0; i < 400; ++i) {
    const cv::Mat masks = degrade_masks(
        scene.labels, scene.limbs, i, [](int, int) { return 0.0; }, 3, damage);
    if (cv::countNonZero(masks == 1) == 0) {
      ++run, ++missed;
      continue;
    }
    if (run) ++runs, longest = std::max(longest, run);
    run = 0;
  }
  ASSERT_GE(runs, 3);
  EXPECT_GE(missed, runs + 3) << "spells of single frames only";
  EXPECT_LE(longest, 9) << "two spells may follow each other, not more";
}

TEST(DegradedMasks, LimbsAreLostAlone) {
  const Scene scene;
  MaskDamage damage;
  damage.miss_chance = damage.miss_chance_per_px = 0, damage.limb_chance = 0.1;
  bool leg_alone = false;
  for (int i = 0; i < 60 && !leg_alone; ++i) {
    const cv::Mat masks = degrade_masks(
        scene.labels, scene.limbs, i, [](int, int) { return 0.0; }, 3, damage);
    const int leg = cv::countNonZero(masks(cv::Rect(57, 125, 9, 60)));
    const int body = cv::countNonZero(masks(cv::Rect(57, 45, 26, 55)));
    EXPECT_GT(body, 26 * 55 * 9 / 10) << "trunks are never lost alone";
    leg_alone = leg == 0;
  }
  EXPECT_TRUE(leg_alone);
}

TEST(DegradedMasks, WithoutDamageOnlyBordersWander) {
  const Scene scene;
  MaskDamage none;
  none.miss_chance = none.miss_chance_per_px = none.limb_chance = none.limb_chance_per_px = 0;
  none.border_px = none.border_px_per_px = 0, none.smallest_pixels = 0;
  cv::Mat masks = degrade_masks(
      scene.labels, scene.limbs, 3, [](int, int) { return 9.0; }, 1, none);
  cv::Mat people = scene.labels.clone();
  people.setTo(0, people >= synthetic::kFirstMoverLabel);
  EXPECT_EQ(cv::countNonZero(masks != people), 0);
  none.border_px = 2;
  masks = degrade_masks(
      scene.labels, scene.limbs, 3, [](int, int) { return 9.0; }, 1, none);
  const int changed = cv::countNonZero(masks != people);
  EXPECT_GT(changed, 100);
  EXPECT_LT(changed, cv::countNonZero(people) / 4);
}

TEST(DegradedMasks, SameArgumentsSameMasks) {
  const Scene scene;
  const auto make = [&](int frame, std::uint64_t seed) {
    return degrade_masks(
        scene.labels, scene.limbs, frame, [](int, int) { return 3.0; }, seed);
  };
  EXPECT_EQ(cv::countNonZero(make(7, 1) != make(7, 1)), 0);
  EXPECT_GT(cv::countNonZero(make(7, 1) != make(8, 1)), 0);
  EXPECT_GT(cv::countNonZero(make(7, 1) != make(7, 2)), 0);
}

TEST(DegradedMasks, EmptyAndAllWhiteAndWrongTypes) {
  const auto blur = [](int, int) { return 3.0; };
  const cv::Mat black(40, 60, CV_8UC1, cv::Scalar(0)), white(40, 60, CV_8UC1, cv::Scalar(1));
  EXPECT_EQ(cv::countNonZero(degrade_masks(black, cv::Mat(), 0, blur)), 0);
  EXPECT_EQ(degrade_masks(white, cv::Mat(), 0, blur).size(), white.size());
  EXPECT_THROW(degrade_masks(cv::Mat(4, 4, CV_16UC1), cv::Mat(), 0, blur), Error);
  EXPECT_THROW(degrade_masks(black, cv::Mat(4, 4, CV_8UC1), 0, blur), Error);
}

}  // namespace
}  // namespace stillpoint
