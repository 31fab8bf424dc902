// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/keypoints/probabilistic_keypoint_filter.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numeric>

#include "../io/temporary_folder.hpp"
#include "stillpoint/core/random.hpp"

/// A host's own keypoint.
struct HostKeypoint {
  double row = 0, column = 0;
  int id = 0;
};

template <>
struct stillpoint::KeypointTraits<HostKeypoint> {
  static float x(const HostKeypoint& k) { return static_cast<float>(k.column); }
  static float y(const HostKeypoint& k) { return static_cast<float>(k.row); }
};

namespace {

using namespace stillpoint;
using Points = std::vector<cv::Point2f>;
using Settings = KeypointFilterSettings;

// The simplest thing that fulfils the concept.
class SlowNeighborSearch {
 public:
  void build(const Points& points, float radius) { points_ = &points, radius_ = radius; }
  template <class Visit>
  void for_each_neighbor(const cv::Point2f& query, Visit&& visit) const {
    for (std::size_t i = points_->size(); i-- > 0;)
      if (within_radius(query, (*points_)[i], radius_)) visit(static_cast<int>(i));
  }
  int count_neighbors(const cv::Point2f& query) const {
    int n = 0;
    for_each_neighbor(query, [&n](int) { ++n; });
    return n;
  }

 private:
  const Points* points_ = nullptr;
  float radius_ = 0;
};

DynamicMask mask_of(const std::vector<cv::Rect>& boxes, cv::Size size = {640, 480}) {
  DynamicMask mask;
  mask.image = cv::Mat::zeros(size, CV_8UC1);
  for (const cv::Rect& box : boxes) mask.image(box).setTo(255);
  return mask;
}

// Crowded in some places, sparse in others, as corners are.
Points random_points(std::size_t n, std::uint64_t seed, cv::Size size = {640, 480}) {
  RandomGenerator random(seed);
  Points points;
  for (std::size_t i = 0; i < n; ++i) {
    cv::Point2f p(static_cast<float>(random.uniform() * (size.width - 1)),
                  static_cast<float>(random.uniform() * (size.height - 1)));
    if (i % 3 == 1)
      p = points.back() + cv::Point2f(static_cast<float>(6 * random.uniform() - 3),
                                      static_cast<float>(6 * random.uniform() - 3));
    p.x = std::min(std::max(p.x, 0.0f), static_cast<float>(size.width - 1));
    p.y = std::min(std::max(p.y, 0.0f), static_cast<float>(size.height - 1));
    points.push_back(p);
  }
  return points;
}

// Section 3.3 word by word, in double precision; points inside the image only.
std::vector<double> by_definition(const Points& points, const DynamicMask& mask,
                                  const Settings& s) {
  std::vector<double> predefined, probability;
  for (const cv::Point2f& p : points)
    predefined.push_back(
        mask.image.at<uchar>(static_cast<int>(std::lround(p.y)), static_cast<int>(std::lround(p.x)))
            ? 1
            : 0);
  for (std::size_t i = 0; i < points.size(); ++i) {
    double sum = 0;
    int n = 0;
    for (std::size_t k = 0; k < points.size(); ++k) {
      if (k == i || !within_radius(points[i], points[k], s.radius_px)) continue;
      const double r = std::hypot(static_cast<double>(points[i].x) - points[k].x,
                                  static_cast<double>(points[i].y) - points[k].y);
      sum += s.weight * std::exp(-static_cast<double>(s.decay_per_px) * r) * predefined[k];
      ++n;
    }
    probability.push_back(predefined[i] > 0 ? 1 : n == 0 ? 0 : std::min(1.0, sum / n));
  }
  return probability;
}

template <class Search>
class KeypointFilter : public ::testing::Test {};

struct SearchName {
  template <class Search>
  static std::string GetName(int) {
    return std::is_same<Search, GridNeighborSearch>::value ? "Grid" : "Slow";
  }
};
using Searches = ::testing::Types<GridNeighborSearch, SlowNeighborSearch>;
TYPED_TEST_SUITE(KeypointFilter, Searches, SearchName);

TYPED_TEST(KeypointFilter, IsThePapersFormula) {
  std::vector<Settings> all(7);
  all[1].radius_px = 45, all[1].decay_per_px = 0.01f, all[1].threshold = 0.4f;
  all[2].weight = 3;  // clamped at 1
  all[3].decay_per_px = 0;
  all[4].radius_px = 3, all[4].threshold = 0;
  all[5].radius_px = 200, all[6].radius_px = 640;
  int probable = 0, clamped = 0;
  for (Settings& settings : all) {
    settings.min_kept = 0;
    ProbabilisticKeypointFilter<TypeParam> filter(settings);
    for (std::uint64_t seed = 1; seed <= 4; ++seed) {
      const Points points = random_points(seed == 4 ? 40 : 1200, seed);
      const DynamicMask mask = mask_of({{100, 80, 130, 300}, {400, 200, 60, 60}});
      const std::vector<double> expected = by_definition(points, mask, settings);
      const Selection& found = filter.filter(points, mask);
      ASSERT_EQ(found.size(), points.size());
      double error = 0;
      for (std::size_t i = 0; i < points.size(); ++i) {
        // The weight is read from a table: a percent at distances under a pixel.
        ASSERT_NEAR(found.probability[i], expected[i], 0.012 * settings.weight) << i;
        error += std::abs(found.probability[i] - expected[i]);
        if (std::abs(expected[i] - settings.threshold) > 0.012 * settings.weight) {
          EXPECT_EQ(found.is_kept(i), expected[i] <= settings.threshold) << i;
        }
        probable += found.reason[i] == KeypointReason::kProbable;
        clamped += expected[i] == 1 && found.reason[i] == KeypointReason::kProbable;
      }
      EXPECT_LT(error / static_cast<double>(points.size()), 2e-4);
    }
  }
  EXPECT_GT(probable, 200) << "the test must try what it is for";
  EXPECT_GT(clamped, 5);
}

TYPED_TEST(KeypointFilter, TakesCoincidentKeypointsAsNeighbors) {
  // Two keypoints at one place, as two pyramid levels give them, outside the mask; both see the
  // one in the mask, and each the other.
  Settings settings;
  settings.decay_per_px = 0, settings.threshold = 0.5f, settings.min_kept = 0;
  ProbabilisticKeypointFilter<TypeParam> filter(settings);
  const Points points{{100, 100}, {100, 100}, {95, 100}};
  const Selection& found = filter.filter(points, mask_of({{90, 90, 8, 20}}));
  EXPECT_EQ(found.probability, (std::vector<float>{0.5f, 0.5f, 1}));
  EXPECT_EQ(found.kept, (std::vector<int>{0, 1}));
}

TYPED_TEST(KeypointFilter, DoesNotDependOnTheOrder) {
  Points points = random_points(800, 5);
  const DynamicMask mask = mask_of({{100, 80, 130, 300}});
  ProbabilisticKeypointFilter<TypeParam> filter;
  const Selection forwards = filter.filter(points, mask);
  std::reverse(points.begin(), points.end());
  Selection backwards = filter.filter(points, mask);
  std::reverse(backwards.probability.begin(), backwards.probability.end());
  EXPECT_EQ(forwards.probability, backwards.probability);
}

using Filter = ProbabilisticKeypointFilter<>;

TEST(KeypointFilter, EqualityCountsAsStatic) {
  Settings settings;
  settings.decay_per_px = 0, settings.min_kept = 0;
  // One of two neighbors is in the mask: P = 1/2 exactly.
  const Points points{{50, 50}, {55, 50}, {45, 50}};
  const DynamicMask mask = mask_of({{54, 40, 20, 20}});
  settings.threshold = 0.5f;
  Filter equal(settings);
  EXPECT_EQ(equal.filter(points, mask).reason[0], KeypointReason::kStatic);
  EXPECT_EQ(equal.filter(points, mask).probability[0], 0.5f);
  settings.threshold = 0.49f;
  Filter below(settings);
  EXPECT_EQ(below.filter(points, mask).reason[0], KeypointReason::kProbable);
}

TEST(KeypointFilter, IsStaticWithoutNeighbors) {
  Settings settings;
  settings.radius_px = 10, settings.min_kept = 0;
  Filter filter(settings);
  // 11 px beside the mask's keypoint, and 1 px beside the mask but with no keypoint near.
  const Selection& found =
      filter.filter(Points{{100, 100}, {89, 100}, {119, 140}}, mask_of({{90, 90, 28, 60}}));
  EXPECT_EQ(found.probability, (std::vector<float>{1, 0, 0}));
  EXPECT_EQ(found.reason[0], KeypointReason::kInMask);
  EXPECT_EQ(found.reason[2], KeypointReason::kStatic);
}

TEST(KeypointFilter, MaskAloneDecidesWhenAsked) {
  const Points points = random_points(1000, 7);
  const DynamicMask mask = mask_of({{100, 80, 130, 300}});
  Filter filter;
  const Selection& found = filter.filter(points, mask, false);
  for (std::size_t i = 0; i < points.size(); ++i)
    EXPECT_EQ(found.probability[i], mask.dynamic_at(points[i].x, points[i].y) ? 1 : 0);
}

TEST(KeypointFilter, WithoutAMaskEverythingStays) {
  Points points = random_points(100, 8);
  points[3] = {1e6f, 20};  // no mask, no image: only numbers count
  points[4] = {std::numeric_limits<float>::quiet_NaN(), 20};
  Filter filter;
  EXPECT_EQ(filter.filter(points, DynamicMask()).kept.size(), 99u);
  EXPECT_EQ(filter.filter(random_points(100, 8), mask_of({})).kept.size(), 100u);
  EXPECT_EQ(filter.status(), kOk);
}

TEST(KeypointFilter, KeepsTheLeastDynamicUpToTheFloor) {
  Settings settings;
  settings.min_kept = 30;
  settings.threshold = 0.1f;
  Filter filter(settings);
  // Nearly all in the mask, some beside it.
  const Points points = random_points(200, 9, {200, 100});
  const DynamicMask mask = mask_of({{0, 0, 190, 100}}, {200, 100});
  settings.min_kept = 0;
  Filter without(settings);
  const Selection strict = without.filter(points, mask);
  EXPECT_EQ(without.status(), kOk);
  ASSERT_LT(strict.kept.size(), 30u);

  const Selection& found = filter.filter(points, mask);
  EXPECT_EQ(filter.status(), kKeypointFloor);
  EXPECT_EQ(found.kept.size(), 30u);
  EXPECT_TRUE(std::is_sorted(found.kept.begin(), found.kept.end()));
  EXPECT_EQ(found.probability, strict.probability) << "probabilities stay what they are";
  float worst_kept = 0, best_removed = 1;
  for (std::size_t i = 0; i < points.size(); ++i) {
    EXPECT_EQ(found.is_kept(i),
              std::binary_search(found.kept.begin(), found.kept.end(), static_cast<int>(i)));
    if (strict.is_kept(i)) {
      EXPECT_EQ(found.reason[i], KeypointReason::kStatic);
    }
    if (found.is_kept(i))
      worst_kept = std::max(worst_kept, found.probability[i]);
    else
      best_removed = std::min(best_removed, found.probability[i]);
  }
  EXPECT_LE(worst_kept, best_removed);
}

TEST(KeypointFilter, FloorTakesAllThereAreAndNothingOutside) {
  Filter filter;  // floor 50
  Points points(20, {50, 50});
  points.push_back({-10, 50});
  const Selection& found = filter.filter(points, mask_of({{0, 0, 640, 480}}));
  EXPECT_EQ(found.kept.size(), 20u);
  EXPECT_EQ(found.reason[20], KeypointReason::kOutsidePicture);
  EXPECT_EQ(filter.status(), kKeypointFloor);
  // Few keypoints, none dynamic: nothing was forced.
  filter.filter(points, mask_of({}));
  EXPECT_EQ(filter.status(), kOk);
}

TEST(KeypointFilter, SaysThatThereAreNoKeypoints) {
  Filter filter;
  const Selection& found = filter.filter(Points(), mask_of({{10, 10, 20, 20}}));
  EXPECT_EQ(found.size(), 0u);
  EXPECT_TRUE(found.kept.empty());
  EXPECT_EQ(filter.status(), kNoKeypoints);
  filter.filter(Points{{3, 3}}, mask_of({}));
  EXPECT_EQ(filter.status(), kOk);
}

TEST(KeypointFilter, RemovesKeypointsOutsideThePicture) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float infinity = std::numeric_limits<float>::infinity();
  const Points outside{{-0.6f, 10}, {10, -0.6f},    {639.5f, 10},    {10, 479.5f},  {nan, 10},
                       {10, nan},   {infinity, 10}, {10, -infinity}, {1e30f, 1e30f}};
  Points points = outside;
  points.push_back({-0.5f, -0.5f});
  points.push_back({639.4f, 479.4f});
  Filter filter;
  const Selection& found = filter.filter(points, mask_of({{0, 0, 640, 480}}));
  for (std::size_t i = 0; i < outside.size(); ++i) {
    EXPECT_EQ(found.reason[i], KeypointReason::kOutsidePicture) << i;
    EXPECT_EQ(found.probability[i], 1);
  }
  EXPECT_EQ(found.kept, (std::vector<int>{9, 10})) << "the floor keeps those in the image";
}

// 0.49999997 + 0.5 is 1 in single precision: no pixel of an image one wide.
TEST(ProbabilisticKeypointFilter, StaysInsideAnImageOfOnePixel) {
  stillpoint::DynamicMask mask;
  mask.image = cv::Mat(3, 3, CV_8UC1, cv::Scalar(0))(cv::Rect(0, 0, 1, 1));
  mask.image.setTo(255);
  const float last = std::nextafter(0.5f, 0.0f);
  EXPECT_TRUE(mask.dynamic_at(last, last));
  stillpoint::ProbabilisticKeypointFilter<> filter;
  EXPECT_EQ(filter.filter(std::vector<cv::Point2f>{{last, last}}, mask).probability[0], 1);
}

TEST(KeypointFilter, OutsideKeypointsAreNobodysNeighbors) {
  Settings settings;
  settings.decay_per_px = 0, settings.threshold = 0.9f, settings.min_kept = 0;
  Filter filter(settings);
  // Of the neighbors only the one in the mask is in the image: P = 1.
  const Selection& found =
      filter.filter(Points{{2, 2}, {8, 2}, {-3, 2}, {2, -3}}, mask_of({{6, 0, 10, 10}}));
  EXPECT_EQ(found.probability[0], 1);
}

TEST(KeypointFilter, ReadsAnyKeypoint) {
  const Points points = random_points(300, 11);
  std::vector<cv::KeyPoint> cv_keypoints;
  std::vector<HostKeypoint> host_keypoints;
  for (const cv::Point2f& p : points) {
    cv_keypoints.emplace_back(p, 31.0f);
    host_keypoints.push_back({p.y, p.x, 0});
  }
  const DynamicMask mask = mask_of({{100, 80, 130, 300}});
  Filter filter;
  const Selection expected = filter.filter(points, mask);
  EXPECT_EQ(filter.filter(cv_keypoints, mask).probability, expected.probability);
  EXPECT_EQ(filter.filter(host_keypoints, mask).probability, expected.probability);
  const std::vector<cv::Point2d> doubles(points.begin(), points.end());
  EXPECT_EQ(filter.filter(doubles, mask).probability, expected.probability);
}

TEST(KeypointFilter, ForgetsTheLastFrame) {
  const DynamicMask mask = mask_of({{100, 80, 130, 300}});
  const Points points = random_points(700, 12);
  Filter fresh, used;
  used.filter(random_points(3000, 13), mask_of({{0, 0, 640, 400}}));
  used.filter(Points(), mask_of({}));
  const Selection &a = fresh.filter(points, mask), &b = used.filter(points, mask);
  EXPECT_EQ(a.probability, b.probability);
  EXPECT_EQ(a.kept, b.kept);
}

TEST(KeypointFilter, TakesRadiusZeroAndHugeRadius) {
  const Points points = random_points(300, 14);
  const DynamicMask mask = mask_of({{100, 80, 130, 300}});
  for (const float radius : {0.0f, 1e-3f, 5000.0f}) {
    Settings settings;
    settings.radius_px = radius;
    Filter filter(settings);
    const Selection& found = filter.filter(points, mask);
    const std::vector<double> expected = by_definition(points, mask, settings);
    // So wide a table is coarse: here only that it is sane.
    for (std::size_t i = 0; i < points.size(); ++i)
      ASSERT_NEAR(found.probability[i], expected[i], radius > 1000 ? 0.2 : 1e-6);
  }
}

TEST(KeypointFilter, RefusesSettingsWithoutSense) {
  const float bad_values[] = {-1, std::numeric_limits<float>::quiet_NaN(),
                              std::numeric_limits<float>::infinity()};
  for (const float bad : bad_values) {
    Settings s;
    s.radius_px = bad;
    EXPECT_ERROR(Filter{s}, "KeypointFilterSettings.radius_px", "expected", "found");
    s = Settings(), s.weight = bad;
    EXPECT_ERROR(Filter{s}, "KeypointFilterSettings.weight");
    s = Settings(), s.decay_per_px = bad;
    EXPECT_ERROR(Filter{s}, "KeypointFilterSettings.decay_per_px");
    s = Settings(), s.threshold = bad;
    EXPECT_ERROR(Filter{s}, "KeypointFilterSettings.threshold");
  }
  Settings s;
  s.min_kept = -1;
  EXPECT_ERROR(Filter{s}, "KeypointFilterSettings.min_kept", "found -1");
}

TEST(KeypointFilter, RefusesOtherMasks) {
  DynamicMask mask;
  mask.image = cv::Mat::zeros(4, 4, CV_8UC3);
  Filter filter;
  EXPECT_ERROR(filter.filter(Points{{1, 1}}, mask), "mask.image", "CV_8UC1", "found CV_8UC3");
}

TEST(KeypointFilter, PaperPresetHasNoFloor) {
  Filter filter(Settings::paper());
  const Points points(20, {50, 50});
  EXPECT_TRUE(filter.filter(points, mask_of({{0, 0, 640, 480}})).kept.empty());
  EXPECT_EQ(filter.status(), kOk);
}

}  // namespace
