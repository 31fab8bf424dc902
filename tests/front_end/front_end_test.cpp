// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/front_end.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <stdexcept>

#include "../any_size.hpp"
#include "../flat_scene.hpp"
#include "../io/temporary_folder.hpp"
#include "stillpoint/core/random.hpp"
#include "stillpoint/depth/depth_mask_fuser.hpp"
#include "stillpoint/motion/blur_meter.hpp"
#include "stillpoint/segmentation/segmentation_compensator.hpp"

namespace {

using namespace stillpoint;
using Points = std::vector<cv::Point2f>;

const double kStart = 1341846313.592026;

// A segmenter that does what a test says.
class FakeSegmenter : public Segmenter {
 public:
  std::function<Segmentation(const RgbdFrame&)> answer;
  int calls = 0;
  Segmentation segment(const RgbdFrame& frame) override {
    ++calls;
    return answer(frame);
  }
};

// Two people who walk through a room.
struct Walk {
  FlatScene scene;
  Walk() { scene.height_m = 1.2f; }

  std::vector<Figure> figures(int i) const {
    return {{{60 + 3 * i, 79, 38, 139}, 3.2f, 1}, {{220 - 2 * i, 70, 50, 160}, 2.4f, 2}};
  }
  RgbdFrame frame(int i) const { return scene.frame(time(i), figures(i)); }
  static double time(int i) { return kStart + i / 30.0; }
  std::vector<Instance> people(int i) const {
    std::vector<Instance> instances;
    for (const Figure& f : figures(i)) instances.push_back(box_instance(f.box, scene.size));
    return instances;
  }
  cv::Mat truth(int i) const { return mask_of(people(i), scene.size); }
  // Frames with misses of each kind: whole, partly, no result.
  Segmentation damaged(int i) const {
    if (i % 8 == 5) return Segmentation();
    std::vector<Instance> seen = people(i);
    if (i % 5 == 4) seen.erase(seen.begin());
    if (i % 7 == 6) seen.back().mask(cv::Rect(0, 100, 25, 60)).setTo(0);
    return result(seen);
  }
  Points keypoints(int i) const {
    RandomGenerator random(static_cast<std::uint64_t>(i + 1));
    Points points;
    for (int k = 0; k < 600; ++k)
      points.emplace_back(static_cast<float>(319 * random.uniform()),
                          static_cast<float>(239 * random.uniform()));
    return points;
  }
};

TEST(FrontEnd, RunsTheComponentsInThePapersOrder) {
  const Walk walk;
  for (const FrontEndSettings& settings :
       {FrontEndSettings::network_only(), FrontEndSettings::paper()}) {
    FrontEnd front_end(settings, walk.scene.camera());
    SegmentationCompensator compensator(settings.compensation, walk.scene.camera());
    DepthMaskFuser fuser(settings.depth, walk.scene.camera());
    BlurMeter meter(settings.blur, walk.scene.camera());
    ProbabilisticKeypointFilter<> filter(settings.probability);
    for (int i = 0; i < 20; ++i) {
      const RgbdFrame frame = walk.frame(i);
      FrameContext context;
      context.begin(frame, walk.scene.camera());
      meter.measure(context);
      const Segmentation& mended = compensator.mend(context, walk.damaged(i));
      const DynamicMask& expected = fuser.fuse(context, mended);
      compensator.remember(context,
                           settings.compensation.use_depth ? fuser.instances() : mended.instances);
      const Selection& selection = filter.filter(walk.keypoints(i), expected);

      const DynamicMask& mask = front_end.compute_mask(frame, walk.damaged(i));
      ASSERT_TRUE(identical(mask.image, expected.image)) << i;
      EXPECT_TRUE(identical(front_end.undilated_mask(), fuser.undilated()));
      EXPECT_EQ(mask.timestamp, frame.timestamp);
      EXPECT_EQ(&mask, &front_end.mask());
      EXPECT_EQ(front_end.select(walk.keypoints(i)).kept, selection.kept);

      const FrameStats& stats = front_end.stats();
      EXPECT_EQ(stats.timestamp, frame.timestamp);
      EXPECT_EQ(stats.status, compensator.status() | fuser.status() | filter.status());
      EXPECT_EQ(stats.restored, compensator.restored());
      EXPECT_EQ(static_cast<std::size_t>(stats.instances), mended.instances.size());
      EXPECT_EQ(front_end.instances().size(), mended.instances.size());
      EXPECT_NEAR(stats.mask_share, pixels(mask.image) / (320.0 * 240), 1e-9);
      EXPECT_EQ(stats.keypoints, 600);
      EXPECT_EQ(static_cast<std::size_t>(stats.kept), selection.kept.size());
      EXPECT_EQ(stats.mask_age_s, mask.age_s);
      EXPECT_NEAR(mask.age_s, i % 8 == 5 ? 1 / 30.0 : 0, 1e-6);
      for (const double ms : {stats.compensation_ms, stats.depth_ms, stats.probability_ms})
        EXPECT_GE(ms, 0);
    }
  }
}

TEST(FrontEnd, TellsTheBlurOfThePictureAndOfEachObject) {
  const Walk walk;
  Camera camera = walk.scene.camera();
  camera.exposure_s = 0.01;
  for (const bool compensate : {true, false}) {
    FrontEndSettings settings = FrontEndSettings::network_only();
    settings.use_compensation = compensate;
    FrontEnd front_end(settings, camera);
    // 0.02 m to the side in each frame, before a wall at 5 m and people at 3.2 and 2.4 m.
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.translation().x() = 0.02;
    for (int i = 0; i < 12; ++i) {
      front_end.compute_mask(walk.frame(i), result(walk.people(i)), T);
      const FrameStats& stats = front_end.stats();
      if (i == 0) {
        EXPECT_TRUE(std::isnan(stats.blur.motion_px)) << "no frame before it";
        continue;
      }
      const double share = 0.01 * 30;
      EXPECT_GT(stats.blur.motion_px, 0.9 * share * camera.fx * 0.02 / 5);
      EXPECT_LT(stats.blur.motion_px, 1.1 * share * camera.fx * 0.02 / 2.4);
      EXPECT_GT(stats.blur.sharpness, 0.8);
      ASSERT_EQ(front_end.instances().size(), 2u);
      if (i < 6) continue;
      // The first walks 3 pixels per frame to the right, the second 2 to the left.
      const double first = front_end.instances()[0].blur.motion_px;
      const double second = front_end.instances()[1].blur.motion_px;
      if (compensate) {
        EXPECT_NEAR(first, 3 * share, 0.3 * share);
        EXPECT_NEAR(second, 2 * share, 0.3 * share);
      } else {
        EXPECT_EQ(first, stats.blur.motion_px) << "nothing is remembered of them";
      }
    }
  }
}

TEST(FrontEnd, MendsDamagedMasks) {
  const Walk walk;
  FrontEnd front_end({}, walk.scene.camera());
  for (int i = 0; i < 30; ++i) {
    front_end.compute_mask(walk.frame(i), walk.damaged(i));
    if (i < 2) continue;
    EXPECT_GT(iou(front_end.undilated_mask(), walk.truth(i)), 0.93) << i;
  }
}

TEST(FrontEnd, RawMaskIsTheSegmentersOwn) {
  const Walk walk;
  FrontEnd front_end({}, walk.scene.camera());
  EXPECT_TRUE(front_end.raw_mask().empty());
  for (int i = 0; i < 10; ++i) {
    const Segmentation given = walk.damaged(i);
    front_end.compute_mask(walk.frame(i), given);
    EXPECT_TRUE(identical(front_end.raw_mask(), mask_of(given.instances, walk.scene.size)));
  }
}

TEST(FrontEnd, WithoutCompensationMissesStayMissed) {
  const Walk walk;
  FrontEndSettings settings = FrontEndSettings::network_only();
  settings.use_compensation = false;
  FrontEnd front_end(settings, walk.scene.camera());
  front_end.compute_mask(walk.frame(0), result(walk.people(0)));
  EXPECT_GT(iou(front_end.undilated_mask(), walk.truth(0)), 0.95);
  front_end.compute_mask(walk.frame(1), result({}));
  EXPECT_EQ(pixels(front_end.mask().image), 0);
  EXPECT_EQ(front_end.stats().status, kOk);
  front_end.compute_mask(walk.frame(2), Segmentation());
  EXPECT_EQ(pixels(front_end.mask().image), 0);
  EXPECT_TRUE(front_end.stats().status & kNoSegmentation);
  EXPECT_EQ(front_end.stats().restored, 0);
}

TEST(FrontEnd, WithoutDepthFusionTheMaskIsTheUnion) {
  const Walk walk;
  FrontEndSettings settings = FrontEndSettings::network_only();
  settings.use_depth = false;
  FrontEnd front_end(settings, walk.scene.camera());
  std::vector<Instance> careless = walk.people(0);
  careless[0] = box_instance({30, 60, 90, 170}, walk.scene.size);
  front_end.compute_mask(walk.frame(0), result(careless));
  EXPECT_TRUE(identical(front_end.undilated_mask(), mask_of(careless, walk.scene.size)));
  EXPECT_GT(pixels(front_end.mask().image), pixels(front_end.undilated_mask())) << "dilated";
  // Compensation goes on.
  front_end.compute_mask(walk.frame(1), result({}));
  EXPECT_EQ(front_end.stats().restored, 2);
}

TEST(FrontEnd, WithoutProbabilityTheMaskAloneDecides) {
  const Walk walk;
  FrontEndSettings settings;
  settings.use_probability = false;
  FrontEnd front_end(settings, walk.scene.camera());
  const DynamicMask& mask = front_end.compute_mask(walk.frame(0), result(walk.people(0)));
  const Points points = walk.keypoints(0);
  const Selection& selection = front_end.select(points);
  for (std::size_t i = 0; i < points.size(); ++i)
    EXPECT_EQ(selection.is_kept(i), !mask.dynamic_at(points[i].x, points[i].y));
}

TEST(FrontEnd, WithNothingOnPassesTheMasksOn) {
  const Walk walk;
  FrontEndSettings settings;
  settings.use_compensation = settings.use_depth = settings.use_probability = false;
  settings.depth.dilation_px = 0;
  FrontEnd front_end(settings);
  front_end.compute_mask(walk.frame(0), result(walk.people(0)));
  EXPECT_TRUE(identical(front_end.mask().image, walk.truth(0)));
}

TEST(FrontEnd, AsksItsSegmenter) {
  const Walk walk;
  FakeSegmenter segmenter;
  segmenter.answer = [&](const RgbdFrame& frame) {
    return result(walk.people(static_cast<int>(std::lround((frame.timestamp - kStart) * 30))));
  };
  FrontEnd asking({}, walk.scene.camera(), &segmenter), given({}, walk.scene.camera());
  for (int i = 0; i < 4; ++i) {
    const cv::Mat expected = given.compute_mask(walk.frame(i), result(walk.people(i))).image;
    EXPECT_TRUE(identical(asking.compute_mask(walk.frame(i)).image, expected));
    EXPECT_GE(asking.stats().segmentation_ms, 0);
  }
  EXPECT_EQ(segmenter.calls, 4);
}

TEST(FrontEnd, GoesOnWhenTheSegmenterThrows) {
  const Walk walk;
  FakeSegmenter segmenter;
  // The default finds them by their motion.
  FrontEnd front_end(FrontEndSettings::network_only(), walk.scene.camera(), &segmenter);
  segmenter.answer = [&](const RgbdFrame&) { return result(walk.people(0)); };
  front_end.compute_mask(walk.frame(0));
  EXPECT_TRUE(front_end.stats().segmenter_error.empty());

  segmenter.answer = [](const RgbdFrame&) -> Segmentation { throw std::runtime_error("no GPU"); };
  front_end.compute_mask(walk.frame(1));
  EXPECT_EQ(front_end.stats().status, kSegmenterFailed | kNoSegmentation | kRestored);
  EXPECT_EQ(front_end.stats().segmenter_error, "no GPU");
  EXPECT_GT(iou(front_end.undilated_mask(), walk.truth(1)), 0.85) << "predicted";

  segmenter.answer = [](const RgbdFrame&) -> Segmentation { throw 42; };
  front_end.compute_mask(walk.frame(2));
  EXPECT_TRUE(front_end.stats().status & kSegmenterFailed);
  EXPECT_FALSE(front_end.stats().segmenter_error.empty());

  segmenter.answer = [](const RgbdFrame&) -> Segmentation {
    cv::Mat a(2, 2, CV_8U);
    CV_Assert(a.empty());
    return {};
  };
  front_end.compute_mask(walk.frame(3));
  EXPECT_NE(front_end.stats().segmenter_error.find("a.empty()"), std::string::npos);

  segmenter.answer = [&](const RgbdFrame&) { return result(walk.people(4)); };
  front_end.compute_mask(walk.frame(4));
  EXPECT_EQ(front_end.stats().status, kOk) << "and it comes back";
  EXPECT_TRUE(front_end.stats().segmenter_error.empty());
}

TEST(FrontEnd, TakesOtherMasksOfTheSegmenterForAFailure) {
  const Walk walk;
  FakeSegmenter segmenter;
  FrontEnd front_end({}, walk.scene.camera(), &segmenter);
  Instance bad = box_instance({10, 10, 50, 60}, walk.scene.size);
  bad.mask = cv::Mat::zeros(480, 640, CV_8UC1);
  segmenter.answer = [&](const RgbdFrame&) { return result({bad}); };
  front_end.compute_mask(walk.frame(0));
  EXPECT_EQ(front_end.stats().status, kSegmenterFailed | kNoSegmentation | kNeverSegmented);
  EXPECT_NE(front_end.stats().segmenter_error.find("found CV_8UC1 640x480"), std::string::npos);

  bad.mask = cv::Mat::zeros(60, 50, CV_8UC3);
  front_end.compute_mask(walk.frame(1));
  EXPECT_TRUE(front_end.stats().status & kSegmenterFailed);

  bad = box_instance({10, 10, 50, 60}, walk.scene.size);
  bad.box.x = 300;
  front_end.compute_mask(walk.frame(2));
  EXPECT_TRUE(front_end.stats().status & kSegmenterFailed);
  EXPECT_NE(front_end.stats().segmenter_error.find(".box"), std::string::npos);
}

TEST(FrontEnd, RefusesMasksOfALaterImage) {
  const Walk walk;
  Segmentation later = result(walk.people(1));
  later.timestamp = Walk::time(1);
  FakeSegmenter segmenter;
  segmenter.answer = [&](const RgbdFrame&) { return later; };
  FrontEnd front_end({}, walk.scene.camera(), &segmenter);
  EXPECT_ERROR(front_end.compute_mask(walk.frame(0), later), "segmentation.timestamp",
               "at most the frame's", "0.033333 s after it");
  front_end.compute_mask(walk.frame(0));
  EXPECT_EQ(front_end.stats().status, kSegmenterFailed | kNoSegmentation | kNeverSegmented);
  EXPECT_NE(front_end.stats().segmenter_error.find("0.033333 s after it"), std::string::npos);
  front_end.compute_mask(walk.frame(1));
  EXPECT_EQ(front_end.stats().status, kOk) << "its own";
}

TEST(FrontEnd, SaysWhatIsMissing) {
  const Walk walk;
  FrontEndSettings settings;
  settings.use_motion = false;  // it finds who walks, with or without a result
  FrontEnd front_end(settings, walk.scene.camera());
  front_end.compute_mask(walk.frame(0));
  EXPECT_EQ(front_end.stats().status, kNoSegmentation | kNeverSegmented) << "nobody to ask";
  EXPECT_EQ(front_end.mask().image.size(), walk.scene.size);
  EXPECT_TRUE(std::isinf(front_end.mask().age_s));
  EXPECT_EQ(front_end.select(walk.keypoints(0)).kept.size(), 600u);

  RgbdFrame flat = walk.frame(1);
  flat.depth = cv::Mat();
  front_end.compute_mask(flat, result(walk.people(1)));
  EXPECT_EQ(front_end.stats().status, kNoDepth);
  flat.timestamp = Walk::time(2);
  flat.depth = cv::Mat::zeros(walk.scene.size, CV_16UC1);
  front_end.compute_mask(flat, result(walk.people(2)));
  EXPECT_TRUE(front_end.stats().status & kNoDepth);

  front_end.compute_mask(walk.frame(3), result(walk.people(3)));
  front_end.select(Points());
  EXPECT_EQ(front_end.stats().status, kNoKeypoints);
  EXPECT_EQ(front_end.stats().keypoints, 0);
  front_end.select(walk.keypoints(3));
  EXPECT_EQ(front_end.stats().status, kOk) << "of the last select() only";

  front_end.compute_mask(walk.frame(30), Segmentation());
  EXPECT_TRUE(front_end.stats().status & kMaskStale);
  EXPECT_EQ(pixels(front_end.mask().image), 0);
}

TEST(FrontEnd, SaysThatTheMaskIsTooLarge) {
  Walk walk;
  walk.scene.height_m = 0;
  FrontEnd front_end({}, walk.scene.camera());
  const std::vector<Instance> all{box_instance({0, 0, 320, 240}, walk.scene.size)};
  front_end.compute_mask(walk.scene.frame(kStart, {}), result(all));
  EXPECT_EQ(front_end.stats().status, kMaskTooLarge);
  EXPECT_GT(front_end.stats().mask_share, 0.9);
  const Selection& selection = front_end.select(walk.keypoints(0));
  EXPECT_EQ(selection.kept.size(), 50u) << "the tracker is not starved";
  EXPECT_EQ(front_end.stats().status, kMaskTooLarge | kKeypointFloor);
  EXPECT_EQ(front_end.stats().kept, 50);

  FrontEndSettings settings;
  settings.large_mask_share = 1;
  FrontEnd lenient(settings, walk.scene.camera());
  lenient.compute_mask(walk.scene.frame(kStart, {}), result(all));
  EXPECT_EQ(lenient.stats().status, kOk);
}

TEST(FrontEnd, SaysThatTimeWentBack) {
  const Walk walk;
  FrontEnd front_end({}, walk.scene.camera());
  front_end.compute_mask(walk.frame(5), result(walk.people(5)));
  front_end.compute_mask(walk.frame(5), result(walk.people(5)));
  EXPECT_EQ(front_end.stats().status, kTimestampOrder);
  front_end.compute_mask(walk.frame(2), result(walk.people(2)));
  EXPECT_EQ(front_end.stats().status, kTimestampOrder);
  front_end.compute_mask(walk.frame(3), result(walk.people(3)));
  EXPECT_EQ(front_end.stats().status, kOk);
}

TEST(FrontEnd, TakesDynamicClassesOnly) {
  const Walk walk;
  std::vector<Instance> instances = walk.people(0);
  instances[0].class_name = "chair";
  instances[1].class_name = "";
  const auto share = [&](const std::vector<DynamicClass>& classes) {
    FrontEndSettings settings;
    settings.dynamic_classes = classes;
    settings.use_depth = false;
    FrontEnd front_end(settings, walk.scene.camera());
    front_end.compute_mask(walk.frame(0), result(instances));
    EXPECT_EQ(pixels(front_end.raw_mask()), pixels(front_end.undilated_mask()));
    return std::make_pair(front_end.stats().instances, pixels(front_end.undilated_mask()));
  };
  EXPECT_EQ(share({"person"}), std::make_pair(1, 50 * 160)) << "without a class: always dynamic";
  EXPECT_EQ(share({}), std::make_pair(1, 50 * 160));
  EXPECT_EQ(share({"person", "chair"}), std::make_pair(2, 50 * 160 + 38 * 139));
  instances[0].score = 0.6f;
  EXPECT_EQ(share({{"chair", 0.5f}}).first, 2) << "0.6 * 0.5 is enough";
  EXPECT_EQ(share({{"chair", 0.4f}}).first, 1) << "0.6 * 0.4 is not";
  instances[0].score = 0.01f;
  EXPECT_EQ(share({"chair"}).first, 2) << "with prior 1 always";
}

TEST(FrontEnd, RefusesACameraThatMakesNoSense) {
  Camera half = Camera::tum_fr1(), spoilt = half;
  half.fy = 0, spoilt.cx = std::numeric_limits<double>::quiet_NaN();
  EXPECT_ERROR(FrontEnd({}, half), "FrontEnd: expected a camera with focal lengths, found none");
  EXPECT_ERROR(FrontEnd({}, spoilt), "FrontEnd: camera: expected finite numbers, found nan");
}

TEST(FrontEnd, RefusesDynamicClassesThatTheSegmenterDoesNotKnow) {
  struct Named : FakeSegmenter {
    std::vector<std::string> classes() const override { return {"person", "cat"}; }
  } named;
  FakeSegmenter silent;
  FrontEndSettings settings;
  settings.dynamic_classes = {"person", "chiar"};
  EXPECT_ERROR(FrontEnd(settings, {}, &named), "\"chiar\"", "person, cat");
  EXPECT_NO_THROW(FrontEnd(settings, {}, &silent)) << "does not say what it knows";
  settings.dynamic_classes = {"person", {"cat", 0.5f}};
  EXPECT_NO_THROW(FrontEnd(settings, {}, &named));
  settings.dynamic_classes = {{"cat", 1.5f}};
  EXPECT_ERROR(FrontEnd(settings, {}, &named), "cat", "0 to 1", "1.5");
}

TEST(FrontEnd, RefusesBadFramesAndGoesOn) {
  const Walk walk;
  FakeSegmenter segmenter;
  segmenter.answer = [&](const RgbdFrame&) { return result(walk.people(0)); };
  FrontEnd front_end({}, walk.scene.camera(), &segmenter);
  const auto with = [&](const std::function<void(RgbdFrame&)>& change) {
    RgbdFrame frame = walk.frame(0);
    change(frame);
    return frame;
  };
  const RgbdFrame no_color = with([](RgbdFrame& f) { f.color = cv::Mat(); });
  const RgbdFrame other_depth =
      with([](RgbdFrame& f) { f.depth = cv::Mat::zeros(480, 640, CV_16UC1); });
  const RgbdFrame depth_type =
      with([](RgbdFrame& f) { f.depth = cv::Mat::zeros(240, 320, CV_8UC1); });
  const RgbdFrame no_time = with([](RgbdFrame& f) { f.timestamp = std::nan(""); });
  EXPECT_ERROR(front_end.compute_mask(no_color), "frame.color", "expected", "found an empty one");
  EXPECT_ERROR(front_end.compute_mask(other_depth), "frame.depth", "320x240", "found 640x480");
  EXPECT_ERROR(front_end.compute_mask(depth_type), "frame.depth", "CV_16UC1", "found CV_8UC1");
  EXPECT_ERROR(front_end.compute_mask(no_time), "frame.timestamp", "seconds", "nan");
  EXPECT_EQ(segmenter.calls, 0) << "a bad frame is not sent to a network";

  Instance bad = box_instance({10, 10, 50, 60}, walk.scene.size);
  bad.mask = cv::Mat::zeros(60, 50, CV_8UC3);
  EXPECT_ERROR(front_end.compute_mask(walk.frame(0), result({bad})), "segmentation.instances[0]",
               "CV_8UC1", "found CV_8UC3");

  front_end.compute_mask(walk.frame(0));
  EXPECT_EQ(front_end.stats().status, kOk);
  EXPECT_GT(iou(front_end.undilated_mask(), walk.truth(0)), 0.95);
}

TEST(FrontEnd, UsesTheCamerasMotion) {
  const Walk walk;
  Eigen::Isometry3d turn = Eigen::Isometry3d::Identity();
  turn.rotate(Eigen::AngleAxisd(0.12, Eigen::Vector3d::UnitY()));  // 32 pixels to the right
  FrontEndSettings settings = FrontEndSettings::network_only();
  settings.compensation.search_px = 4;
  for (const bool known : {true, false}) {
    FrontEnd front_end(settings, walk.scene.camera());
    front_end.compute_mask(walk.scene.frame(kStart, {{{100, 79, 38, 139}, 3.2f, 1}}),
                           result({box_instance({100, 79, 38, 139}, walk.scene.size)}));
    const RgbdFrame turned = walk.scene.frame(kStart + 0.033, {{{132, 79, 38, 139}, 3.2f, 1}}, 32);
    front_end.compute_mask(turned, Segmentation(),
                           known ? std::optional<Eigen::Isometry3d>(turn) : std::nullopt);
    const cv::Mat truth = mask_of(std::vector<cv::Rect>{{132, 79, 38, 139}}, walk.scene.size);
    if (known)
      EXPECT_GT(iou(front_end.undilated_mask(), truth), 0.9);
    else
      EXPECT_LT(iou(front_end.undilated_mask(), truth), 0.5);
  }
}

TEST(FrontEnd, TakesGreyPicturesWithoutDepth) {
  Walk walk;
  walk.scene.with_depth = false;
  walk.scene.color_channels = 1;
  FrontEnd front_end;
  for (int i = 0; i < 12; ++i) {
    front_end.compute_mask(walk.frame(i), walk.damaged(i));
    front_end.select(walk.keypoints(i));
    if (i > 2) {
      EXPECT_GT(iou(front_end.undilated_mask(), walk.truth(i)), 0.85) << i;
    }
  }
}

// Depth sensors measure nothing nearer than 0.3 to 0.5 m; a sensor that fails does not either.
TEST(FrontEnd, MasksWhoStandsTooCloseToBeMeasured) {
  const FlatScene scene;
  const cv::Rect close(0, 0, 128, 240), elsewhere(160, 0, 160, 240);
  for (const bool somebody : {true, false}) {
    FrontEnd front_end({}, scene.camera());
    for (int i = 0; i < 20; ++i) front_end.compute_mask(scene.frame(Walk::time(i), {}));
    ASSERT_EQ(front_end.stats().mask_share, 0);
    RgbdFrame frame = scene.frame(Walk::time(20), {});
    frame.depth(close).setTo(0);
    if (somebody) frame.color(close).setTo(cv::Scalar(240, 240, 250));
    const cv::Mat mask = front_end.compute_mask(frame).image;
    EXPECT_EQ(pixels(mask(close)), somebody ? close.area() : 0);
    EXPECT_EQ(pixels(mask(elsewhere)), 0);
    EXPECT_EQ(front_end.stats().status & kMaskTooLarge, 0u);
    const Points points = Walk().keypoints(20);
    const Selection& selection = front_end.select(points);
    for (std::size_t i = 0; i < points.size(); ++i)
      if (close.contains(points[i]) || elsewhere.contains(points[i])) {
        EXPECT_EQ(selection.is_kept(i), !somebody || elsewhere.contains(points[i])) << points[i];
      }
    // He covers more, and then all of the lens: nothing at all is measured.
    for (const int width : {200, 320}) {
      RgbdFrame nearer = scene.frame(Walk::time(width == 200 ? 21 : 22), {});
      const cv::Rect covered(0, 0, width, 240);
      nearer.depth(covered).setTo(0);
      if (somebody) nearer.color(covered).setTo(cv::Scalar(240, 240, 250));
      const cv::Mat all = front_end.compute_mask(nearer).image;
      EXPECT_EQ(pixels(all(covered)), somebody ? covered.area() : 0) << width;
    }
    // All is as before when he has gone.
    EXPECT_EQ(pixels(front_end.compute_mask(scene.frame(Walk::time(23), {})).image), 0);
  }
}

// What the host has converted is looked at, and nothing else; network_only looks at single rows.
TEST(FrontEnd, TakesTheHostsGreyPicture) {
  const Walk walk;
  for (const FrontEndSettings& settings : {FrontEndSettings(), FrontEndSettings::network_only()}) {
    FrontEnd of_color(settings, walk.scene.camera()), of_gray(settings, walk.scene.camera());
    for (int i = 0; i < 12; ++i) {
      RgbdFrame frame = walk.frame(i);
      const cv::Mat expected = of_color.compute_mask(frame, walk.damaged(i)).image;
      cv::cvtColor(frame.color, frame.gray, cv::COLOR_BGR2GRAY);
      frame.color = cv::Mat::zeros(frame.color.size(), CV_8UC3);
      const cv::Mat before = frame.gray.clone();
      const cv::Mat found = of_gray.compute_mask(frame, walk.damaged(i)).image;
      EXPECT_EQ(cv::countNonZero(found != expected), 0) << i;
      EXPECT_EQ(of_gray.stats().blur.sharpness, of_color.stats().blur.sharpness) << i;
      EXPECT_EQ(cv::countNonZero(frame.gray != before), 0) << "the caller's stays";
    }
  }
}

// A network that takes a piece of the wall for a person is not believed where the same wall had
// been seen before, and a false mask is not carried along there.
TEST(FrontEnd, BelievesNoMaskOnWhatIsKnownToBeStatic) {
  const FlatScene scene;
  const cv::Rect wall(200, 60, 50, 90);
  for (const auto& [motion, bare] : {std::pair(true, false), {true, true}, {false, false}}) {
    FrontEnd front_end(motion ? FrontEndSettings() : FrontEndSettings::network_only(),
                       scene.camera());
    const auto masked = [&](int i, const Segmentation& seen) {
      const RgbdFrame frame = scene.frame(kStart + i / 30.0, {});
      const cv::Mat& mask = front_end.compute_mask(frame, seen).image;
      return cv::countNonZero(mask(wall)) / static_cast<double>(wall.area());
    };
    Segmentation says = result({box_instance(wall, scene.size)});
    if (bare) says.instances[0].mask = cv::Mat();
    // Masked from the first frame on it stays masked: a person may stand there.
    EXPECT_GT(masked(0, says), 0.95);
    for (int i = 1; i < 20; ++i) EXPECT_GT(masked(i, says), 0.95) << i;
    for (int i = 80; i < 90; ++i) EXPECT_EQ(masked(i, result({})), 0) << i;
    for (int i = 90; i < 94; ++i)
      if (motion)
        EXPECT_LT(masked(i, i == 90 ? says : Segmentation()), 0.05) << i;
      else
        EXPECT_GT(masked(i, i == 90 ? says : Segmentation()), 0.95) << i;
  }
}

TEST(FrontEnd, DoubtsAPersonWhoSuddenlyFillsTheImage) {
  const FlatScene scene;
  FrontEnd front_end(FrontEndSettings(), scene.camera());
  for (int i = 0; i < 12; ++i) {
    Segmentation segmentation;
    segmentation.available = true;
    segmentation.timestamp = i / 30.0 + 1;
    const bool false_person = i == 3 || i == 4 || i == 8;
    if (false_person) {
      segmentation.instances.emplace_back();
      segmentation.instances[0].class_name = "person";
      segmentation.instances[0].box = cv::Rect(10, 5, 300, 230);
    }
    front_end.compute_mask(scene.frame(segmentation.timestamp, {}), segmentation);
    EXPECT_EQ(front_end.stats().mask_share, 0) << i;
    EXPECT_EQ((front_end.stats().status & kObjectDoubted) != 0, false_person) << i;
  }
}

TEST(FrontEnd, TakesAnotherSizeOnTheWay) {
  for (const FrontEndSettings& settings : {FrontEndSettings::network_only(), FrontEndSettings()}) {
    Walk walk;
    FrontEnd front_end(settings, of_any_size(walk.scene.camera()));
    front_end.compute_mask(walk.frame(0), result(walk.people(0)));
    walk.scene.size = {160, 120};
    RgbdFrame frame = walk.frame(1);
    frame.depth.release();
    front_end.compute_mask(frame, Segmentation());
    EXPECT_EQ(front_end.mask().image.size(), cv::Size(160, 120));
    std::vector<Instance> small{box_instance({20, 30, 30, 60}, walk.scene.size)};
    EXPECT_NO_THROW(front_end.compute_mask(walk.frame(2), result(small)));
    EXPECT_NO_THROW(front_end.compute_mask(walk.frame(3), result(small)));
  }
}

TEST(FrontEnd, RefusesImagesOfAnotherSizeThanTheCameras) {
  Walk walk;
  FrontEnd front_end(FrontEndSettings(), walk.scene.camera());
  front_end.compute_mask(walk.frame(0), result(walk.people(0)));
  RgbdFrame reduced = walk.frame(1);
  cv::resize(reduced.color, reduced.color, {160, 120});
  cv::resize(reduced.depth, reduced.depth, {160, 120}, 0, 0, cv::INTER_NEAREST);
  EXPECT_ERROR(front_end.compute_mask(reduced, Segmentation()), "frame.color",
               "camera's size 320x240", "found 160x120", "Camera::resized");
  EXPECT_NO_THROW(front_end.compute_mask(walk.frame(2), result(walk.people(2))));
  FrontEnd of_reduced(FrontEndSettings(), walk.scene.camera().resized(160, 120));
  EXPECT_NO_THROW(of_reduced.compute_mask(reduced, Segmentation()));
}

// Everything that a run gives out.
std::vector<uchar> run_bytes(const FrontEndSettings& settings) {
  const Walk walk;
  FrontEnd front_end(settings, walk.scene.camera());
  std::vector<uchar> bytes;
  const auto add = [&](const void* data, std::size_t n) {
    bytes.insert(bytes.end(), static_cast<const uchar*>(data), static_cast<const uchar*>(data) + n);
  };
  for (int i = 0; i < 20; ++i) {
    const cv::Mat mask = front_end.compute_mask(walk.frame(i), walk.damaged(i)).image.clone();
    add(mask.data, mask.total());
    const cv::Mat undilated = front_end.undilated_mask().clone();
    add(undilated.data, undilated.total());
    const Selection& s = front_end.select(walk.keypoints(i));
    add(s.probability.data(), s.probability.size() * sizeof(float));
    add(s.kept.data(), s.kept.size() * sizeof(int));
  }
  return bytes;
}

TEST(FrontEnd, IsTheSameInEveryRunAndThreadCount) {
  const int threads = cv::getNumThreads();
  for (const FrontEndSettings& settings : {FrontEndSettings(), FrontEndSettings::paper()}) {
    const std::vector<uchar> expected = run_bytes(settings);
    EXPECT_TRUE(run_bytes(settings) == expected);
    for (const int n : {1, 4}) {
      cv::setNumThreads(n);
      EXPECT_TRUE(run_bytes(settings) == expected) << n << " threads";
    }
    cv::setNumThreads(threads);
  }
}

TEST(FrontEnd, RefusesSettingsWithoutSense) {
  FrontEndSettings settings;
  settings.compensation.history = 0;
  EXPECT_ERROR(FrontEnd{settings}, "SegmentationCompensatorSettings.history");
  settings = FrontEndSettings(), settings.depth.cell_px = 0;
  EXPECT_ERROR(FrontEnd{settings}, "DepthMaskFuserSettings.cell_px");
  settings = FrontEndSettings(), settings.probability.radius_px = -1;
  EXPECT_ERROR(FrontEnd{settings}, "KeypointFilterSettings.radius_px");
  for (const double bad : {-0.1, 1.1, std::nan("")}) {
    settings = FrontEndSettings(), settings.large_mask_share = bad;
    EXPECT_ERROR(FrontEnd{settings}, "FrontEndSettings.large_mask_share", "0 to 1");
  }
}

}  // namespace
