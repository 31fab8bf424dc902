// SPDX-License-Identifier: BSD-2-Clause
// The ego-motion and the motion check on rendered frames, without a network.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <opencv2/imgproc.hpp>

#include "stillpoint/front_end.hpp"
#include "stillpoint/motion/ego_motion.hpp"
#include "synthetic/sequence.hpp"

namespace stillpoint {
namespace {

// People who walk alike close to a camera at rest have more corners than the room behind them.
TEST(EgoMotion, IsNotCarriedAlongByPeople) {
  for (const std::uint64_t seed : {2u, 5u}) {
    SyntheticSettings settings;
    settings.seed = seed, settings.motion = SyntheticMotion::kStatic, settings.people = 2;
    settings.width = 320, settings.height = 240, settings.frames = 15;
    settings.carried_object = false, settings.pillar = true;
    const SyntheticSequence sequence(settings);
    FrontEnd front_end({}, sequence.camera());
    for (int i = 0; i < sequence.frame_count(); ++i)
      front_end.compute_mask(sequence.rgbd(sequence.frame(i)), Segmentation());
    EXPECT_LT(front_end.ego_motion().pose().translation().norm(), 0.02) << "seed " << seed;
  }
}

// A carton as high as the image, pushed to the side: its front stays in one plane, and fits where
// it was as well as where it is. Its corners tell that it moves, the registration of the depth,
// too.
TEST(MotionCheck, FindsALargeCartonThatMovesInItsOwnPlane) {
  SyntheticSettings settings;
  settings.seed = 33, settings.motion = SyntheticMotion::kRpy;
  settings.people = 1, settings.movers = 2;
  settings.width = 320, settings.height = 240;
  const SyntheticSequence sequence(settings);
  FrontEnd front_end({}, sequence.camera());
  double recall = 0, wrong = 0;
  int frames = 0;
  for (int i = 0; i < 30; ++i) {
    const SyntheticFrame rendered = sequence.frame(i);
    const cv::Mat mask = front_end.compute_mask(sequence.rgbd(rendered), Segmentation()).image;
    if (i < 15) continue;  // at first it is slow
    const cv::Mat carton = rendered.labels == 101, others = rendered.labels != 0;
    cv::Mat beside;
    cv::dilate(others, beside, cv::getStructuringElement(cv::MORPH_RECT, {21, 21}));
    recall += cv::countNonZero(carton & mask) / std::max(1.0, 1.0 * cv::countNonZero(carton));
    wrong += cv::countNonZero(mask & ~beside) / static_cast<double>(mask.total());
    ++frames;
  }
  EXPECT_GT(recall / frames, 0.6) << "0.28 if it drags the registered pose along";
  EXPECT_LT(wrong / frames, 0.02) << "0.036 then: a table is where the map has free space";
}

}  // namespace
}  // namespace stillpoint
