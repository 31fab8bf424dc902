// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/segmentation/segmentation_compensator.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <tuple>

#include "../any_size.hpp"
#include "../flat_scene.hpp"
#include "../io/temporary_folder.hpp"

namespace {

using namespace stillpoint;
using Settings = SegmentationCompensatorSettings;

const double kStart = 1341846313.592026;

// A figure of 36 x 100 pixels at 2 m that walks `v` pixels per second from (x, y).
struct Walker {
  double x = 60, y = 80, vx = 90, vy = -20;
  float depth_m = 2;
  std::uint32_t texture = 1;
  cv::Size size{36, 100};

  Figure at(double t) const {
    return {{static_cast<int>(std::lround(x + vx * t)), static_cast<int>(std::lround(y + vy * t)),
             size.width, size.height},
            depth_m,
            texture};
  }
};

// Shows walkers to a compensator.
struct Show {
  FlatScene scene;
  SegmentationCompensator compensator;
  explicit Show(const Settings& settings = {}, const FlatScene& s = {})
      : scene(s), compensator(settings, s.camera()) {}

  // All of `seen` are segmented; `hidden` are in the image, but missed.
  const Segmentation& show(double t, const std::vector<Walker>& seen,
                           const std::vector<Walker>& hidden = {}) {
    std::vector<Figure> figures;
    std::vector<Instance> instances;
    for (const Walker& w : seen) {
      figures.push_back(w.at(t));
      if (!(w.at(t).box & cv::Rect(cv::Point(), scene.size)).empty())
        instances.push_back(box_instance(w.at(t).box, scene.size));
    }
    for (const Walker& w : hidden) figures.push_back(w.at(t));
    return compensator.compensate(scene.frame(kStart + t, figures), result(instances));
  }
  // No result for this frame.
  const Segmentation& skip(double t, const std::vector<Walker>& there) {
    std::vector<Figure> figures;
    for (const Walker& w : there) figures.push_back(w.at(t));
    return compensator.compensate(scene.frame(kStart + t, figures), Segmentation());
  }
  cv::Mat truth(double t, const std::vector<Walker>& walkers) const {
    std::vector<cv::Rect> boxes;
    for (const Walker& w : walkers) boxes.push_back(w.at(t).box);
    return mask_of(boxes, scene.size);
  }
  double iou_at(double t, const std::vector<Walker>& walkers, const Segmentation& found) const {
    return iou(mask_of(found.instances, scene.size), truth(t, walkers));
  }
};

FlatScene without_depth() {
  FlatScene scene;
  scene.with_depth = false;
  return scene;
}

FlatScene mono() {
  FlatScene scene = without_depth();
  scene.color_channels = 1;
  return scene;
}

const FlatScene kScenes[] = {FlatScene(), without_depth(), mono()};

TEST(SegmentationCompensator, PassesOnWhatIsSeen) {
  Show show;
  const Walker a, b{200, 60, -40, 0, 3, 2};
  for (const double t : {0.0, 0.033, 0.067}) {
    const Segmentation& out = show.show(t, {a, b});
    ASSERT_EQ(out.instances.size(), 2u);
    EXPECT_EQ(out.instances[0].box, a.at(t).box);
    EXPECT_EQ(show.iou_at(t, {a, b}, out), 1);
    EXPECT_TRUE(out.available);
    EXPECT_EQ(out.timestamp, kStart + t);
    EXPECT_EQ(show.compensator.restored(), 0);
    EXPECT_EQ(show.compensator.status(), kOk);
    EXPECT_EQ(show.compensator.age_s(), 0);
  }
}

TEST(SegmentationCompensator, RestoresAMissingObjectOnItsLine) {
  const Walker walker;
  for (const Settings& settings : {Settings(), Settings::paper()})
    for (const FlatScene& scene : kScenes) {
      Show show(settings, scene);
      for (const double t : {0.0, 0.033, 0.1, 0.133}) show.show(t, {walker});
      // Dropped frames: it is 15 pixels further.
      const Segmentation& out = show.show(0.3, {}, {walker});
      ASSERT_EQ(out.instances.size(), 1u);
      EXPECT_EQ(out.instances[0].class_name, "person");
      EXPECT_NEAR(out.instances[0].box.x, walker.at(0.3).box.x, 2);
      EXPECT_NEAR(out.instances[0].box.y, walker.at(0.3).box.y, 2);
      EXPECT_GT(show.iou_at(0.3, {walker}, out), 0.9);
      EXPECT_EQ(show.compensator.restored(), 1);
      EXPECT_EQ(show.compensator.status(), kRestored);
    }
}

TEST(SegmentationCompensator, CarriesObjectsThroughFramesWhoseDepthIsBlack) {
  Show show;
  // Far from where it was when the depth failed first: an old look of it would be of no use.
  Walker walker;
  for (int i = 0; i < 20; ++i) {
    const double t = 0.033 * i;
    const bool black = i == 4 || i > 16;
    walker.texture = i < 10 ? 1 : 7;
    RgbdFrame image = show.scene.frame(kStart + t, {walker.at(t)});
    if (black) image.depth.setTo(0);
    const Segmentation seen = result({box_instance(walker.at(t).box, show.scene.size)});
    const Segmentation& out = show.compensator.compensate(image, black ? Segmentation() : seen);
    ASSERT_EQ(out.instances.size(), 1u) << i;
    EXPECT_GT(show.iou_at(t, {walker}, out), 0.8) << i;
    EXPECT_NEAR(show.compensator.objects()[0].depth_m(), 2, 0.05) << i;
  }
}

/// A frame in which the pixels of `known` are known to be static.
void begin(FrameContext& context, const RgbdFrame& frame, const cv::Rect& known) {
  context.begin(frame, Camera());
  context.labels.reset(1, frame.color.cols, frame.color.rows);
  for (std::size_t i = 0; i < context.labels.size(); ++i) {
    const int n = static_cast<int>(i);
    if (known.contains({n % frame.color.cols, n / frame.color.cols}))
      context.labels[i] = CellLabel::kStatic;
  }
  context.labels.find_wide_static();
}

/// The lower half of a box, and some more to the sides.
cv::Rect lower_half(const cv::Rect& box) {
  return {box.x - 5, box.y + box.height / 2, box.width + 10, box.height};
}

TEST(SegmentationCompensator, RestoresNothingWhereTheSameStoodBefore) {
  for (const std::string name : {"person", ""}) {
    Show show;
    const Walker walker;
    for (int i = 0; i < 4; ++i)
      show.compensator.compensate(show.scene.frame(kStart + 0.033 * i, {walker.at(0)}),
                                  result({box_instance(walker.at(0).box, show.scene.size, name)}));
    // The lower half of it is known to be static, then all of it.
    const cv::Rect box = walker.at(0).box, lower = lower_half(box);
    FrameContext context;
    begin(context, show.scene.frame(kStart + 0.133, {walker.at(0)}), lower);
    const Segmentation& half = show.compensator.mend(context, Segmentation());
    ASSERT_EQ(half.instances.size(), 1u);
    const cv::Mat mended = mask_of(half.instances, show.scene.size);
    EXPECT_EQ(cv::countNonZero(mended), box.area() - (box & lower).area());
    EXPECT_EQ(cv::countNonZero(mended(lower & box)), 0);
    show.compensator.remember(context, half.instances);
    begin(context, show.scene.frame(kStart + 0.2, {walker.at(0)}),
          cv::Rect(cv::Point(), show.scene.size));
    EXPECT_EQ(show.compensator.mend(context, Segmentation()).instances.size(), 0u);
    EXPECT_EQ(show.compensator.restored(), 0);
  }
}

TEST(SegmentationCompensator, TakesNothingAtItsWordThatStoodThereBefore) {
  for (const std::string name : {"person", ""}) {
    Show show;
    const cv::Rect box = Walker().at(0).box;
    const cv::Rect lower = lower_half(box);
    cv::Rect known = lower;
    const Segmentation given = result({box_instance(box, show.scene.size, name)});
    const auto seen = [&](int i) {
      FrameContext context;
      begin(context, show.scene.frame(kStart + 0.033 * i, {Walker().at(0)}), known);
      const Segmentation& mended = show.compensator.mend(context, given);
      EXPECT_EQ(mended.instances.size(), 1u);
      const cv::Mat image = mask_of(mended.instances, show.scene.size);
      show.compensator.remember(context, mended.instances);
      return image;
    };
    const cv::Mat half = seen(0);
    EXPECT_EQ(cv::countNonZero(half),
              name.empty() ? box.area() : box.area() - (box & lower).area());
    EXPECT_EQ(cv::countNonZero(half(lower & box)) > 0, name.empty());
    EXPECT_EQ(cv::countNonZero(given.instances[0].mask), box.area()) << "the caller's own";
    // All of it: nothing is left, nor remembered.
    known = cv::Rect(cv::Point(), show.scene.size);
    EXPECT_EQ(cv::countNonZero(seen(1)), name.empty() ? box.area() : 0);
    EXPECT_EQ(show.compensator.objects().size(), name.empty() ? 1u : 0u);
  }
}

TEST(SegmentationCompensator, ShortHistoriesMoveByWhatTheyHave) {
  const Walker walker;
  {
    Show show(Settings::paper());
    show.show(0, {walker});
    const Segmentation& out = show.show(0.033, {}, {walker});
    ASSERT_EQ(out.instances.size(), 1u);
    EXPECT_EQ(out.instances[0].box.tl(), walker.at(0).box.tl()) << "copied in place";
  }
  Show show(Settings::paper());
  show.show(0, {walker});
  show.show(0.1, {walker});
  const Segmentation& out = show.show(0.2, {}, {walker});
  ASSERT_EQ(out.instances.size(), 1u);
  EXPECT_EQ(out.instances[0].box.tl(), walker.at(0.2).box.tl()) << "two places: their line";
}

TEST(SegmentationCompensator, RestoredObjectsTakePartInTheHistory) {
  const Walker walker{60, 80, 120, 0};
  for (const FlatScene& scene : kScenes) {
    Show show({}, scene);
    double t = 0;
    for (int i = 0; i < 4; ++i, t += 0.033) show.show(t, {walker});
    for (int i = 0; i < 6; ++i, t += 0.033) {
      const Segmentation& out = show.show(t, {}, {walker});
      ASSERT_EQ(out.instances.size(), 1u) << i;
      EXPECT_GT(show.iou_at(t, {walker}, out), 0.85) << i;
    }
    // Seen again, it is one object, not two.
    EXPECT_EQ(show.show(t, {walker}).instances.size(), 1u);
    EXPECT_EQ(show.compensator.restored(), 0);
  }
}

TEST(SegmentationCompensator, RestoresMissingPartsByUnion) {
  const Walker walker;
  for (const FlatScene& scene : kScenes) {
    Show show({}, scene);
    for (const double t : {0.0, 0.033, 0.067}) show.show(t, {walker});
    // The legs are missing: the lower third.
    cv::Rect seen = walker.at(0.1).box;
    seen.height = 66;
    const Segmentation& out = show.compensator.compensate(
        scene.frame(kStart + 0.1, {walker.at(0.1)}), result({box_instance(seen, scene.size)}));
    ASSERT_EQ(out.instances.size(), 1u);
    EXPECT_GT(show.iou_at(0.1, {walker}, out), 0.93);
    const cv::Mat mended = mask_of(out.instances, scene.size);
    EXPECT_EQ(pixels(mended(seen)), seen.area()) << "what was seen stays";
    EXPECT_EQ(show.compensator.restored(), 1);
    EXPECT_TRUE(show.compensator.status() & kRestored);
  }
}

TEST(SegmentationCompensator, LeavesAlmostWholeObjectsAlone) {
  const Walker walker;
  Show show;
  for (const double t : {0.0, 0.033, 0.067}) show.show(t, {walker});
  cv::Rect seen = walker.at(0.1).box;
  seen.height = 95;
  const Segmentation& out =
      show.compensator.compensate(show.scene.frame(kStart + 0.1, {walker.at(0.1)}),
                                  result({box_instance(seen, show.scene.size)}));
  ASSERT_EQ(out.instances.size(), 1u);
  EXPECT_EQ(out.instances[0].box, seen);
}

TEST(SegmentationCompensator, DoesNotRestoreWhoLeftTheImage) {
  const Walker walker{250, 80, 300, 0};  // its left edge leaves at 0.23 s
  for (const Settings& settings : {Settings(), Settings::paper()})
    for (const FlatScene& scene : kScenes) {
      Show show(settings, scene);
      for (const double t : {0.0, 0.05, 0.1, 0.15, 0.2}) show.show(t, {walker});
      EXPECT_TRUE(show.show(0.25, {}, {walker}).instances.empty());
      EXPECT_TRUE(show.show(0.3, {}, {walker}).instances.empty());
      EXPECT_EQ(show.compensator.restored(), 0);
    }
}

TEST(SegmentationCompensator, DoesNotRestoreWhoIsGone) {
  // Seen at its place, then only the wall is there.
  const Walker walker{140, 80, 0, 0};
  for (const FlatScene& scene : kScenes) {
    Show show({}, scene);
    for (const double t : {0.0, 0.033, 0.067}) show.show(t, {walker});
    EXPECT_TRUE(show.show(0.1, {}).instances.empty());
    EXPECT_TRUE(show.show(0.133, {}).instances.empty());
  }
}

TEST(SegmentationCompensator, DoesNotRestoreWhoIsHidden) {
  // Walks behind a column, nearer to the camera.
  const Walker walker{100, 80, 120, 0}, column{150, 20, 0, 0, 1, 5, {120, 200}};
  for (const FlatScene& scene : kScenes) {
    Show show({}, scene);
    for (const double t : {0.0, 0.033, 0.067, 0.1}) show.show(t, {walker}, {column});
    EXPECT_TRUE(show.show(0.6, {}, {walker, column}).instances.empty());
  }
}

TEST(SegmentationCompensator, DoesNotRestoreWhoWasHiddenAfterAFrameWithoutDepth) {
  // Nothing is measured on him in the last frame that shows him: he is still at 2 m, not in front.
  const Walker walker{140, 80, 0, 0}, column{120, 20, 0, 0, 1, 5, {120, 200}};
  Walker unmeasured = walker;
  unmeasured.depth_m = 0;
  Show show;
  for (const double t : {0.0, 0.033, 0.067}) show.show(t, {walker});
  EXPECT_EQ(show.show(0.1, {unmeasured}).instances.size(), 1u);
  EXPECT_TRUE(show.show(0.133, {}, {walker, column}).instances.empty());
}

TEST(SegmentationCompensator, CarriesOnWhoCameTooCloseToBeMeasured) {
  const Walker walker{140, 80, 0, 0, 0.6f};
  Walker unmeasured = walker;
  unmeasured.depth_m = 0;
  Show show;
  for (const double t : {0.0, 0.033, 0.067}) show.show(t, {walker});
  EXPECT_EQ(show.show(0.1, {unmeasured}).instances.size(), 1u);
  const Segmentation& carried = show.show(0.133, {}, {unmeasured});
  EXPECT_EQ(carried.instances.size(), 1u);
  EXPECT_GT(show.iou_at(0.133, {walker}, carried), 0.8);
}

TEST(SegmentationCompensator, TellsObjectsAndClassesApart) {
  const Walker person{40, 80, 60, 0, 2, 1}, cat{200, 150, -60, 0, 3, 2, {50, 30}},
      other{130, 60, 0, 30, 2.5f, 3};
  for (const FlatScene& scene : kScenes) {
    Show show({}, scene);
    const auto frame = [&](double t) {
      return scene.frame(kStart + t, {person.at(t), cat.at(t), other.at(t)});
    };
    const auto instance = [&](const Walker& w, double t, const char* name) {
      return box_instance(w.at(t).box, scene.size, name);
    };
    for (const double t : {0.0, 0.033, 0.067})
      show.compensator.compensate(
          frame(t),
          result({instance(person, t, "person"), instance(cat, t, "cat"), instance(other, t, "")}));
    const double t = 0.1;
    const Segmentation& out =
        show.compensator.compensate(frame(t), result({instance(other, t, "")}));
    ASSERT_EQ(out.instances.size(), 3u);
    EXPECT_EQ(show.compensator.restored(), 2);
    EXPECT_EQ(out.instances[0].class_name, "") << "the given ones come first";
    for (const Instance& s : out.instances) {
      const Walker& w = s.class_name == "person" ? person : s.class_name == "cat" ? cat : other;
      EXPECT_GT(iou(mask_of({s}, scene.size), show.truth(t, {w})), 0.85) << s.class_name;
    }
    EXPECT_NE(out.instances[1].class_name, out.instances[2].class_name);
  }
}

TEST(SegmentationCompensator, FollowsObjectsThatChangeTheirOrder) {
  const Walker a{60, 80, 60, 0, 2, 1}, b{200, 70, -60, 0, 2, 2};
  Show show;
  show.show(0, {a, b});
  show.show(0.05, {b, a});
  show.show(0.1, {a, b});
  const Segmentation& out = show.show(0.15, {b}, {a});
  ASSERT_EQ(out.instances.size(), 2u);
  EXPECT_NEAR(out.instances[1].box.x, a.at(0.15).box.x, 2);
}

TEST(SegmentationCompensator, OnlyTimeEndsWhatTheSegmenterHasNoNameFor) {
  const Walker box{140, 80, 0, 0};
  // How many frames it is restored in, after it was seen in `seen` of them.
  const auto restored = [&](const char* name, int seen) {
    Show show;
    double t = 0;
    Instance instance = box_instance(box.at(0).box, show.scene.size, name);
    for (int i = 0; i < seen; ++i, t += 0.033)
      show.compensator.compensate(show.scene.frame(kStart + t, {box.at(t)}), result({instance}));
    std::size_t n = 0;
    for (int i = 0; i < 80; ++i, t += 0.033) n += show.show(t, {}, {box}).instances.size();
    return static_cast<double>(n);
  };
  const Settings settings;
  EXPECT_EQ(restored("person", 3), 8);
  EXPECT_EQ(restored("person", 30), 8);
  EXPECT_NEAR(restored("", 1), settings.max_prediction_s / 0.033, 1.5);
  EXPECT_NEAR(restored("", 4), (settings.max_prediction_s + 0.3) / 0.033, 1.5);
  EXPECT_NEAR(restored("", 30), settings.max_unnamed_s / 0.033, 1.5);
}

TEST(SegmentationCompensator, OnlyTimeEndsItBehindALateSegmenterToo) {
  const Walker box{140, 80, 0, 0};
  for (const double late_s : {1e-6, 0.1}) {
    Show show;
    int restored = 0;
    for (int i = 0; i < 130; ++i) {
      const double t = kStart + 0.033 * i;
      Segmentation found;
      if (i % 6 == 0) found = result({}), found.timestamp = t - late_s;
      if (i < 30) found.instances = {box_instance(box.at(0).box, show.scene.size, "")};
      const bool there =
          !show.compensator.compensate(show.scene.frame(t, {box.at(0)}), found).instances.empty();
      if (i >= 30) restored += there;
    }
    EXPECT_NEAR(restored, Settings().max_unnamed_s / 0.033, 1.5) << late_s;
  }
}

TEST(SegmentationCompensator, CarriesWhatWasSeenOnceOnForLessWhereTheCameraRotates) {
  const Walker box{140, 80, 0, 0};
  // How many frames it is restored in, after the camera rotated in the frames that showed it.
  const auto restored = [&](const char* name, double rad_s, int seen, double dt = 0.033) {
    Show show;
    Eigen::Isometry3d rotates = Eigen::Isometry3d::Identity();
    rotates.rotate(Eigen::AngleAxisd(dt * rad_s, Eigen::Vector3d::UnitZ()));
    const Segmentation nobody = result({});
    const Segmentation one = result({box_instance(box.at(0).box, show.scene.size, name)});
    int n = 0;
    for (int i = 0; i < 80; ++i) {
      const bool shown = i > 0 && i <= seen;
      const RgbdFrame frame = show.scene.frame(kStart + dt * i, {box.at(0)});
      const Segmentation& out = show.compensator.compensate(
          frame, shown ? one : nobody, shown ? rotates : Eigen::Isometry3d::Identity());
      n += i > seen && !out.instances.empty();
    }
    return n;
  };
  EXPECT_NEAR(restored("", 0, 1), Settings().max_prediction_s / 0.033, 1.5);
  EXPECT_NEAR(restored("", 0.09, 1), 0.5 * Settings().max_prediction_s / 0.033, 1.5);
  EXPECT_NEAR(restored("", 1.5, 1), 0.1 / 0.033, 1.5);
  EXPECT_NEAR(restored("", 1.5, 7), (0.1 + 3 * 0.2) / 0.033, 2);
  EXPECT_EQ(restored("", 1.5, 1, 0.1), 2) << "a camera of 10 Hz";
  EXPECT_EQ(restored("person", 1.5, 3), restored("person", 0, 3)) << "a segmenter named it";
}

TEST(SegmentationCompensator, CarriesOnWhatWalksAway) {
  // How many of 150 frames it is restored in, after it was seen in three.
  const auto restored = [](double speed_m_s, bool camera_known) {
    Show show;
    std::optional<Eigen::Isometry3d> stands;
    if (camera_known) stands = Eigen::Isometry3d::Identity();
    int n = 0;
    for (int i = 0; i < 153; ++i) {
      const double t = i / 30.0, z = 1.5 + speed_m_s * t;
      const int width = static_cast<int>(90 / z), height = static_cast<int>(240 / z);
      const Figure figure{
          {160 - width / 2, 120 - height / 2, width, height}, static_cast<float>(z), 1};
      std::vector<Instance> seen;
      if (i < 3) seen.push_back(box_instance(figure.box, show.scene.size, ""));
      const Segmentation& out =
          show.compensator.compensate(show.scene.frame(kStart + t, {figure}), result(seen), stands);
      n += i >= 3 && !out.instances.empty();
    }
    return n;
  };
  EXPECT_GE(restored(0.4, true), 60);
  EXPECT_LT(restored(0.5, true), 90) << "a mask that slides along a wall recedes, too";
  EXPECT_LT(restored(0, true), 30);
  EXPECT_LT(restored(0.5, false), 30) << "the camera may have gone";
}

TEST(SegmentationCompensator, DoesNotCarryOnWhatHasNoNameWhereDepthShowsNothingOfIt) {
  // Nothing is measured on it. How many frames it is restored in, after it was seen in three.
  const auto restored = [](const char* name) {
    Show show;
    const Figure black{{140, 80, 60, 120}, 0, 1};
    const Instance instance = box_instance(black.box, show.scene.size, name);
    int n = 0;
    for (int i = 0; i < 10; ++i) {
      const std::vector<Instance> seen(i < 3 ? 1 : 0, instance);
      const RgbdFrame frame = show.scene.frame(kStart + i / 30.0, {black});
      const bool any = !show.compensator.compensate(frame, result(seen)).instances.empty();
      n += i >= 3 && any;
    }
    return n;
  };
  EXPECT_EQ(restored("person"), 7) << "black clothes are not measured";
  EXPECT_EQ(restored(""), 0) << "it was found by its depth: only its border with others is left";
}

TEST(SegmentationCompensator, ForgetsAfterTooManyMisses) {
  const Walker walker{140, 80, 0, 0};
  Settings settings;
  settings.max_restored_frames = 3;
  Show show(settings);
  double t = 0;
  for (int i = 0; i < 3; ++i, t += 0.033) show.show(t, {walker});
  for (int i = 0; i < 3; ++i, t += 0.033)
    EXPECT_EQ(show.show(t, {}, {walker}).instances.size(), 1u) << i;
  for (int i = 0; i < 3; ++i, t += 0.033)
    EXPECT_TRUE(show.show(t, {}, {walker}).instances.empty()) << i;
  // Seen again, it may be missed again.
  show.show(t, {walker});
  EXPECT_EQ(show.show(t + 0.033, {}, {walker}).instances.size(), 1u);
}

TEST(SegmentationCompensator, ForgetsSoonerWhatWasSeldomSeen) {
  const Settings paper = Settings::paper();
  for (const auto& [settings, seen, expected] :
       {std::make_tuple(Settings(), 1, 2), std::make_tuple(Settings(), 2, 5),
        std::make_tuple(Settings(), 3, 8), std::make_tuple(Settings(), 9, 8),
        std::make_tuple(paper, 1, std::min(20, paper.max_restored_frames))}) {
    Show show(settings);
    const Walker walker;
    int restored = 0;
    for (int i = 0; i < seen + 20; ++i) {
      const double t = 0.033 * i;
      if (i < seen) {
        show.show(t, {walker});
      } else if (!show.show(t, {}, {walker}).instances.empty()) {
        EXPECT_EQ(restored, i - seen) << "in a row";
        ++restored;
      }
    }
    EXPECT_EQ(restored, expected) << "seen " << seen << " times";
  }
}

TEST(SegmentationCompensator, MissesInSharpImagesCountTwice) {
  // 90 pixels a second: 3 from frame to frame.
  const Walker walker{60, 80, 90, 0};
  // How many misses are mended, with blur measured or not.
  const auto mended = [&](const ImageBlur* blur, const Settings& settings = {}) {
    Show show(settings);
    double t = 0;
    int restored = 0;
    for (int i = 0; i < 20; ++i, t += 1 / 30.0) {
      const bool seen = i < 5;
      FrameContext context;
      context.begin(show.scene.frame(kStart + t, {walker.at(t)}), Camera());
      if (blur) context.blur = *blur;
      const Segmentation& out = show.compensator.mend(
          context,
          result(seen ? std::vector<Instance>{box_instance(walker.at(t).box, show.scene.size)}
                      : std::vector<Instance>()));
      if (!seen) restored += static_cast<int>(out.instances.size());
      for (const Instance& s : out.instances) {
        if (i > 0) {
          EXPECT_EQ(std::isnan(s.blur.motion_px), !blur || std::isnan(blur->exposure_share));
        }
        if (i > 2 && !std::isnan(s.blur.motion_px)) {
          EXPECT_NEAR(s.blur.motion_px, 3 * blur->exposure_share, blur->exposure_share) << i;
        }
      }
      show.compensator.remember(context, out.instances);
    }
    return restored;
  };
  ImageBlur blur;
  EXPECT_EQ(mended(nullptr), 8);
  EXPECT_EQ(mended(&blur), 8) << "nothing is known";
  blur.exposure_share = 0.5;
  EXPECT_EQ(mended(&blur), 4) << "1.5 pixels";
  blur.whole.sharpness = 0.5;
  EXPECT_EQ(mended(&blur), 8) << "but the edges are blurred";
  blur.whole.sharpness = 0.95;
  EXPECT_EQ(mended(&blur), 4);
  Settings settings;
  settings.sharp_px = 1;
  EXPECT_EQ(mended(&blur, settings), 8);
  settings.sharp_px = 0;
  EXPECT_EQ(mended(&blur, settings), 8);
  blur.exposure_share = 3;
  EXPECT_EQ(mended(&blur), 8) << "9 pixels";
  blur.exposure_share = std::nan("");
  EXPECT_EQ(mended(&blur), 4) << "the edges are all that is known";
  EXPECT_EQ(Settings::paper().sharp_px, 0);
}

TEST(SegmentationCompensator, ForgetsAfterTooLongATime) {
  const Walker walker{140, 80, 0, 0};
  Settings settings;
  settings.max_prediction_s = 0.4;
  for (const FlatScene& scene : kScenes) {
    Show show(settings, scene);
    show.show(0, {walker});
    for (const double t : {0.1, 0.2, 0.3, 0.39}) {
      const Segmentation& out = show.skip(t, {walker});
      EXPECT_EQ(out.instances.size(), 1u) << t;
      EXPECT_FALSE(out.available);
      EXPECT_EQ(show.compensator.status(), kNoSegmentation | kRestored);
      EXPECT_NEAR(show.compensator.age_s(), t, 1e-6);
    }
    EXPECT_TRUE(show.skip(0.41, {walker}).instances.empty());
    EXPECT_EQ(show.compensator.status(), kNoSegmentation | kMaskStale);
    EXPECT_TRUE(show.skip(0.45, {walker}).instances.empty());
  }
}

TEST(SegmentationCompensator, PredictsBetweenResultsAt4Hz) {
  // 30 Hz frames, every eighth segmented; two people cross at 0.5 m/s and 0.3 m/s.
  const Walker a{30, 80, 65, 0, 2, 1}, b{230, 70, -40, 0, 2.5f, 2};
  for (const FlatScene& scene : kScenes) {
    Show show({}, scene);
    double sum = 0;
    for (int i = 0; i <= 40; ++i) {
      const double t = i / 30.0;
      const Segmentation& out = i % 8 == 0 ? show.show(t, {a, b}) : show.skip(t, {a, b});
      ASSERT_EQ(out.instances.size(), 2u) << i;
      if (i > 8) {
        const double quality = show.iou_at(t, {a, b}, out);
        sum += quality;
        EXPECT_GT(quality, 0.8) << i;
      }
    }
    EXPECT_GT(sum / 32, 0.9);
  }
}

TEST(SegmentationCompensator, SaysThatNothingWasEverSegmented) {
  Show show;
  EXPECT_TRUE(show.skip(0, {}).instances.empty());
  EXPECT_EQ(show.compensator.status(), kNoSegmentation | kNeverSegmented);
  EXPECT_TRUE(std::isinf(show.compensator.age_s()));
  show.show(0.1, {});
  EXPECT_EQ(show.compensator.status(), kOk);
  show.skip(0.2, {});
  EXPECT_EQ(show.compensator.status(), kNoSegmentation);
  EXPECT_NEAR(show.compensator.age_s(), 0.1, 1e-6);
}

TEST(SegmentationCompensator, CameraMotionCarriesObjects) {
  // The camera turns left by 6 degrees: everything moves 27 pixels to the right.
  const Walker before{100, 80, 0, 0};
  const double angle = 6 * 3.14159265358979 / 180;
  Eigen::Isometry3d turn = Eigen::Isometry3d::Identity();
  turn.rotate(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitY()));
  const FlatScene scene;
  const Camera camera = scene.camera();
  const Eigen::Vector2d center =
      camera.project(turn * camera.unproject(100 + 17.5, 80 + 49.5, 2.0));
  const int shift = static_cast<int>(std::lround(center.x() - (100 + 17.5)));
  ASSERT_GT(shift, 24);
  Walker after = before;
  after.x += shift;

  for (const Settings& preset : {Settings(), Settings::paper()})
    for (const FlatScene& s : kScenes) {
      Settings settings = preset;
      settings.search_px = 4;
      for (const bool known : {true, false}) {
        Show show(settings, s);
        show.show(0, {before});
        const RgbdFrame frame = s.frame(kStart + 0.033, {after.at(0)}, shift);
        const auto motion = known ? std::optional<Eigen::Isometry3d>(turn) : std::nullopt;
        const Segmentation& out = show.compensator.compensate(frame, result({}), motion);
        if (known) {
          ASSERT_EQ(out.instances.size(), 1u);
          EXPECT_GT(show.iou_at(0, {after}, out), 0.85);
        } else {
          EXPECT_TRUE(out.instances.empty()) << "it is not found where it was";
        }
      }
    }
}

TEST(SegmentationCompensator, CameraTranslationMovesByDepth) {
  // The camera steps 0.2 m to the left: an object at 2 m moves by 26 pixels.
  const Walker before{100, 80, 0, 0};
  Eigen::Isometry3d step = Eigen::Isometry3d::Identity();
  step.translation().x() = 0.2;
  Walker after = before;
  after.x += 262.5 * 0.2 / 2;
  Settings settings;
  settings.search_px = 3;
  Show show(settings);
  show.show(0, {before});
  const Segmentation& out = show.compensator.compensate(
      show.scene.frame(kStart + 0.033, {after.at(0)}), Segmentation(), step);
  ASSERT_EQ(out.instances.size(), 1u);
  EXPECT_GT(show.iou_at(0, {after}, out), 0.9);
}

TEST(SegmentationCompensator, ForgetsWhenTimeDoesNotGoOn) {
  const Walker walker{140, 80, 0, 0};
  for (const double next : {0.067, 0.02, -100.0}) {
    Show show;
    for (const double t : {0.0, 0.033, 0.067}) show.show(t, {walker});
    EXPECT_TRUE(show.show(next, {}, {walker}).instances.empty());
    EXPECT_EQ(show.compensator.status(), kTimestampOrder);
    // It goes on from there.
    show.show(next + 0.033, {walker});
    EXPECT_EQ(show.compensator.status(), kOk);
    EXPECT_EQ(show.show(next + 0.067, {}, {walker}).instances.size(), 1u);
  }
}

TEST(SegmentationCompensator, TakesNegativeTimes) {
  const Walker walker;
  Show show;
  for (const double t : {0.0, 0.033, 0.067}) show.show(t - 2 * kStart, {walker});
  EXPECT_EQ(show.compensator.status(), kOk);
}

TEST(SegmentationCompensator, ClipsAtTheBorder) {
  const Walker walker{270, 100, 150, 200};
  for (const Settings& settings : {Settings(), Settings::paper()})
    for (const FlatScene& scene : kScenes) {
      Show show(settings, scene);
      for (const double t : {0.0, 0.033, 0.067, 0.1}) show.show(t, {walker});
      const Segmentation& out = show.show(0.167, {}, {walker});  // 25 of 36 columns are left
      ASSERT_EQ(out.instances.size(), 1u);
      EXPECT_NO_THROW(check_segmentation(out, scene.size));
      EXPECT_GT(show.iou_at(0.167, {walker}, out), 0.8);
    }
}

TEST(SegmentationCompensator, PaperRestoresWholeObjectsAsTheyWere) {
  const Walker walker{60, 80, 90, 30};
  Show show(Settings::paper());
  // A mask with a shape of its own.
  const auto shaped = [&](double t) {
    Instance s = box_instance(walker.at(t).box, show.scene.size);
    s.mask(cv::Rect(0, 0, 9, 40)).setTo(0);
    s.mask(cv::Rect(30, 70, 6, 30)).setTo(0);
    return s;
  };
  for (const double t : {0.0, 0.1, 0.2})
    show.compensator.compensate(show.scene.frame(kStart + t, {walker.at(t)}), result({shaped(t)}));
  const Segmentation& out = show.show(0.3, {}, {walker});
  ASSERT_EQ(out.instances.size(), 1u);
  const Instance expected = shaped(0.3);
  EXPECT_TRUE(
      identical(mask_of(out.instances, show.scene.size), mask_of({expected}, show.scene.size)));
}

TEST(SegmentationCompensator, PaperTriggersOnTheWholeArea) {
  const Walker small{40, 80, 0, 0, 2, 1, {20, 40}}, large{150, 40, 0, 0, 2.5f, 2, {90, 150}};
  // 800 of 14300 pixels are missing: r = 0.94, nothing happens.
  Show show(Settings::paper());
  for (const double t : {0.0, 0.033, 0.067}) show.show(t, {small, large});
  EXPECT_EQ(show.show(0.1, {large}, {small}).instances.size(), 1u);
  EXPECT_EQ(show.compensator.restored(), 0);
  // The default decides for each object.
  Show by_object;
  for (const double t : {0.0, 0.033, 0.067}) by_object.show(t, {small, large});
  EXPECT_EQ(by_object.show(0.1, {large}, {small}).instances.size(), 2u);
  // The large one missing: r = 0.06.
  Show other(Settings::paper());
  for (const double t : {0.0, 0.033, 0.067}) other.show(t, {small, large});
  EXPECT_EQ(other.show(0.1, {small}, {large}).instances.size(), 2u);
}

TEST(SegmentationCompensator, PaperDoesNotMendParts) {
  const Walker walker{140, 80, 0, 0};
  Show show(Settings::paper());
  for (const double t : {0.0, 0.033, 0.067}) show.show(t, {walker});
  cv::Rect seen = walker.at(0).box;
  seen.height = 40;
  const Segmentation& out =
      show.compensator.compensate(show.scene.frame(kStart + 0.1, {walker.at(0)}),
                                  result({box_instance(seen, show.scene.size)}));
  ASSERT_EQ(out.instances.size(), 1u);
  EXPECT_EQ(out.instances[0].box, seen);
  EXPECT_EQ(show.compensator.restored(), 0);
}

TEST(SegmentationCompensator, PaperDoesNotLookAtDepth) {
  const Walker walker{140, 80, 0, 0};
  Show show(Settings::paper());
  for (const double t : {0.0, 0.033, 0.067}) show.show(t, {walker});
  RgbdFrame frame = show.scene.frame(kStart + 0.1, {walker.at(0)});
  frame.depth.setTo(50000);  // says: gone
  EXPECT_EQ(show.compensator.compensate(frame, result({})).instances.size(), 1u);
}

TEST(SegmentationCompensator, TakesBareBoxes) {
  const Walker walker;
  const auto bare = [](const cv::Rect& box) {
    Instance s;
    s.box = box;
    return s;
  };
  for (const FlatScene& scene : kScenes) {
    Show show({}, scene);
    for (const double t : {0.0, 0.033, 0.067}) {
      const Segmentation& out = show.compensator.compensate(scene.frame(kStart + t, {walker.at(t)}),
                                                            result({bare(walker.at(t).box)}));
      ASSERT_EQ(out.instances.size(), 1u);
      EXPECT_TRUE(out.instances[0].mask.empty()) << "stays a bare box";
    }
    const Segmentation& out = show.show(0.1, {}, {walker});
    ASSERT_EQ(out.instances.size(), 1u);
    EXPECT_GT(show.iou_at(0.1, {walker}, out), 0.9);
  }
}

TEST(SegmentationCompensator, RemembersRefinedMasks) {
  // The fusion carved a figure out of a bare box: that is what comes back.
  const Walker walker{140, 80, 0, 0};
  Show show;
  Instance bare;
  bare.box = cv::Rect(120, 60, 80, 150);
  for (const double t : {0.0, 0.033}) {
    FrameContext context;
    context.begin(show.scene.frame(kStart + t, {walker.at(t)}), Camera());
    show.compensator.mend(context, result({bare}));
    show.compensator.remember(context, {box_instance(walker.at(t).box, show.scene.size)});
  }
  const Segmentation& out = show.show(0.067, {}, {walker});
  ASSERT_EQ(out.instances.size(), 1u);
  EXPECT_GT(show.iou_at(0, {walker}, out), 0.95);
  // What the fusion added to a mask is not remembered.
  Show other;
  for (const double t : {0.0, 0.033}) {
    FrameContext context;
    context.begin(other.scene.frame(kStart + t, {walker.at(t)}), Camera());
    other.compensator.mend(context, result({box_instance(walker.at(t).box, other.scene.size)}));
    other.compensator.remember(context, {box_instance({100, 60, 100, 150}, other.scene.size)});
  }
  EXPECT_GT(other.iou_at(0, {walker}, other.show(0.067, {}, {walker})), 0.95);
}

TEST(SegmentationCompensator, ForgetsWhatWasCarriedOntoAnotherSurface) {
  // Somebody is missed in the frame in which a part of him is hidden; the fusion keeps a part of
  // what was carried on. Whether that is carried on in the frame after.
  const Walker walker{140, 80, 0, 0};
  const cv::Rect whole = walker.at(0).box, seen(whole.x, whole.y, 24, whole.height),
                 wall(seen.br().x, whole.y, 12, whole.height);
  const auto carried_on = [&](const cv::Rect& kept) {
    Show show;
    for (const double t : {0.0, 0.033, 0.067}) show.show(t, {walker});
    const std::vector<Figure> half = {{seen, walker.depth_m, walker.texture}};
    FrameContext context;
    context.begin(show.scene.frame(kStart + 0.1, half), Camera());
    EXPECT_EQ(show.compensator.mend(context, result({})).instances.size(), 1u);
    show.compensator.remember(context, {box_instance(kept, show.scene.size)});
    context.begin(show.scene.frame(kStart + 0.133, half), Camera());
    return !show.compensator.mend(context, result({})).instances.empty();
  };
  EXPECT_TRUE(carried_on(seen));
  EXPECT_FALSE(carried_on(wall));
}

TEST(SegmentationCompensator, RefusesToRememberOtherInstances) {
  Show show;
  FrameContext context;
  context.begin(show.scene.frame(kStart, {}), Camera());
  show.compensator.mend(context, result({box_instance({10, 10, 50, 50}, show.scene.size)}));
  EXPECT_ERROR(show.compensator.remember(context, {}), "remember", "1", "found 0");
}

TEST(SegmentationCompensator, ResetForgets) {
  const Walker walker{140, 80, 0, 0};
  Show show;
  show.show(0, {walker});
  show.compensator.reset();
  EXPECT_TRUE(show.show(-5, {}, {walker}).instances.empty());
  EXPECT_EQ(show.compensator.status(), kOk) << "a new beginning may lie earlier";
}

TEST(SegmentationCompensator, TakesAThousandInstances) {
  for (const FlatScene& scene : {FlatScene(), without_depth()}) {
    Show show({}, scene);
    std::vector<Figure> figures;
    std::vector<Instance> all, half;
    for (int i = 0; i < 1000; ++i) {
      const cv::Rect box(8 * (i % 40), 9 * (i / 40), 6, 6);
      figures.push_back({box, 2, static_cast<std::uint32_t>(i % 7)});
      all.push_back(box_instance(box, scene.size));
      if (i % 2) half.push_back(all.back());
    }
    show.compensator.compensate(scene.frame(kStart, figures), result(all));
    show.compensator.compensate(scene.frame(kStart + 0.033, figures), result(all));
    const Segmentation& out =
        show.compensator.compensate(scene.frame(kStart + 0.067, figures), result(half));
    EXPECT_EQ(out.instances.size(), 1000u);
    EXPECT_EQ(show.compensator.restored(), 500);
    EXPECT_GT(iou(mask_of(out.instances, scene.size), mask_of(all, scene.size)), 0.95);
  }
}

TEST(SegmentationCompensator, ForgetsSpecks) {
  Show show;
  show.compensator.compensate(show.scene.frame(kStart, {}),
                              result({box_instance({50, 50, 1, 1}, show.scene.size)}));
  EXPECT_TRUE(show.show(0.1, {}).instances.empty());
  Instance hollow = box_instance({50, 50, 40, 40}, show.scene.size);
  hollow.mask.setTo(0);
  show.compensator.compensate(show.scene.frame(kStart + 0.2, {}), result({hollow}));
  EXPECT_TRUE(show.show(0.3, {}).instances.empty());
}

TEST(SegmentationCompensator, DepthIn32BitMetresGivesTheSame) {
  const Walker walker;
  Show show, metres;
  for (const double t : {0.0, 0.033, 0.067, 0.1, 0.133}) {
    RgbdFrame frame = show.scene.frame(kStart + t, {walker.at(t)});
    const Segmentation given =
        t < 0.08 ? result({box_instance(walker.at(t).box, show.scene.size)}) : result({});
    const cv::Mat a = mask_of(show.compensator.compensate(frame, given).instances, show.scene.size);
    frame.depth.convertTo(frame.depth, CV_32F, 1 / 5000.0);
    const cv::Mat b =
        mask_of(metres.compensator.compensate(frame, given).instances, show.scene.size);
    EXPECT_TRUE(identical(a, b)) << t;
    EXPECT_GT(pixels(a), 0);
  }
}

TEST(SegmentationCompensator, TakesImagesOfAnotherSize) {
  const Walker walker;
  FlatScene scene;
  SegmentationCompensator compensator({}, of_any_size(scene.camera()));
  const Figure figure = walker.at(0);
  compensator.compensate(scene.frame(kStart, {figure}),
                         result({box_instance(figure.box, scene.size)}));
  scene.size = {64, 48};
  EXPECT_NO_THROW(compensator.compensate(scene.frame(kStart + 1, {}), result({})));
  EXPECT_NO_THROW(compensator.compensate(scene.frame(kStart + 1.1, {}), Segmentation()));
}

TEST(SegmentationCompensator, RefusesBadInput) {
  Show show;
  RgbdFrame frame = show.scene.frame(kStart, {});
  EXPECT_ERROR(show.compensator.compensate(
                   frame, result({box_instance({0, 0, 640, 480}, cv::Size(640, 480))})),
               "instances[0].box", "320x240");
  frame.timestamp = std::nan("");
  EXPECT_ERROR(show.compensator.compensate(frame, result({})), "frame.timestamp");
}

TEST(SegmentationCompensator, RefusesFramesWhoseTimesNobodySet) {
  Show show;
  RgbdFrame frame = show.scene.frame(0, {});
  EXPECT_NO_THROW(show.compensator.compensate(frame, result({}))) << "time may begin at 0";
  EXPECT_ERROR(show.compensator.compensate(frame, result({})), "frame.timestamp", "0 twice",
               "frame rate");
  frame.timestamp = 1.0 / 30;
  EXPECT_NO_THROW(show.compensator.compensate(frame, result({})));
  EXPECT_EQ(show.compensator.status() & kTimestampOrder, 0u);
  EXPECT_NO_THROW(show.compensator.compensate(frame, result({}))) << "a frame that comes twice";
  frame.timestamp = 0;
  EXPECT_NO_THROW(show.compensator.compensate(frame, result({}))) << "a sequence that begins again";
}

TEST(SegmentationCompensator, RefusesSettingsWithoutSense) {
  Settings s;
  s.area_ratio = 0;
  EXPECT_ERROR(SegmentationCompensator{s}, "SegmentationCompensatorSettings.area_ratio", "found 0");
  s = Settings(), s.area_ratio = std::nan("");
  EXPECT_ERROR(SegmentationCompensator{s}, "area_ratio");
  for (const int history : {0, 9}) {
    s = Settings(), s.history = history;
    EXPECT_ERROR(SegmentationCompensator{s}, "history", "1 to 8");
  }
  for (const double bad : {-2.0, 1.5, std::nan("")}) {
    s = Settings(), s.min_template_score = bad;
    EXPECT_ERROR(SegmentationCompensator{s}, "min_template_score", "-1 to 1");
    s = Settings(), s.min_depth_support = bad;
    EXPECT_ERROR(SegmentationCompensator{s}, "min_depth_support", "0 to 1");
  }
  s = Settings(), s.search_px = -1;
  EXPECT_ERROR(SegmentationCompensator{s}, "search_px");
  s = Settings(), s.max_restored_frames = -1;
  EXPECT_ERROR(SegmentationCompensator{s}, "max_restored_frames");
  s = Settings(), s.sharp_px = -1;
  EXPECT_ERROR(SegmentationCompensator{s}, "sharp_px");
  s = Settings(), s.max_unnamed_s = -1;
  EXPECT_ERROR(SegmentationCompensator{s}, "max_unnamed_s");
  s = Settings(), s.max_prediction_s = std::nan("");
  EXPECT_ERROR(SegmentationCompensator{s}, "max_prediction_s");
  s = Settings(), s.sudden_share = 0;
  EXPECT_ERROR(SegmentationCompensator{s}, "sudden_share");
  s = Settings(), s.sudden_results = 0;
  EXPECT_ERROR(SegmentationCompensator{s}, "sudden_results");
  s = Settings(), s.max_speed_m_s = -1;
  EXPECT_ERROR(SegmentationCompensator{s}, "max_speed_m_s");
}

}  // namespace
