// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/objects/object_tracker.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "../flat_scene.hpp"
#include "../io/temporary_folder.hpp"
#include "stillpoint/front_end.hpp"

namespace stillpoint {
namespace {

constexpr double kStart_s = 1.3e9;
const FlatScene kScene;

double time_of(int frame) { return kStart_s + frame / 30.0; }

// A person of 38 x 139 pixels at 3 m, whose left side is at x.
Figure person_at(int x, float depth_m = 3) { return {{x, 60, 38, 139}, depth_m, 1}; }

Eigen::Vector3d centroid_of(const Figure& figure) {
  const Camera c = kScene.camera();
  const cv::Rect box = figure.box & cv::Rect(cv::Point(), kScene.size);
  return c.unproject(box.x + 0.5 * (box.width - 1), box.y + 0.5 * (box.height - 1),
                     static_cast<double>(figure.depth_m));
}

// Follows figures with what the compensator would remember of them.
struct Follower {
  ObjectTracker tracker;
  FrameContext context;
  CameraPlace place;
  std::vector<Instance> instances;

  const std::vector<DynamicObject>& see(int frame, const std::vector<Figure>& figures,
                                        const std::vector<int>& memory = {}) {
    tracker.finish(place);
    context.begin(kScene.frame(time_of(frame), figures), kScene.camera());
    instances.clear();
    for (const Figure& f : figures) instances.push_back(box_instance(f.box, kScene.size));
    return see(memory);
  }
  const std::vector<DynamicObject>& see(const std::vector<int>& memory) {
    tracker.observe(context, instances, memory);
    return tracker.objects(instances, place);
  }
};

TEST(PositionVelocityFilter, FindsAConstantVelocity) {
  PositionVelocityFilter filter;
  const Eigen::Vector3d start(1, 2, 3), velocity(0.5, -0.25, 1);
  const Eigen::Matrix3d noise = 1e-4 * Eigen::Matrix3d::Identity();
  filter.start(start, noise, 2);
  EXPECT_EQ(filter.velocity().norm(), 0);
  EXPECT_EQ(filter.covariance()(4, 4), 4);
  for (int i = 1; i <= 30; ++i) {
    filter.predict(0.1, 0.1);
    filter.correct(start + 0.1 * i * velocity, noise);
  }
  EXPECT_LT((filter.velocity() - velocity).norm(), 0.01);
  EXPECT_LT((filter.position() - start - 3 * velocity).norm(), 0.005);
  EXPECT_LT(filter.covariance()(0, 0), 1e-4) << "many measurements know more than one";
  const double before = filter.covariance()(0, 0);
  filter.predict(1, 0.1);
  EXPECT_GT(filter.covariance()(0, 0), before);
  EXPECT_LT((filter.position() - start - 4 * velocity).norm(), 0.015);
  const Eigen::Matrix<double, 6, 6> P = filter.covariance();
  EXPECT_LT((P - P.transpose()).norm(), 1e-12);
}

TEST(ObjectTracker, TellsPlaceAndVelocity) {
  Follower follower;
  for (int i = 0; i < 40; ++i) {
    const Figure person = person_at(40 + 3 * i);
    const auto& objects = follower.see(i, {person}, {7});
    ASSERT_EQ(objects.size(), 1u);
    EXPECT_EQ(objects[0].id, 0);
    EXPECT_EQ(objects[0].class_name, "person");
    EXPECT_EQ(objects[0].box, person.box);
    EXPECT_NEAR(objects[0].depth_m, 3, 1e-3);
    EXPECT_NEAR(objects[0].tracked_s, i / 30.0, 1e-6);
    EXPECT_EQ(objects[0].unseen_s, 0);
    EXPECT_FALSE(objects[0].in_world) << "no host has told a pose";
    ASSERT_TRUE(objects[0].in_camera);
    EXPECT_LT((objects[0].in_camera->centroid_m - centroid_of(person)).norm(), 0.1) << i;
    if (i > 0) {
      EXPECT_NEAR(objects[0].shift_px.x, 3, 1e-3);
    }
  }
  const ObjectState& state =
      *follower.tracker.objects(follower.instances, follower.place)[0].in_camera;
  const double speed = 3 * 30 * 3 / kScene.camera().fx;  // 3 pixels a frame at 3 m
  EXPECT_NEAR(state.velocity_m_s.x(), speed, 0.05 * speed);
  EXPECT_NEAR(state.velocity_m_s.y(), 0, 0.02);
  EXPECT_NEAR(state.velocity_m_s.z(), 0, 0.02);
  const double sigma = std::sqrt(state.covariance(3, 3));
  EXPECT_GT(sigma, 0.01);
  EXPECT_LT(sigma, 0.5) << "it knows that it knows";
}

TEST(ObjectTracker, VelocityIsAgainstTheWorldNotTheCamera) {
  // The camera moves to the right with the person, who stays where he is in the image.
  Follower follower;
  follower.place.T_host_world = Eigen::Isometry3d(Eigen::Translation3d(0, 0, 10));
  const Figure person = person_at(150);
  for (int i = 0; i < 40; ++i) {
    follower.place.T_world_camera.translation().x() = i / 30.0;
    if (i > 0) follower.place.T_world_depth.translation().x() = i / 30.0;
    follower.tracker.finish(follower.place);
    follower.see(i, {person}, {7});
  }
  const auto& object = follower.tracker.objects(follower.instances, follower.place)[0];
  EXPECT_NEAR(object.in_camera->velocity_m_s.x(), 1, 0.05);
  EXPECT_LT((object.in_camera->centroid_m - centroid_of(person)).norm(), 0.05);
  ASSERT_TRUE(object.in_world);
  EXPECT_NEAR(object.in_world->velocity_m_s.x(), 1, 0.05);
  const Eigen::Vector3d expected = centroid_of(person) + Eigen::Vector3d(39 / 30.0, 0, 10);
  EXPECT_LT((object.in_world->centroid_m - expected).norm(), 0.05);
}

TEST(ObjectTracker, WhoWalksBehindAPillarKeepsHisId) {
  for (const int hidden : {15, 90}) {  // half a second, three seconds
    Follower follower;
    int i = 0;
    for (; i < 20; ++i) follower.see(i, {person_at(20 + 2 * i)}, {7});
    for (; i < 20 + hidden; ++i) EXPECT_TRUE(follower.see(i, {}).empty()) << "not in this frame";
    // The compensator has forgotten him, and gives him another number.
    const auto& objects = follower.see(i, {person_at(20 + 2 * std::min(i, 50))}, {8});
    ASSERT_EQ(objects.size(), 1u);
    EXPECT_EQ(objects[0].id, hidden == 15 ? 0 : 1);
    EXPECT_NEAR(objects[0].tracked_s, hidden == 15 ? 35 / 30.0 : 0, 1e-6);
  }
}

TEST(ObjectTracker, WhoIsInTheMaskKeepsHisIdThoughHeIsPredicted) {
  // As the results of a slow network are, each of them.
  Follower follower;
  for (int i = 0; i < 150; ++i) {
    follower.tracker.finish(follower.place);
    follower.context.begin(kScene.frame(time_of(i), {person_at(40)}), kScene.camera());
    follower.instances = {box_instance(person_at(40).box, kScene.size)};
    follower.instances[0].predicted = i > 0;
    const auto& objects = follower.see({7});
    ASSERT_EQ(objects.size(), 1u);
    EXPECT_EQ(objects[0].id, 0) << i;
  }
}

TEST(ObjectTracker, WhoIsLateWithoutDepthKeepsHisIdThroughAGap) {
  for (const int gap : {3, 20}) {  // frames without him
    Follower follower;
    FlatScene flat = kScene;
    flat.with_depth = false;
    for (int i = 0; i < 10 + gap + 1; ++i) {
      follower.tracker.finish(follower.place);
      follower.context.begin(flat.frame(time_of(i), {}), flat.camera());
      follower.instances.clear();
      if (i < 10 || i == 10 + gap) {
        follower.instances = {box_instance(person_at(40).box, kScene.size)};
        follower.instances[0].predicted = true, follower.instances[0].late_s = 0.8;
      }
      const auto& objects = follower.see({i < 10 ? 7 : 8});
      if (i == 10 + gap) {
        EXPECT_EQ(objects.at(0).id, gap == 3 ? 0 : 1);
      }
    }
  }
}

TEST(ObjectTracker, SomebodyElseGetsAnotherId) {
  Follower follower;
  for (int i = 0; i < 10; ++i) follower.see(i, {person_at(40)}, {7});
  for (int i = 10; i < 20; ++i) follower.see(i, {});
  EXPECT_EQ(follower.see(20, {person_at(250)}, {8})[0].id, 1) << "more than a metre away";
  Follower cats;
  cats.see(0, {person_at(40)});
  cats.tracker.finish(cats.place);
  cats.context.begin(kScene.frame(time_of(1), {person_at(40)}), kScene.camera());
  cats.instances[0].class_name = "cat";
  EXPECT_EQ(cats.see({})[0].id, 1) << "a person becomes no cat";
}

TEST(ObjectTracker, TwoWhoCrossKeepTheirIds) {
  Follower follower;
  for (int i = 0; i < 60; ++i) {
    std::vector<Figure> figures{person_at(40 + 3 * i, 3), person_at(220 - 3 * i, 2)};
    const bool hidden = std::abs(figures[0].box.x - figures[1].box.x) < 30;
    if (hidden) figures.erase(figures.begin());      // behind the nearer one
    const auto& objects = follower.see(i, figures);  // without any memory
    ASSERT_EQ(objects.size(), figures.size());
    for (const DynamicObject& o : objects) EXPECT_EQ(o.id, o.depth_m > 2.5f ? 0 : 1) << i;
  }
}

TEST(ObjectTracker, AMoverOnAPersonIsThePerson) {
  Follower follower;
  follower.see(0, {person_at(40), person_at(200)});
  follower.tracker.finish(follower.place);
  follower.instances.insert(follower.instances.begin() + 1,
                            box_instance(person_at(45).box, kScene.size));
  follower.instances[1].class_name.clear(), follower.instances[2].class_name.clear();
  follower.context.begin(kScene.frame(time_of(1), {person_at(40), person_at(200)}),
                         kScene.camera());
  const auto objects = follower.see({1, 2, 3});
  ASSERT_EQ(objects.size(), 2u);
  EXPECT_EQ(objects[0].class_name, "person");
  EXPECT_EQ(objects[1].box.x, 200);
  EXPECT_EQ(objects[1].class_name, "person") << "it was named before";

  // The network loses him: what moves there is still him.
  follower.tracker.finish(follower.place);
  follower.instances.erase(follower.instances.begin());
  follower.context.begin(kScene.frame(time_of(2), {person_at(45)}), kScene.camera());
  EXPECT_EQ(follower.see({2, 3})[0].id, objects[0].id);
}

TEST(ObjectTracker, WithoutDepthIdsGoByOverlap) {
  FlatScene flat = kScene;
  flat.with_depth = false;
  Follower follower;
  for (int i = 0; i < 20; ++i) {
    const std::vector<Figure> figures{person_at(20 + 3 * i), person_at(250 - 3 * i)};
    follower.see(i, figures);
    follower.tracker.finish(follower.place);
    follower.context.begin(flat.frame(time_of(i) + 0.01, figures), flat.camera());
    const auto& objects = follower.see({});
    ASSERT_EQ(objects.size(), 2u);
    EXPECT_EQ(objects[0].depth_m, 0);
    EXPECT_EQ(objects[0].id, 0);
    EXPECT_EQ(objects[1].id, 1);
  }
  Follower mono;
  mono.context.begin(flat.frame(time_of(0), {person_at(20)}), flat.camera());
  mono.instances = {box_instance(person_at(20).box, kScene.size)};
  const auto& objects = mono.see({});
  EXPECT_FALSE(objects[0].in_camera || objects[0].in_world);
}

TEST(ObjectTracker, AVelocityThatIsNotKnownSaysSo) {
  Follower follower;
  for (int i = 0; i < 10; ++i) {
    ++follower.place.chain;  // nobody knows how the camera moves
    const auto& objects = follower.see(i, {person_at(40 + 3 * i)}, {7});
    EXPECT_EQ(objects[0].id, 0);
    EXPECT_EQ(objects[0].in_camera->velocity_m_s.norm(), 0);
    EXPECT_GE(objects[0].in_camera->covariance(3, 3), 0.9) << "1 m/s, squared";
    EXPECT_LT((objects[0].in_camera->centroid_m - centroid_of(person_at(40 + 3 * i))).norm(), 0.02);
  }
}

TEST(ObjectTracker, TimeThatGoesBackStartsAnew) {
  Follower follower;
  follower.see(5, {person_at(40)}, {7});
  EXPECT_EQ(follower.see(2, {person_at(40)}, {7})[0].id, 1);
}

TEST(ObjectTracker, SaysWhatIsWrong) {
  ObjectTrackerSettings settings;
  settings.max_lost_s = -1;
  EXPECT_ERROR(ObjectTracker{settings}, "max_lost_s: expected at least 0, found -1");
}

// Two people, one of whom the segmenter misses now and then.
int predicted_through_misses(const FrontEndSettings& settings) {
  FrontEnd front_end(settings, kScene.camera());
  EXPECT_TRUE(front_end.objects().empty());
  int predicted = 0;
  for (int i = 0; i < 40; ++i) {
    const std::vector<Figure> figures{person_at(40 + 3 * i), person_at(240 - 2 * i, 2.4f)};
    std::vector<Instance> seen;
    for (const Figure& f : figures) seen.push_back(box_instance(f.box, kScene.size));
    if (i % 5 == 4) seen.erase(seen.begin());
    front_end.compute_mask(kScene.frame(time_of(i), figures),
                           i % 8 == 5 ? Segmentation() : result(seen));
    const std::vector<DynamicObject> early = front_end.objects();
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.translation().y() = 1;  // the host's own origin
    front_end.correct_pose(T);
    const auto& objects = front_end.objects();
    EXPECT_EQ(objects.size(), 2u) << i;
    EXPECT_EQ(early.size(), 2u);
    if (objects.size() != 2 || early.size() != 2) break;
    for (const DynamicObject& o : objects) {
      EXPECT_EQ(o.id, o.depth_m > 2.7f ? 0 : 1) << i;
      predicted += o.predicted;
      EXPECT_TRUE(o.in_world && o.in_camera);
      if (!o.in_world || !o.in_camera) break;
      EXPECT_NEAR((o.in_world->centroid_m - o.in_camera->centroid_m).y(), 1, 1e-6);
      EXPECT_EQ(o.mask.size(), o.box.size());
      EXPECT_EQ(o.unseen_s > 0, o.predicted);
    }
    // By the pose told for the frame before, and the motion since.
    EXPECT_EQ(i > 0 && settings.use_motion, early[0].in_world.has_value());
    if (i > 20 && i < 32 && objects[0].id == 0) {  // then he is hidden
      EXPECT_NEAR(objects[0].in_world->velocity_m_s.x(), 3 * 30 * 3 / kScene.camera().fx, 0.1);
    }
  }
  return predicted;
}

TEST(FrontEndObjects, KeepIdsThroughMisses) {
  EXPECT_GT(predicted_through_misses(FrontEndSettings::network_only()), 5);
}

TEST(FrontEndObjects, KeepIdsWhoseMissesAreFoundByTheirMotion) {
  EXPECT_LE(predicted_through_misses({}), 5);
}

TEST(FrontEndObjects, BehindASlowSegmenterAreSeenWhenItsFrameShowsThem) {
  // Every third frame has the result of the frame 0.1 s before.
  FrontEnd front_end(FrontEndSettings::network_only(), kScene.camera());
  for (int i = 0; i < 60; ++i) {
    Segmentation late;
    if (i > 0 && i % 3 == 0) {
      late = result({box_instance(person_at(20 + 3 * (i - 3)).box, kScene.size)});
      late.timestamp = time_of(i - 3);
    }
    front_end.compute_mask(kScene.frame(time_of(i), {person_at(20 + 3 * i)}), late);
    if (i < 3) continue;
    ASSERT_EQ(front_end.objects().size(), 1u) << i;
    const DynamicObject& object = front_end.objects().front();
    EXPECT_EQ(object.id, 0) << i;
    EXPECT_NEAR(object.unseen_s, 0.1 + i % 3 / 30.0, 1e-6) << i;
    EXPECT_NEAR(object.tracked_s, i / 30.0, 1e-6) << i;
  }
}

TEST(FrontEndObjects, MovesWithTheFrontEnd) {
  FrontEnd first({}, kScene.camera());
  first.compute_mask(kScene.frame(time_of(0), {person_at(40)}),
                     result({box_instance(person_at(40).box, kScene.size)}));
  FrontEnd moved = std::move(first);
  ASSERT_EQ(moved.objects().size(), 1u);
  EXPECT_TRUE(identical(moved.mended_mask(), moved.raw_mask()));
}

TEST(FrontEndTracked, DropsAPointBeforeItIsInTheMask) {
  FrontEndSettings settings;
  settings.probability.min_kept = 0;
  settings.probability.radius_px = 0;  // the mask alone decides
  FrontEnd front_end(settings, kScene.camera());
  // The person walks to the right, 6 pixels a frame; two points of the wall, one in his way.
  int selected = -1, tracked = -1, entering = 0;
  const std::vector<cv::Point2f> points{{200, 100}, {60, 30}};
  for (int i = 0; i < 30; ++i) {
    const Figure person = person_at(30 + 6 * i);
    front_end.compute_mask(kScene.frame(time_of(i), {person}),
                           result({box_instance(person.box, kScene.size)}));
    const bool plain = front_end.select(points).is_kept(0);
    const Selection& selection = front_end.select_tracked(points, points);
    EXPECT_TRUE(i == 0 || selection.is_kept(1));
    if (!plain && selected < 0) selected = i;
    if (!selection.is_kept(0) && tracked < 0) tracked = i;
    entering += selection.reason[0] == KeypointReason::kEntering;
    EXPECT_EQ(static_cast<std::size_t>(front_end.stats().kept), selection.kept.size());
    EXPECT_FALSE(selection.is_kept(0) && !plain) << "never more than select()";
  }
  EXPECT_GT(selected, 5);
  EXPECT_EQ(tracked, selected - 1) << "one frame before";
  EXPECT_EQ(entering, 1);
}

TEST(FrontEndTracked, KnowsThePointsOwnMotionAndKeepsTheFloor) {
  FrontEndSettings settings;
  settings.probability.min_kept = 0;
  settings.probability.radius_px = 0;
  FrontEnd front_end(settings, kScene.camera());
  const Figure person = person_at(140);
  const auto seen = result({box_instance(person.box, kScene.size)});
  for (int i = 0; i < 3; ++i) front_end.compute_mask(kScene.frame(time_of(i), {person}), seen);
  // Left of the mask, which begins at 140 - 5: towards it, away from it, and new.
  const float x = 130, nan = std::nanf("");
  const std::vector<cv::Point2f> now{{x, 100}, {x, 100}, {x, 100}};
  const std::vector<cv::Point2f> before{{x - 8, 100}, {x + 4, 100}, {nan, nan}};
  EXPECT_EQ(front_end.select_tracked(now, before).kept, (std::vector<int>{1, 2}));
  EXPECT_EQ(front_end.select_tracked(now, now).kept, (std::vector<int>{0, 1, 2})) << "all stay";
  const std::vector<cv::Point2f> one{{1, 1}};
  EXPECT_ERROR(front_end.select_tracked(now, one), "one point for each of now, 3, found 1");

  settings.probability.min_kept = 3;
  FrontEnd with_floor(settings, kScene.camera());
  for (int i = 0; i < 3; ++i) with_floor.compute_mask(kScene.frame(time_of(i), {person}), seen);
  EXPECT_EQ(with_floor.select_tracked(now, before).kept.size(), 3u);
}

}  // namespace
}  // namespace stillpoint
