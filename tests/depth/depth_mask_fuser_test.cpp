// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/depth/depth_mask_fuser.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

#include "../any_size.hpp"
#include "../flat_scene.hpp"
#include "../io/temporary_folder.hpp"
#include "stillpoint/core/random.hpp"

namespace {

using namespace stillpoint;
using Settings = DepthMaskFuserSettings;

// A person of 1.7 m, 3.2 m away, standing on the floor of a room 5 m deep.
FlatScene room() {
  FlatScene scene;
  scene.height_m = 1.2f;
  return scene;
}
const Figure kPerson{{140, 79, 38, 139}, 3.2f, 1};

cv::Mat person_mask() { return mask_of(std::vector<cv::Rect>{kPerson.box}, room().size); }

struct Score {
  double recall, precision;
};
Score score(const cv::Mat& found, const cv::Mat& truth) {
  const double both = pixels(found & truth);
  return {both / pixels(truth), both / std::max(1, pixels(found))};
}

cv::Mat undilated(DepthMaskFuser& fuser, const RgbdFrame& frame,
                  const std::vector<Instance>& instances) {
  fuser.fuse(frame, result(instances));
  return fuser.undilated().clone();
}

// The method on the person with this mask, without dilation.
cv::Mat fused(const FlatScene& scene, const std::vector<Figure>& figures,
              const std::vector<Instance>& instances, const Settings& settings = {}) {
  DepthMaskFuser fuser(settings, scene.camera());
  return undilated(fuser, scene.frame(0, figures), instances);
}

// --- the paper's method, against a slow reference -------------------------------------------

// Section 3.2 word by word in double precision. `doubtful` gets the pixels whose depth lies within
// a millimetre of the range's ends.
cv::Mat paper_reference(const RgbdFrame& frame, const std::vector<Instance>& instances,
                        const Settings& settings, cv::Mat& doubtful) {
  const cv::Size size = frame.color.size();
  DepthView view;
  view.set(frame, Camera());
  DepthSamples samples(settings.cell_px, settings.seed);
  samples.begin(view);
  cv::Mat out = mask_of(instances, size);
  doubtful = cv::Mat::zeros(size, CV_8UC1);
  for (const Instance& s : instances) {
    if (s.mask.empty()) out(s.box).setTo(0);
  }
  for (const Instance& s : instances) {
    std::vector<double> values;
    for (int cy = 0; cy * settings.cell_px < size.height; ++cy)
      for (int cx = 0; cx * settings.cell_px < size.width; ++cx) {
        const cv::Point p = samples.place({cx, cy});
        const double z = depth_m_at(frame, p.x, p.y);
        if (s.box.contains(p) && z > 0) values.push_back(z);
      }
    if (values.empty()) continue;
    const auto mean = [](const std::vector<double>& v) {
      double sum = 0;
      for (double x : v) sum += x;
      return sum / static_cast<double>(v.size());
    };
    const double m = mean(values);
    double variance = 0;
    for (double v : values) variance += (v - m) * (v - m) / static_cast<double>(values.size());
    std::vector<double> retained;
    for (double v : values)
      if (std::abs(v - m) <= 3 * std::sqrt(variance)) retained.push_back(v);
    const double g = mean(retained);
    for (int y = s.box.y; y < s.box.y + s.box.height; ++y)
      for (int x = s.box.x; x < s.box.x + s.box.width; ++x) {
        const double z = depth_m_at(frame, x, y);
        if (z <= 0) continue;
        const double inside = settings.range_m - std::abs(z - g);
        if (inside >= 0) out.at<uchar>(y, x) = 255;
        if (std::abs(inside) < 1e-3) doubtful.at<uchar>(y, x) = 255;
      }
  }
  return out;
}

TEST(DepthMaskFuserPaper, IsThePapersMethod) {
  RandomGenerator random(11);
  const FlatScene scene = room();
  for (int k = 0; k < 20; ++k) {
    Settings settings = Settings::paper();
    settings.dilation_px = static_cast<int>(random.below(12));
    settings.cell_px = 3 + static_cast<int>(random.below(10));
    settings.seed = random.next();
    std::vector<Figure> figures;
    std::vector<Instance> instances;
    for (int i = 0; i < 3; ++i) {
      const cv::Rect box(static_cast<int>(random.below(260)), static_cast<int>(random.below(150)),
                         20 + static_cast<int>(random.below(40)),
                         20 + static_cast<int>(random.below(70)));
      figures.push_back({box, 1.5f + 2 * static_cast<float>(random.uniform()), 1});
      instances.push_back(
          box_instance(cv::Rect(box.x - 6, box.y + 10, box.width + 20, box.height), scene.size));
      instances.back().mask(cv::Rect(0, 0, 5, 20)).setTo(0);
    }
    RgbdFrame frame = scene.frame(0, figures);
    // Noise, holes and far outliers, which three standard deviations take out.
    for (int y = 0; y < scene.size.height; ++y)
      for (int x = 0; x < scene.size.width; ++x) {
        std::uint16_t& z = frame.depth.at<std::uint16_t>(y, x);
        const std::size_t dice = random.below(200);
        if (dice == 0)
          z = 0;
        else if (dice == 1)
          z = 60000;
        else
          z = static_cast<std::uint16_t>(z + random.below(400));
      }
    DepthMaskFuser fuser(settings);
    const DynamicMask& mask = fuser.fuse(frame, result(instances));
    cv::Mat doubtful;
    const cv::Mat expected = paper_reference(frame, instances, settings, doubtful);
    ASSERT_EQ(pixels((fuser.undilated() != expected) & ~doubtful), 0) << "case " << k;
    EXPECT_LT(pixels(doubtful), 3000);
    // And what is dilated is dilated as OpenCV does it.
    cv::Mat dilated;
    const int side = 2 * scaled_px(settings.dilation_px, scene.size) + 1;
    cv::dilate(fuser.undilated(), dilated, cv::getStructuringElement(cv::MORPH_RECT, {side, side}));
    ASSERT_TRUE(identical(mask.image, dilated));
  }
}

TEST(DepthMaskFuserPaper, FloodsWhatStandsAtTheSameDepth) {
  // The literal method's known weakness, kept: a cupboard at the person's depth joins.
  const Figure cupboard{{178, 60, 40, 150}, 3.2f, 2};
  const cv::Rect box(140, 79, 70, 139);
  Instance s = box_instance(box, room().size);
  s.mask(cv::Rect(38, 0, 32, 139)).setTo(0);
  const cv::Mat out = fused(room(), {kPerson, cupboard}, {s}, Settings::paper());
  EXPECT_EQ(out.at<uchar>(100, 200), 255);
  EXPECT_EQ(out.at<uchar>(100, 215), 0) << "outside the box";
}

// --- the default method ----------------------------------------------------------------------

TEST(DepthMaskFuser, LeavesAGoodMaskAlone) {
  for (const bool with_floor : {true, false}) {
    FlatScene scene = room();
    if (!with_floor) scene.height_m = 0;
    const Score s =
        score(fused(scene, {kPerson}, {box_instance(kPerson.box, scene.size)}), person_mask());
    EXPECT_GT(s.recall, 0.99);
    EXPECT_GT(s.precision, 0.97);
  }
}

TEST(DepthMaskFuser, GrowsAMissingLegAndDoesNotFloodTheFloor) {
  Instance seen = box_instance(kPerson.box, room().size);
  // The lower 0.25 m of one half are missing.
  seen.mask(cv::Rect(0, 119, 19, 20)).setTo(0);
  const Score s = score(fused(room(), {kPerson}, {seen}), person_mask());
  EXPECT_GT(s.recall, 0.98);
  EXPECT_GT(s.precision, 0.96);
}

TEST(DepthMaskFuser, GrowsBeyondTheBox) {
  // Both legs missing: the box ends at the knees.
  cv::Rect box = kPerson.box;
  box.height -= 20;
  const Score s = score(fused(room(), {kPerson}, {box_instance(box, room().size)}), person_mask());
  EXPECT_GT(s.recall, 0.97);
  EXPECT_GT(s.precision, 0.96);
}

TEST(DepthMaskFuser, GrowsOnlySoFar) {
  // All but the head is missing: it grows by growth_m, 0.3 m, 25 px.
  cv::Rect box = kPerson.box;
  box.height = 30;
  const cv::Mat out = fused(room(), {kPerson}, {box_instance(box, room().size)});
  EXPECT_EQ(out.at<uchar>(79 + 30 + 15, 158), 255);
  EXPECT_EQ(out.at<uchar>(79 + 30 + 35, 158), 0);
  Settings none;
  none.growth_m = 0;
  const cv::Mat still = fused(room(), {kPerson}, {box_instance(box, room().size)}, none);
  EXPECT_EQ(still.at<uchar>(79 + 30 + 15, 158), 0);
}

TEST(DepthMaskFuser, TrimsTheBackgroundFromACarelessMask) {
  const cv::Rect careless(kPerson.box.x - 10, kPerson.box.y - 10, kPerson.box.width + 20,
                          kPerson.box.height + 10);
  const Score s =
      score(fused(room(), {kPerson}, {box_instance(careless, room().size)}), person_mask());
  EXPECT_GT(s.recall, 0.99);
  EXPECT_GT(s.precision, 0.95);
}

TEST(DepthMaskFuser, TakesThePersonEvenIfTheWallIsMost) {
  // Two thirds of a very careless mask are wall.
  const cv::Rect careless(kPerson.box.x - 38, kPerson.box.y, kPerson.box.width + 76,
                          kPerson.box.height);
  const Score s =
      score(fused(room(), {kPerson}, {box_instance(careless, room().size)}), person_mask());
  EXPECT_GT(s.recall, 0.99);
  EXPECT_GT(s.precision, 0.95);
}

TEST(DepthMaskFuser, KeepsASecondPersonInOneMask) {
  for (const float second_m : {1.6f, 4.2f}) {
    const Figure other{{190, 90, 34, 70}, second_m, 2};
    const cv::Mat both = mask_of(std::vector<cv::Rect>{kPerson.box, other.box}, room().size);
    const Score s = score(fused(room(), {kPerson, other}, {instance_from_mask(both)}), both);
    EXPECT_GT(s.recall, 0.97) << second_m;
    EXPECT_GT(s.precision, 0.97) << second_m;
  }
}

TEST(DepthMaskFuser, KeepsASecondPersonInAMaskThatWasCarriedALittleAside) {
  const Figure near{{60, 79, 70, 139}, 1.2f, 1}, other{{190, 60, 60, 100}, 1.8f, 2};
  const cv::Mat truth = mask_of(std::vector<cv::Rect>{near.box, other.box}, room().size);
  const cv::Point aside(-6, 0);
  Instance both = instance_from_mask(
      mask_of(std::vector<cv::Rect>{near.box + aside, other.box + aside}, room().size));
  both.predicted = true;
  const RgbdFrame frame = room().frame(0, {near, other});
  Settings settings;
  for (const int cell : {settings.cell_px, 5}) {
    settings.cell_px = cell;
    DepthMaskFuser fuser(settings, room().camera());
    const Score s = score(undilated(fuser, frame, {both}), truth);
    EXPECT_TRUE(fuser.instances()[0].predicted);
    EXPECT_GT(s.recall, 0.97) << cell;
    EXPECT_GT(s.precision, 0.97) << cell;
  }
  // A mask that was seen now ends where the object ends; six pixels are more than a cell of five.
  both.predicted = false;
  DepthMaskFuser fuser(settings, room().camera());
  EXPECT_LT(score(undilated(fuser, frame, {both}), truth).recall, 0.8);
}

TEST(DepthMaskFuser, KeepsASecondPersonBesideWhomNothingIsMeasured) {
  const Figure other{{190, 90, 34, 70}, 1.4f, 2};
  const FlatScene scene = room();
  RgbdFrame frame = scene.frame(0, {kPerson, other});
  // The shadow of a depth camera.
  cv::Mat shadow = mask_of(std::vector<cv::Rect>{{other.box.x - 16, other.box.y - 16,
                                                  other.box.width + 32, other.box.height + 32}},
                           scene.size);
  shadow(other.box).setTo(0), shadow(kPerson.box).setTo(0);
  frame.depth.setTo(0, shadow);
  const cv::Mat both = mask_of(std::vector<cv::Rect>{kPerson.box, other.box}, scene.size);
  DepthMaskFuser fuser(Settings(), scene.camera());
  EXPECT_GT(score(undilated(fuser, frame, {instance_from_mask(both)}), both).recall, 0.97);
}

TEST(DepthMaskFuser, FillsWhatTheDepthLacksInsideAnObject) {
  FlatScene scene = room();
  RgbdFrame frame = scene.frame(0, {kPerson});
  const cv::Rect gap(kPerson.box.x + 18, kPerson.box.y + 60, 2, 2);
  frame.depth(gap).setTo(5 * 4900);  // a pixel of the wall shines through
  DepthMaskFuser fuser(Settings(), scene.camera());
  EXPECT_EQ(pixels(undilated(fuser, frame, {instance_from_mask(person_mask())})(gap)), gap.area());
}

// In an image twice as wide cells are twice as large, and few samples fall into gaps of 6 x 6.
TEST(DepthMaskFuser, HasLargerCellsInWiderImages) {
  FlatScene scene = room();
  scene.size = {1280, 960};
  const Figure person{{560, 316, 152, 556}, 3.2f, 1};
  RgbdFrame frame = scene.frame(0, {person});
  cv::Mat gaps = cv::Mat::zeros(scene.size, CV_8UC1);
  for (int y = person.box.y + 40; y < person.box.br().y - 40; y += 30)
    for (int x = person.box.x + 30; x < person.box.br().x - 30; x += 30)
      gaps(cv::Rect(x, y, 6, 6)).setTo(255);
  frame.depth.setTo(5 * 4900, gaps);
  DepthMaskFuser fuser(Settings(), scene.camera());
  const cv::Mat mask = mask_of(std::vector<cv::Rect>{person.box}, scene.size);
  const cv::Mat filled = undilated(fuser, frame, {instance_from_mask(mask)}) & gaps;
  EXPECT_GT(pixels(filled), 0.5 * pixels(gaps));
}

TEST(DepthMaskFuser, JoinsACarriedObject) {
  // A box held before the body and at its side; the mask knows the person only.
  const Figure carried{{172, 120, 24, 26}, 3.15f, 2};
  Instance seen = box_instance(kPerson.box, room().size);
  const cv::Mat out = fused(room(), {kPerson, carried}, {seen});
  const cv::Mat both = mask_of(std::vector<cv::Rect>{kPerson.box, carried.box}, room().size);
  EXPECT_GT(score(out, both).recall, 0.97);
  EXPECT_GT(score(out, both).precision, 0.96);
}

TEST(DepthMaskFuser, DoesNotJoinWhatStandsApart) {
  const Figure cupboard{{172, 60, 60, 140}, 3.6f, 2}, post{{100, 79, 20, 130}, 3.2f, 3};
  const cv::Mat out =
      fused(room(), {kPerson, cupboard, post}, {box_instance(kPerson.box, room().size)});
  EXPECT_GT(score(out, person_mask()).recall, 0.97);
  EXPECT_GT(score(out, person_mask()).precision, 0.95);
}

/// A frame in which the pixels of `known` are known to be static.
FrameContext with_static(const FlatScene& scene, const RgbdFrame& frame, const cv::Rect& known,
                         bool alone = true) {
  FrameContext context;
  context.begin(frame, scene.camera());
  context.labels.reset(1, frame.color.cols, frame.color.rows);
  for (int y = known.y; y < known.y + known.height; ++y)
    for (int x = known.x; x < known.x + known.width; ++x) {
      const std::size_t i = static_cast<std::size_t>(y * frame.color.cols + x);
      context.labels[i] = CellLabel::kStatic;
      if (alone) context.labels.set_alone(i);
    }
  context.labels.find_wide_static();
  return context;
}

// A bench that the person touches is as deep as he is: only what was there before tells them apart
// (but for the cells right beside him).
TEST(DepthMaskFuser, LeavesOutWhatIsKnownToBeStatic) {
  const Figure bench{{kPerson.box.x + kPerson.box.width, 150, 60, 50}, 3.2f, 2};
  const FlatScene scene = room();
  Instance bare;
  bare.class_name = "person";
  bare.box = kPerson.box | bench.box;
  Instance nameless = box_instance(kPerson.box, scene.size, "");
  const auto on_bench = [&](const Instance& s, const cv::Rect& known) {
    DepthMaskFuser fuser({}, scene.camera());
    fuser.fuse(with_static(scene, scene.frame(0, {kPerson, bench}), known), result({s}));
    EXPECT_GT(score(fuser.undilated(), person_mask()).recall, 0.95);
    return pixels(fuser.undilated()(bench.box)) / static_cast<double>(bench.box.area());
  };
  for (const Instance& s : {box_instance(kPerson.box, scene.size), bare, nameless}) {
    EXPECT_GT(on_bench(s, {}), 0.3);
    EXPECT_LT(on_bench(s, bench.box), 0.15) << (s.mask.empty() ? "bare box" : "mask") << " of "
                                            << (s.class_name.empty() ? "a mover" : s.class_name);
  }
}

// Who moves an arm stands as still as a bench does: what never stood alone may be part of a mover.
TEST(DepthMaskFuser, AMoverGrowsIntoWhatNeverStoodAlone) {
  const Figure rest{{kPerson.box.x + kPerson.box.width, 100, 20, 100}, 3.2f, 2};
  const FlatScene scene = room();
  for (const bool alone : {true, false}) {
    DepthMaskFuser fuser({}, scene.camera());
    fuser.fuse(with_static(scene, scene.frame(0, {kPerson, rest}), rest.box, alone),
               result({box_instance(kPerson.box, scene.size, "")}));
    const double share = pixels(fuser.undilated()(rest.box)) / static_cast<double>(rest.box.area());
    if (alone)
      EXPECT_LT(share, 0.4);
    else
      EXPECT_GT(share, 0.8);
  }
}

// What was found by its motion is kept although it seems to have been there before.
TEST(DepthMaskFuser, BelievesAMoverMoreThanTheLabels) {
  const FlatScene scene = room();
  DepthMaskFuser fuser({}, scene.camera());
  fuser.fuse(with_static(scene, scene.frame(0, {kPerson}), kPerson.box),
             result({box_instance(kPerson.box, scene.size, "")}));
  EXPECT_GT(score(fuser.undilated(), person_mask()).recall, 0.95);
}

// A table before the person is nearer and larger than what is seen of him.
TEST(DepthMaskFuser, TakesThePersonBehindWhatIsKnownToBeStatic) {
  const FlatScene scene = room();
  const Figure table{{kPerson.box.x - 12, 120, kPerson.box.width + 24, 98}, 2.2f, 2};
  const cv::Rect seen(kPerson.box.x, kPerson.box.y, kPerson.box.width, 120 - kPerson.box.y);
  Instance bare;
  bare.class_name = "person";
  bare.box = kPerson.box;
  const auto find = [&](const cv::Rect& known) {
    DepthMaskFuser fuser({}, scene.camera());
    fuser.fuse(with_static(scene, scene.frame(0, {kPerson, table}), known), result({bare}));
    return fuser.undilated().clone();
  };
  EXPECT_LT(pixels(find({})(seen)), 0.1 * seen.area()) << "nothing told them apart";
  const cv::Mat found = find(table.box);
  EXPECT_GT(pixels(found(seen)), 0.97 * seen.area());
  EXPECT_LT(pixels(found) - pixels(found(seen)), 0.1 * seen.area());
  // All of the box stood there before: nothing in it moves.
  EXPECT_EQ(pixels(find(cv::Rect(cv::Point(), scene.size))), 0);
}

TEST(DepthMaskFuser, CarvesThePersonOutOfABareBox) {
  Instance bare;
  bare.box = cv::Rect(kPerson.box.x - 12, kPerson.box.y - 8, kPerson.box.width + 24,
                      kPerson.box.height + 10);
  const Score s = score(fused(room(), {kPerson}, {bare}), person_mask());
  EXPECT_GT(s.recall, 0.97);
  EXPECT_GT(s.precision, 0.95);
}

TEST(DepthMaskFuser, CarvesWhoStandsFarAwayOutOfABareBox) {
  Instance bare;
  bare.box = cv::Rect(130, 60, 60, 120);
  const cv::Rect person(145, 66, 30, 110);
  RgbdFrame frame;
  frame.color = cv::Mat(room().size, CV_8UC3, cv::Scalar(90, 90, 90));
  for (const float z : {12.0f, 14.0f, 30.0f}) {
    frame.depth = cv::Mat(room().size, CV_32FC1, cv::Scalar(z * 0.5f));
    frame.depth(bare.box).setTo(0);
    frame.depth(person).setTo(z);
    DepthMaskFuser fuser({}, room().camera());
    const Score s =
        score(undilated(fuser, frame, {bare}), mask_of(std::vector<cv::Rect>{person}, room().size));
    EXPECT_GT(s.recall, 0.95) << z;
  }
}

TEST(DepthMaskFuser, DoesNotTrustAFloorWhoseMotionItMissed) {
  // Of the last frame's floor too little is seen to find it anew.
  const FlatScene scene = room();
  const Instance person = box_instance(kPerson.box, scene.size);
  const auto mask_after = [&](bool missed) {
    DepthMaskFuser fuser({}, scene.camera());
    const std::optional<Eigen::Isometry3d> still = Eigen::Isometry3d::Identity();
    fuser.fuse(scene.frame(0, {kPerson}), result({person}), true, 0, still);
    fuser.fuse(scene.frame(1, {kPerson}), result({}), true, 0, missed ? std::nullopt : still);
    RgbdFrame frame = scene.frame(2, {kPerson});
    for (const cv::Range& hidden : {cv::Range(0, 110), cv::Range(210, scene.size.width)})
      frame.depth.colRange(hidden).setTo(0.4 * frame.depth_units_per_m);
    fuser.fuse(frame, result({person}), true, 0, still);
    return pixels(fuser.undilated());
  };
  EXPECT_GT(mask_after(true), mask_after(false) + 100) << "it grows into the floor";
}

TEST(DepthMaskFuser, GoesByTheExpectedDepth) {
  // A column before the person takes half of the mask; the compensator knows how far the person is.
  const Figure column{{130, 60, 29, 170}, 2.2f, 2};
  Instance s = box_instance(kPerson.box, room().size);
  s.depth_m = 3.2f;
  const cv::Mat out = fused(room(), {kPerson, column}, {s});
  EXPECT_EQ(out.at<uchar>(120, 170), 255);
  EXPECT_EQ(out.at<uchar>(120, 148), 0);
}

TEST(DepthMaskFuser, KeepsWhatHasNoDepth) {
  // Black trousers give no depth: the segmenter's word stands.
  const FlatScene scene = room();
  RgbdFrame frame = scene.frame(0, {kPerson});
  frame.depth(cv::Rect(140, 160, 38, 40)).setTo(0);
  DepthMaskFuser fuser({}, scene.camera());
  const Score s =
      score(undilated(fuser, frame, {box_instance(kPerson.box, scene.size)}), person_mask());
  EXPECT_GT(s.recall, 0.99);
}

TEST(DepthMaskFuser, SeparatesTwoPeople) {
  const Figure other{{185, 70, 60, 170}, 2.0f, 2};
  const FlatScene scene = room();
  DepthMaskFuser fuser({}, scene.camera());
  fuser.fuse(scene.frame(0, {kPerson, other}),
             result({box_instance(kPerson.box, scene.size), box_instance(other.box, scene.size)}));
  ASSERT_EQ(fuser.instances().size(), 2u);
  EXPECT_GT(iou(mask_of({fuser.instances()[0]}, scene.size), person_mask()), 0.95);
  EXPECT_GT(iou(mask_of({fuser.instances()[1]}, scene.size),
                mask_of(std::vector<cv::Rect>{other.box}, scene.size)),
            0.95);
}

// --- both ------------------------------------------------------------------------------------

class DepthMaskFuserMethods : public ::testing::TestWithParam<bool> {
 protected:
  Settings settings() const { return GetParam() ? Settings::paper() : Settings(); }
  DepthMaskFuser fuser() const { return DepthMaskFuser(settings(), of_any_size(room().camera())); }
  // The lower leg is missing.
  static std::vector<Instance> instances() {
    Instance s = box_instance(kPerson.box, room().size);
    s.mask(cv::Rect(0, 119, 19, 20)).setTo(0);
    return {s};
  }
};
INSTANTIATE_TEST_SUITE_P(DepthMaskFuser, DepthMaskFuserMethods, ::testing::Bool(),
                         [](const auto& i) { return i.param ? "Paper" : "Default"; });

TEST_P(DepthMaskFuserMethods, ReadsAnyCodingOfDepthAlike) {
  RgbdFrame tum = room().frame(0, {kPerson});
  tum.depth(cv::Rect(150, 100, 10, 10)).setTo(0);
  tum.depth(cv::Rect(20, 100, 10, 10)).setTo(0);
  RandomGenerator random(8);  // whole millimetres: all codings can say them
  for (int y = 0; y < tum.depth.rows; ++y)
    for (int x = 0; x < tum.depth.cols; ++x)
      if (std::uint16_t& z = tum.depth.at<std::uint16_t>(y, x))
        z = static_cast<std::uint16_t>(z + 5 * random.below(GetParam() ? 700 : 90));
  RgbdFrame millimetres = tum, metres = tum;
  millimetres.depth = cv::Mat();
  tum.depth.convertTo(millimetres.depth, CV_16U, 0.2);
  metres.depth = cv::Mat();
  millimetres.depth_units_per_m = 1000;
  tum.depth.convertTo(metres.depth, CV_32F, 1 / 5000.0);
  metres.depth_units_per_m = 0;  // not used
  const float no_measurement[] = {0, std::numeric_limits<float>::quiet_NaN(),
                                  std::numeric_limits<float>::infinity(), -1,
                                  -std::numeric_limits<float>::infinity()};
  for (int y = 0; y < 10; ++y)
    for (int x = 0; x < 10; ++x) {
      metres.depth.at<float>(100 + y, 150 + x) = no_measurement[(x + y) % 5];
      metres.depth.at<float>(100 + y, 20 + x) = no_measurement[(x + 2 * y) % 5];
    }
  DepthMaskFuser a = fuser(), b = fuser(), c = fuser();
  const cv::Mat expected = undilated(a, tum, instances());
  EXPECT_GT(pixels(expected), 4000);
  EXPECT_TRUE(identical(undilated(b, millimetres, instances()), expected));
  EXPECT_TRUE(identical(undilated(c, metres, instances()), expected));
}

TEST_P(DepthMaskFuserMethods, WithoutDepthTheMaskStaysAsGiven) {
  const FlatScene scene = room();
  const cv::Mat given = mask_of(instances(), scene.size);
  RgbdFrame frame = scene.frame(0, {kPerson});
  DepthMaskFuser f = fuser();
  f.fuse(frame, result(instances()), false);
  EXPECT_TRUE(identical(f.undilated(), given)) << "switched off";
  EXPECT_EQ(f.status(), kOk);

  frame.depth.setTo(0);
  EXPECT_TRUE(identical(undilated(f, frame, instances()), given)) << "black depth";
  EXPECT_EQ(f.status(), kNoDepth);

  frame.depth = cv::Mat(scene.size, CV_32FC1, cv::Scalar(std::nan("")));
  EXPECT_TRUE(identical(undilated(f, frame, instances()), given)) << "only NaN";
  EXPECT_EQ(f.status(), kNoDepth);

  frame.depth = cv::Mat();
  EXPECT_TRUE(identical(undilated(f, frame, instances()), given)) << "no depth";
  EXPECT_EQ(f.status(), kNoDepth);

  f.fuse(scene.frame(0, {kPerson}), result(instances()));
  EXPECT_EQ(f.status(), kOk);
}

TEST_P(DepthMaskFuserMethods, WithoutDepthABareBoxIsFull) {
  RgbdFrame frame = room().frame(0, {});
  frame.depth = cv::Mat();
  Instance bare;
  bare.box = cv::Rect(20, 30, 40, 50);
  DepthMaskFuser f = fuser();
  EXPECT_EQ(pixels(undilated(f, frame, {bare})), 2000);
  // A box in which nothing is measured, in an image with depth: no worse.
  frame = room().frame(0, {});
  frame.depth(cv::Rect(10, 20, 60, 70)).setTo(0);
  EXPECT_EQ(pixels(undilated(f, frame, {bare})), 2000);
}

TEST_P(DepthMaskFuserMethods, TakesAMaskOfTheWholePicture) {
  const FlatScene scene = room();
  DepthMaskFuser f = fuser();
  const std::vector<Instance> all{box_instance({0, 0, 320, 240}, scene.size)};
  undilated(f, scene.frame(0, {kPerson}), all);
  FlatScene flat;
  undilated(f, flat.frame(0, {}), all);
  EXPECT_GT(f.mask_share(), 0.95) << "a wall, and all of it is the mask";
  EXPECT_LE(f.mask_share(), 1);
}

TEST_P(DepthMaskFuserMethods, NobodyIsAnEmptyMask) {
  DepthMaskFuser f = fuser();
  const RgbdFrame frame = room().frame(3.5, {kPerson});
  EXPECT_GT(pixels(f.fuse(frame, result(instances())).image), 0);
  EXPECT_GT(f.mask_share(), 0.05);
  const DynamicMask& mask = f.fuse(frame, result({}));
  EXPECT_EQ(mask.image.size(), frame.color.size());
  EXPECT_EQ(mask.image.type(), CV_8UC1);
  EXPECT_EQ(mask.timestamp, 3.5);
  EXPECT_EQ(pixels(mask.image), 0) << "nothing of the last frame is left";
  EXPECT_EQ(pixels(f.undilated()), 0);
  EXPECT_EQ(f.mask_share(), 0);
}

// Without depth, in an image where a setting's pixel is one; a full mask has gone before.
cv::Mat dilated(const cv::Mat& mask, int radius_px) {
  Settings settings;
  settings.dilation_px = radius_px;
  DepthMaskFuser fuser(settings);
  RgbdFrame frame;
  frame.color = cv::Mat::zeros(mask.size(), CV_8UC1);
  const cv::Mat full(mask.size(), CV_8UC1, cv::Scalar(255));
  EXPECT_TRUE(identical(fuser.fuse(frame, result({instance_from_mask(full)})).image, full));
  std::vector<Instance> instances;
  if (pixels(mask) > 0) instances.push_back(instance_from_mask(mask));
  return fuser.fuse(frame, result(instances)).image.clone();
}

TEST(DepthMaskFuser, DilatesEachPixelToASquare) {
  RandomGenerator random(3);
  const cv::Size size(640, 280);
  for (int k = 0; k < 30; ++k) {
    const int radius = static_cast<int>(random.below(k % 8 == 0 ? 100 : 16));
    cv::Mat in = cv::Mat::zeros(size, CV_8UC1), expected = in.clone();
    for (int d = 0; d < 5; ++d) {
      const cv::Point p(static_cast<int>(random.below(640)), static_cast<int>(random.below(280)));
      in.at<uchar>(p) = 255;
      expected(grow_rect({p.x, p.y, 1, 1}, radius, size)).setTo(255);
    }
    ASSERT_TRUE(identical(dilated(in, radius), expected)) << "radius " << radius;
  }
}

TEST(DepthMaskFuser, DilatesNothingToNothing) {
  const cv::Mat none = cv::Mat::zeros(480, 640, CV_8UC1);
  for (const int radius : {0, 1, 10, 100}) EXPECT_TRUE(identical(dilated(none, radius), none));
}

TEST_P(DepthMaskFuserMethods, KeepsNothingOfTheLastFrame) {
  RandomGenerator random(5);
  DepthMaskFuser used = fuser();
  for (int k = 0; k < 30; ++k) {
    FlatScene scene = room();
    if (k % 7 == 3) scene.size = {200, 150};
    std::vector<Figure> figures;
    std::vector<Instance> list;
    for (std::size_t i = 0; i < random.below(4); ++i) {
      const cv::Rect box(static_cast<int>(random.below(150)), static_cast<int>(random.below(90)),
                         10 + static_cast<int>(random.below(40)),
                         10 + static_cast<int>(random.below(50)));
      figures.push_back({box, 1.5f + 2 * static_cast<float>(random.uniform()), 1});
      list.push_back(box_instance(box, scene.size));
    }
    const RgbdFrame frame = scene.frame(0, figures);
    const cv::Mat a = used.fuse(frame, result(list)).image.clone();
    cv::Mat expected;
    const int side = 2 * scaled_px(10, scene.size) + 1;
    cv::dilate(used.undilated(), expected, cv::getStructuringElement(cv::MORPH_RECT, {side, side}));
    ASSERT_TRUE(identical(a, expected)) << k;
    if (GetParam()) {  // the default remembers the floor
      DepthMaskFuser fresh = fuser();
      ASSERT_TRUE(identical(a, fresh.fuse(frame, result(list)).image)) << k;
    }
  }
}

TEST_P(DepthMaskFuserMethods, IsTheSameForTheSameSeed) {
  RgbdFrame frame = room().frame(0, {kPerson});
  RandomGenerator random(6);
  for (int y = 0; y < frame.depth.rows; ++y)
    for (int x = 0; x < frame.depth.cols; ++x)
      frame.depth.at<std::uint16_t>(y, x) = static_cast<std::uint16_t>(
          frame.depth.at<std::uint16_t>(y, x) + random.below(GetParam() ? 5000 : 600));
  Settings other = settings();
  other.seed = 99;
  DepthMaskFuser a = fuser(), b = fuser(), c(other, room().camera());
  const cv::Mat expected = undilated(a, frame, instances());
  EXPECT_TRUE(identical(undilated(b, frame, instances()), expected));
  EXPECT_FALSE(identical(undilated(c, frame, instances()), expected)) << "the seed is used";
}

TEST_P(DepthMaskFuserMethods, TakesAnyCellAndAnyBox) {
  RandomGenerator random(7);
  const FlatScene scene = room();
  const RgbdFrame frame = scene.frame(0, {kPerson, {{10, 20, 50, 220}, 0.6f, 2}});
  for (const int cell : {1, 2, 3, 7, 64}) {
    Settings s = settings();
    s.cell_px = cell;
    s.growth_m = 1;
    DepthMaskFuser f(s, scene.camera());
    std::vector<cv::Rect> boxes{{0, 0, 1, 1},   {319, 239, 1, 1}, {0, 0, 320, 1},
                                {0, 0, 1, 240}, {319, 0, 1, 240}, {0, 0, 320, 240}};
    for (int k = 0; k < 20; ++k) {
      const cv::Point p(static_cast<int>(random.below(320)), static_cast<int>(random.below(240)));
      boxes.push_back({p.x, p.y,
                       1 + static_cast<int>(random.below(static_cast<std::size_t>(320 - p.x))),
                       1 + static_cast<int>(random.below(static_cast<std::size_t>(240 - p.y)))});
    }
    for (const cv::Rect& box : boxes) {
      f.fuse(frame, result({box_instance(box, scene.size)}));
      const Instance& out = f.instances()[0];
      ASSERT_EQ(out.box & cv::Rect(cv::Point(), scene.size), out.box);
      ASSERT_EQ(out.mask.size(), out.box.size());
      ASSERT_TRUE(identical(mask_of({out}, scene.size), f.undilated()));
    }
  }
}

TEST_P(DepthMaskFuserMethods, UnitesMasksThatOverlap) {
  const FlatScene scene = room();
  DepthMaskFuser f = fuser();
  const std::vector<Instance> twice{box_instance(kPerson.box, scene.size),
                                    box_instance({150, 90, 20, 60}, scene.size)};
  const cv::Mat out = undilated(f, scene.frame(0, {kPerson}), twice);
  EXPECT_TRUE(identical(out, mask_of(f.instances(), scene.size)));
  EXPECT_GT(score(out, person_mask()).recall, 0.99);
}

TEST_P(DepthMaskFuserMethods, RefusesBadInput) {
  DepthMaskFuser f = fuser();
  RgbdFrame frame = room().frame(0, {});
  Instance s = box_instance({0, 0, 10, 10}, room().size);
  s.box.x = 315;
  EXPECT_ERROR(f.fuse(frame, result({s})), "instances[0].box", "320x240");
  s = box_instance({0, 0, 10, 10}, room().size);
  s.mask = cv::Mat::zeros(240, 320, CV_8UC1);
  EXPECT_ERROR(f.fuse(frame, result({s})), "instances[0].mask", "10x10", "found CV_8UC1 320x240");
  frame.depth = cv::Mat::zeros(480, 640, CV_16UC1);
  EXPECT_ERROR(f.fuse(frame, result({})), "frame.depth", "320x240", "found 640x480");
  // And goes on.
  EXPECT_NO_THROW(f.fuse(room().frame(1, {kPerson}), result(instances())));
}

Blur blurred_by(double motion_px, double sharpness = 0.4) {
  Blur blur;
  blur.motion_px = motion_px, blur.sharpness = sharpness;
  return blur;
}

TEST(DepthMaskFuser, DilatesEachInstanceByItsBlur) {
  Settings settings;
  settings.dilation_px = 8;  // 4 in an image 320 wide
  settings.dilation_per_blur_px = 0.5;
  DepthMaskFuser fuser(settings, room().camera());
  const Figure other{{240, 90, 30, 80}, 2.0f, 2};
  const RgbdFrame frame = room().frame(0, {kPerson, other});
  const auto at_sides = [](const cv::Mat& mask, const cv::Rect& box) {
    // How far the mask reaches beyond the box on the left.
    const cv::Mat row = mask.row(box.y + box.height / 2);
    int x = box.x;
    while (x > 0 && row.ptr()[x - 1]) --x;
    return box.x - x;
  };
  struct Case {
    Blur blur;
    int expected;
  };
  for (const Case& c : {Case{Blur(), 4}, Case{blurred_by(0), 4}, Case{blurred_by(8), 4},
                        Case{blurred_by(14), 7}, Case{blurred_by(14, std::nan("")), 7},
                        Case{blurred_by(14, 0.95), 4},  // the image is sharp all the same
                        Case{blurred_by(1000), 9}}) {   // bounded
    Instance person = box_instance(kPerson.box, frame.color.size());
    person.blur = c.blur;
    const DynamicMask& mask =
        fuser.fuse(frame, result({person, box_instance(other.box, frame.color.size())}));
    EXPECT_EQ(at_sides(mask.image, kPerson.box) - at_sides(fuser.undilated(), kPerson.box),
              c.expected);
    EXPECT_EQ(at_sides(mask.image, other.box) - at_sides(fuser.undilated(), other.box), 4);
    EXPECT_EQ(std::isnan(fuser.instances()[0].blur.motion_px), std::isnan(c.blur.motion_px));
    // All of it is gone in the next frame.
    EXPECT_EQ(pixels(fuser.fuse(frame, result({})).image), 0);
  }
  EXPECT_EQ(Settings::paper().dilation_of(blurred_by(20)), 10) << "the paper knows no blur";
}

TEST(DepthMaskFuser, RefusesSettingsWithoutSense) {
  Settings s;
  for (const int bad : {0, -1, 65}) {
    s = Settings(), s.cell_px = bad;
    EXPECT_ERROR(DepthMaskFuser{s}, "DepthMaskFuserSettings.cell_px", "1 to 64");
  }
  for (const float bad : {0.0f, -1.0f, std::numeric_limits<float>::quiet_NaN()}) {
    s = Settings(), s.range_m = bad;
    EXPECT_ERROR(DepthMaskFuser{s}, "range_m");
  }
  s = Settings(), s.growth_m = -1;
  EXPECT_ERROR(DepthMaskFuser{s}, "growth_m");
  for (const int bad : {-1, 101}) {
    s = Settings(), s.dilation_px = bad;
    EXPECT_ERROR(DepthMaskFuser{s}, "dilation_px", "0 to 100");
  }
  for (const double bad : {-0.1, 10.5, std::nan("")}) {
    s = Settings(), s.dilation_per_blur_px = bad;
    EXPECT_ERROR(DepthMaskFuser{s}, "dilation_per_blur_px", "0 to 10");
  }
}

// --- movers ---------------------------------------------------------------------------------

Instance mover(const cv::Rect& box) { return box_instance(box, room().size, ""); }

TEST(DepthMaskFuser, LooksForNothingInAMoverThatAPersonCovers) {
  const Instance person = box_instance(kPerson.box, room().size);
  // What has moved of him, in coarse cells that reach a little beyond his outline.
  const cv::Rect part(kPerson.box.tl() + cv::Point(2, 40), cv::Size(37, 60));
  DepthMaskFuser fuser({}, room().camera());
  const RgbdFrame frame = room().frame(0, {kPerson});
  const cv::Mat alone = undilated(fuser, frame, {person});
  for (const bool first : {false, true}) {
    const std::vector<Instance> both = first ? std::vector<Instance>{mover(part), person}
                                             : std::vector<Instance>{person, mover(part)};
    EXPECT_EQ(cv::norm(undilated(fuser, frame, both), alone, cv::NORM_INF), 0) << first;
    const Instance& found = fuser.instances()[first ? 0 : 1];
    EXPECT_EQ(found.box, part) << first;
    EXPECT_EQ(cv::norm(found.mask, alone(part), cv::NORM_INF), 0) << first;
  }
}

TEST(DepthMaskFuser, LooksForAMoverThatAPersonCoversInPart) {
  // The segmenter saw his upper half.
  cv::Rect upper = kPerson.box, lower = kPerson.box;
  upper.height = 50, lower.y += 40, lower.height = 60;
  const Settings settings = [] {
    Settings s;
    s.growth_m = 0.1f;
    return s;
  }();
  const std::vector<Instance> both{box_instance(upper, room().size), mover(lower)};
  const Score s = score(fused(room(), {kPerson}, both, settings), person_mask());
  EXPECT_GT(s.recall, 0.75);
  EXPECT_GT(s.precision, 0.97);
}

}  // namespace
