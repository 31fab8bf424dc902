// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/segmentation/forward_predictor.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "../flat_scene.hpp"
#include "../io/temporary_folder.hpp"
#include "stillpoint/evaluation/mask_metrics.hpp"
#include "stillpoint/front_end.hpp"
#include "stillpoint/testing/delayed_segmenter.hpp"

namespace {

using namespace stillpoint;

constexpr double kFirstFrameS = 1341846313.59;

double time_of(int i) { return kFirstFrameS + i / 30.0; }
int index_of(const RgbdFrame& frame) {
  return static_cast<int>(std::lround((frame.timestamp - kFirstFrameS) * 30));
}

class Scripted : public Segmenter {
 public:
  std::function<Segmentation(const RgbdFrame&)> answer;
  Segmentation segment(const RgbdFrame& frame) override { return answer(frame); }
};

/// Two people who walk. The camera may turn.
struct Walk {
  FlatScene scene;
  double turn_px = 0;
  bool boxes = false;

  std::vector<Figure> figures(int i) const {
    const int turned = static_cast<int>(std::lround(turn_px * i));
    return {{{40 + 2 * i + turned, 70, 38, 150}, 3.2f, 1},
            {{240 - 2 * i + turned, 60, 50, 160}, 2.4f, 2}};
  }
  RgbdFrame frame(int i) const {
    return scene.frame(time_of(i), figures(i), static_cast<int>(std::lround(turn_px * i)));
  }
  std::vector<Instance> people(int i) const {
    std::vector<Instance> people;
    for (const Figure& f : figures(i)) {
      people.push_back(box_instance(f.box, scene.size));
      if (boxes) people.back().mask = cv::Mat();
    }
    return people;
  }
  cv::Mat truth(int i) const {
    cv::Mat truth = cv::Mat::zeros(scene.size, CV_8UC1);
    for (const Figure& f : figures(i)) truth(f.box & cv::Rect({}, scene.size)).setTo(255);
    return truth;
  }
  // What the camera's turn does to points: they move right, so the camera turns left.
  std::optional<Eigen::Isometry3d> motion() const {
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.rotate(Eigen::AngleAxisd(std::atan(turn_px / scene.camera().fx), Eigen::Vector3d::UnitY()));
    return T;
  }

  /// Mean IoU from the first result on, with a network that takes `latency_s`.
  double iou(double latency_s, FrontEndSettings settings = {}, bool tell_motion = true) const {
    Scripted network;
    network.answer = [this](const RgbdFrame& f) { return result(people(index_of(f))); };
    DelayedSegmenter late(network, latency_s);
    FrontEnd front_end(settings, scene.camera(), &late);
    MaskMetrics metrics;
    for (int i = 0; i < 50; ++i) {
      front_end.compute_mask(frame(i), tell_motion ? motion() : std::nullopt);
      if (std::isfinite(front_end.mask().age_s))
        metrics.add(compare_masks(front_end.undilated_mask(), truth(i)));
    }
    return metrics.mean_iou();
  }
};

TEST(ForwardPredictor, CarriesLateMasksToTheirPlaceNow) {
  Walk walk;
  // The motion check would find the walkers without any prediction.
  FrontEndSettings on = FrontEndSettings::network_only(), off = on;
  on.use_depth = off.use_depth = false;  // else the fusion mends the masks, too
  off.late.predict = false;
  EXPECT_GT(walk.iou(0), 0.97);
  for (const double latency_s : {0.1, 0.25, 0.4}) {
    EXPECT_GT(walk.iou(latency_s), 0.93) << latency_s;
    EXPECT_GT(walk.iou(latency_s, on), 0.85) << latency_s;
    EXPECT_GT(walk.iou(latency_s, on), walk.iou(latency_s, off) + 0.05) << latency_s;
  }
  walk.boxes = true;
  EXPECT_GT(walk.iou(0.25), 0.9) << "bare boxes";
}

TEST(ForwardPredictor, UsesTheCamerasMotionAndTheTracks) {
  Walk walk;
  walk.turn_px = 3;
  FrontEndSettings no_depth;
  no_depth.use_depth = false;
  no_depth.compensation.use_depth = false;
  walk.scene.with_depth = false;
  EXPECT_GT(walk.iou(0.2, no_depth), 0.75);
  EXPECT_GT(walk.iou(0.2, no_depth), walk.iou(0.2, no_depth, false) + 0.05);
}

TEST(ForwardPredictor, KeepsWhomTheDepthOfNowDoesNotMeasure) {
  const FlatScene scene;
  const Figure person{{140, 80, 36, 100}, 0.6f, 1};
  for (const cv::Rect& hole : {cv::Rect(), cv::Rect(130, 70, 56, 120), cv::Rect({}, scene.size)}) {
    ForwardPredictor predictor({}, {}, scene.camera());
    FrameContext context;
    for (int i = 0; i < 6; ++i) {
      RgbdFrame frame = scene.frame(time_of(i), {person});
      if (i == 5) frame.depth(hole).setTo(0);
      context.begin(frame, scene.camera());
      Segmentation late;
      if (i == 5)
        late = result({box_instance(person.box, scene.size)}), late.timestamp = time_of(1);
      predictor.forward(context, late);
      EXPECT_EQ(late.instances.size(), i == 5 ? 1u : 0u) << hole;
    }
  }
}

TEST(ForwardPredictor, TellsTheAgeOfTheMask) {
  const Walk walk;
  FrontEnd front_end(FrontEndSettings::network_only(), walk.scene.camera());
  for (int i = 0; i < 10; ++i) {
    Segmentation given;
    if (i == 8) given = result(walk.people(3)), given.timestamp = time_of(3);
    front_end.compute_mask(walk.frame(i), given);
    const double expected = i < 8 ? std::numeric_limits<double>::infinity() : (i - 3) / 30.0;
    if (i < 8)
      EXPECT_EQ(front_end.mask().age_s, expected);
    else
      EXPECT_NEAR(front_end.mask().age_s, expected, 1e-6);
    EXPECT_EQ(front_end.stats().mask_age_s, front_end.mask().age_s);
  }
  // Without compensation too.
  FrontEndSettings settings = FrontEndSettings::network_only();
  settings.use_compensation = false;
  FrontEnd plain(settings, walk.scene.camera());
  for (int i = 0; i < 5; ++i) plain.compute_mask(walk.frame(i), Segmentation());
  Segmentation late = result(walk.people(3));
  late.timestamp = time_of(3);
  EXPECT_NEAR(plain.compute_mask(walk.frame(5), late).age_s, 2 / 30.0, 1e-6);
}

TEST(ForwardPredictor, WidensByAgeOnlyWhatASegmenterSaid) {
  LateSegmentationSettings late;
  EXPECT_EQ(late.widening_px(0.5), 0);
  EXPECT_EQ(late.widening_px(0.75), 10);
  EXPECT_EQ(late.widening_px(1.4), 20);
  EXPECT_EQ(late.widening_px(1.6), 0);
  EXPECT_EQ(late.widening_px(std::numeric_limits<double>::infinity()), 0);

  // The motion check's finds are of this frame, however long ago a segmenter said something.
  const Walk walk;
  FrontEndSettings settings;
  settings.depth.dilation_per_blur_px = 0;
  FrontEnd front_end(settings, walk.scene.camera());
  int frames = 0;
  for (int i = 0; i < 30; ++i) {
    front_end.compute_mask(walk.frame(i), walk.motion());
    if (cv::countNonZero(front_end.undilated_mask()) == 0) continue;
    ++frames;
    const cv::Rect found = cv::boundingRect(front_end.undilated_mask());
    EXPECT_LE(cv::boundingRect(front_end.mask().image).width,
              found.width + 2 * settings.depth.dilation_px);
  }
  EXPECT_GT(frames, 15);
}

TEST(ForwardPredictor, WidensOldMasksThenDropsThem) {
  const Walk walk;
  FrontEndSettings settings = FrontEndSettings::network_only();
  settings.late.max_age_s = 0.25;
  settings.late.widen_after_s = 0.15;
  settings.late.widen_px_per_s = 200;  // 100 in an image 320 wide
  settings.depth.dilation_px = 4;
  const auto share = [&](int age, std::uint32_t& status) {
    FrontEnd front_end(settings, walk.scene.camera());
    for (int i = 0; i < 10; ++i) front_end.compute_mask(walk.frame(i), Segmentation());
    Segmentation late = result(walk.people(10 - age));
    late.timestamp = time_of(10 - age);
    front_end.compute_mask(walk.frame(10), late);
    status = front_end.stats().status;
    return cv::countNonZero(front_end.mask().image);
  };
  std::uint32_t status = 0;
  const int fresh = share(3, status);
  EXPECT_EQ(status, kOk);
  EXPECT_GT(fresh, 13000);
  const int old = share(6, status);
  EXPECT_EQ(status, kOk);
  // 5 pixels more on each side.
  EXPECT_NEAR(old - fresh, 10 * (38 + 150 + 50 + 160), 1000);
  EXPECT_EQ(share(9, status), 0);
  EXPECT_EQ(status, kMaskStale | kNoSegmentation | kNeverSegmented);
}

TEST(ForwardPredictor, LeavesOutWhoIsNotThereAnyMore) {
  Walk walk;
  FrontEnd front_end(FrontEndSettings::network_only(), walk.scene.camera());
  for (int i = 0; i < 9; ++i) front_end.compute_mask(walk.frame(i), Segmentation());
  Segmentation late = result(walk.people(5));
  late.timestamp = time_of(5);
  front_end.compute_mask(walk.scene.frame(time_of(9), {walk.figures(9)[0]}), late);
  EXPECT_EQ(front_end.stats().instances, 1);
}

TEST(ForwardPredictor, TakesOddTimestamps) {
  const Walk walk;
  const auto instances = [&](double timestamp, bool from_the_first = false) {
    FrontEnd front_end(FrontEndSettings::network_only(), walk.scene.camera());
    for (int i = 0; i < 5; ++i)
      front_end.compute_mask(walk.frame(i), from_the_first ? result({}) : Segmentation());
    Segmentation given = result(walk.people(4));
    given.timestamp = timestamp;
    front_end.compute_mask(walk.frame(5), given);
    return front_end.stats().instances;
  };
  EXPECT_EQ(instances(std::nan("")), 2) << "of this frame";
  EXPECT_EQ(instances(time_of(5)), 2);
  EXPECT_EQ(instances(time_of(5) + 5e-4), 2) << "rounded";
  EXPECT_THROW(instances(time_of(7)), Error) << "from the future";
  EXPECT_EQ(instances(time_of(4) + 0.01), 2) << "a frame that the host left out";
  EXPECT_EQ(instances(0), 0) << "before all frames";
  EXPECT_EQ(instances(time_of(4), true), 0) << "that frame had its result already";
}

// A host without a segmenter has no word for frames without a result.
TEST(ForwardPredictor, NeedsNoWordOfFramesWithoutAResult) {
  Walk walk;
  walk.turn_px = 3;
  walk.scene.with_depth = false;
  cv::Mat masks[2];
  for (const bool says_so : {false, true}) {
    FrontEnd front_end(FrontEndSettings::network_only(), walk.scene.camera());
    for (int i = 0; i <= 24; ++i) {
      if (i > 0 && i % 6 == 0) {
        Segmentation late = result(walk.people(i - 4));
        late.timestamp = time_of(i - 4);
        front_end.compute_mask(walk.frame(i), late, walk.motion());
        // Nothing is known before a host's first result.
        EXPECT_EQ((front_end.stats().status & kMaskStale) != 0, i == 6 && !says_so) << i;
      } else if (says_so) {
        front_end.compute_mask(walk.frame(i), Segmentation(), walk.motion());
      } else {
        front_end.compute_mask(walk.frame(i), walk.motion());
      }
    }
    masks[says_so] = front_end.mask().image.clone();
  }
  EXPECT_GT(pixels(masks[1]), 0);
  EXPECT_GT(iou(masks[0], masks[1]), 0.99);
}

// Whose result is of a frame of another size says nothing of this one.
TEST(ForwardPredictor, ForgetsImagesOfAnotherSize) {
  for (const bool metres : {false, true}) {
    Walk small, large;
    large.scene.size = {2 * small.scene.size.width, 2 * small.scene.size.height};
    const auto frame = [&](const Walk& walk, int i) {
      RgbdFrame f = walk.frame(i);
      if (metres) f.depth.convertTo(f.depth, CV_32F, 1 / f.depth_units_per_m);
      return f;
    };
    FrontEnd front_end(FrontEndSettings::network_only());
    for (int i = 0; i < 5; ++i) front_end.compute_mask(frame(small, i), Segmentation());
    Segmentation late = result(small.people(3));
    late.timestamp = time_of(3);
    front_end.compute_mask(frame(large, 5), late);
    EXPECT_TRUE(front_end.stats().status & kMaskStale);
    EXPECT_EQ(cv::countNonZero(front_end.mask().image), 0);
  }
}

TEST(ForwardPredictor, DoesNotTakeOneObjectsDepthForAnothers) {
  // Two late results: one of the first person, with depth; one of the second, without.
  const auto box_of_second = [](bool has_first) {
    Walk walk;
    const FrontEndSettings settings = FrontEndSettings::network_only();
    ForwardPredictor predictor(settings.late, settings.compensation, walk.scene.camera());
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.translation().x() = 0.05;
    FrameContext context;
    Segmentation late;
    for (int i = 0; i <= 10; ++i) {
      walk.scene.with_depth = i <= 5;
      const RgbdFrame frame = walk.frame(i);
      context.begin(frame, walk.scene.camera());
      context.T_current_last = T;
      late = Segmentation();
      if (i == 5 && has_first) late = result({walk.people(3)[0]}), late.timestamp = time_of(3);
      if (i == 10) late = result({walk.people(8)[1]}), late.timestamp = time_of(8);
      predictor.forward(context, late);
    }
    return late.instances.at(0).box;
  };
  EXPECT_EQ(box_of_second(true), box_of_second(false));
}

TEST(ForwardPredictor, RefusesSettingsThatMakeNoSense) {
  FrontEndSettings settings = FrontEndSettings::network_only();
  settings.late.max_age_s = -1;
  EXPECT_ERROR(FrontEnd{settings}, "max_age_s", "at least 0", "-1");
  settings = {};
  settings.late.widen_px_per_s = std::nan("");
  EXPECT_ERROR(FrontEnd{settings}, "widen_px_per_s", "nan");
}

TEST(DelayedSegmenter, GivesResultsLate) {
  const Walk walk;
  Scripted network;
  int calls = 0;
  network.answer = [&](const RgbdFrame&) { return ++calls, result({}); };
  DelayedSegmenter late(network, 0.1);
  std::vector<int> ages;
  for (int i = 0; i < 9; ++i) {
    const Segmentation s = late.segment(walk.frame(i));
    ages.push_back(s.available ? static_cast<int>(std::lround((time_of(i) - s.timestamp) * 30))
                               : -1);
  }
  EXPECT_EQ(ages, (std::vector<int>{0, -1, -1, -1, 3, -1, -1, 3, -1}));
  EXPECT_EQ(calls, 4);
  DelayedSegmenter at_once(network, 0);
  EXPECT_EQ(at_once.segment(walk.frame(3)).timestamp, time_of(3));
}

}  // namespace
