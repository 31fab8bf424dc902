// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <opencv2/core.hpp>
#include <string>
#include <utility>
#include <vector>

#include "stillpoint/core/random.hpp"
#include "stillpoint/keypoints/grid_neighbor_search.hpp"
#include "stillpoint/keypoints/probabilistic_keypoint_filter.hpp"

/// Runs the conformance suite of neighbor searches (the concept is written at GridNeighborSearch)
/// over `Search`, in a GoogleTest program:
///
///     #include "stillpoint/testing/neighbor_search_conformance.hpp"
///     STILLPOINT_TEST_NEIGHBOR_SEARCH(Mine, MyNeighborSearch)
#define STILLPOINT_TEST_NEIGHBOR_SEARCH(prefix, Search)                                       \
  INSTANTIATE_TYPED_TEST_SUITE_P(prefix, NeighborSearchConformance, ::testing::Types<Search>, \
                                 ::stillpoint::testing::NeighborSearchName)

namespace stillpoint {
namespace testing {

struct NeighborSearchName {
  template <class Search>
  static std::string GetName(int i) {
    return std::to_string(i);
  }
};

/// All indices that a search reports, ascending; one that comes twice stays twice.
template <class Search>
std::vector<int> found_neighbors(Search& search, const cv::Point2f& query) {
  std::vector<int> found;
  search.for_each_neighbor(query, [&](int i) { found.push_back(i); });
  std::sort(found.begin(), found.end());
  return found;
}

/// The neighbors by definition, ascending. O(points).
inline std::vector<int> expected_neighbors(const std::vector<cv::Point2f>& points,
                                           const cv::Point2f& query, float radius) {
  std::vector<int> expected;
  for (std::size_t i = 0; i < points.size(); ++i)
    if (within_radius(query, points[i], radius)) expected.push_back(static_cast<int>(i));
  return expected;
}

/// `n` points in an image: every second one at whole pixels (many at exactly the same distance),
/// the others between.
inline std::vector<cv::Point2f> conformance_points(std::size_t n, int width, int height,
                                                   std::uint64_t seed) {
  RandomGenerator random(seed);
  std::vector<cv::Point2f> points;
  for (std::size_t i = 0; i < n; ++i) {
    const double x = random.uniform() * (width - 1), y = random.uniform() * (height - 1);
    points.emplace_back(static_cast<float>(i % 2 ? x : std::floor(x)),
                        static_cast<float>(i % 2 ? y : std::floor(y)));
  }
  return points;
}

template <class Search>
class NeighborSearchConformance : public ::testing::Test {
 protected:
  void expect_exact(const std::vector<cv::Point2f>& points, float radius,
                    const std::vector<cv::Point2f>& queries) {
    search_.build(points, radius);
    for (const cv::Point2f& query : queries) {
      const std::vector<int> expected = expected_neighbors(points, query, radius);
      ASSERT_EQ(found_neighbors(search_, query), expected)
          << points.size() << " points, radius " << radius << ", query (" << query.x << ", "
          << query.y << ")";
      ASSERT_EQ(search_.count_neighbors(query), static_cast<int>(expected.size()));
    }
  }

  Search search_;
};

TYPED_TEST_SUITE_P(NeighborSearchConformance);

TYPED_TEST_P(NeighborSearchConformance, FindsNothingAmongNoPoints) {
  const std::vector<cv::Point2f> none;
  this->search_.build(none, 20);
  EXPECT_TRUE(found_neighbors(this->search_, {3, 4}).empty());
}

TYPED_TEST_P(NeighborSearchConformance, FindsTheQueryItself) {
  const std::vector<cv::Point2f> one{{12.25f, 7.5f}};
  this->search_.build(one, 1);
  EXPECT_EQ(found_neighbors(this->search_, one[0]), std::vector<int>{0});
  EXPECT_TRUE(found_neighbors(this->search_, {14, 7.5f}).empty());
}

TYPED_TEST_P(NeighborSearchConformance, CountsTheRadiusAsInside) {
  // 3-4-5 and 12-16-20 triangles: exactly on the circle; the next float is outside.
  for (const float s : {1.0f, 4.0f}) {
    const std::vector<cv::Point2f> points{{100 + 3 * s, 100 + 4 * s},
                                          {100 - 4 * s, 100 + 3 * s},
                                          {100, 100 - 5 * s},
                                          {std::nextafter(100 + 5 * s, 1000.0f), 100},
                                          {100 - 5 * s, 100}};
    this->search_.build(points, 5 * s);
    EXPECT_EQ(found_neighbors(this->search_, {100, 100}), (std::vector<int>{0, 1, 2, 4}));
  }
}

TYPED_TEST_P(NeighborSearchConformance, DecidesByTheLastDigit) {
  // Pairs within a rounding error of the radius: squares formed in float decide some wrongly.
  RandomGenerator random(5);
  for (int k = 0; k < 500; ++k) {
    const float radius = 1 + static_cast<float>(30 * random.uniform());
    const double angle = 6.28 * random.uniform();
    const cv::Point2f query(static_cast<float>(640 * random.uniform()),
                            static_cast<float>(480 * random.uniform()));
    const std::vector<cv::Point2f> points{{static_cast<float>(query.x + radius * std::cos(angle)),
                                           static_cast<float>(query.y + radius * std::sin(angle))},
                                          {static_cast<float>(query.x - radius * std::sin(angle)),
                                           static_cast<float>(query.y + radius * std::cos(angle))}};
    this->expect_exact(points, radius, {query});
    if (this->HasFatalFailure()) return;
  }
}

TYPED_TEST_P(NeighborSearchConformance, AtRadiusZeroFindsCoincidentPoints) {
  const std::vector<cv::Point2f> points{{5, 5}, {5, 5.001f}, {5, 5}, {639.5f, 0}};
  this->expect_exact(points, 0, points);
}

TYPED_TEST_P(NeighborSearchConformance, AgreesWithTheDefinitionInAPicture) {
  for (const std::size_t n : {2u, 10u, 300u, 3000u}) {
    const auto points = conformance_points(n, 640, 480, n);
    auto queries = conformance_points(50, 640, 480, 99);
    queries.insert(queries.end(), points.begin(),
                   points.begin() + static_cast<std::ptrdiff_t>(std::min<std::size_t>(n, 100)));
    for (const float radius : {0.5f, 5.0f, 20.0f, 33.3f, 1000.0f})
      this->expect_exact(points, radius, queries);
  }
}

TYPED_TEST_P(NeighborSearchConformance, AgreesOnAGridOfWholePixels) {
  std::vector<cv::Point2f> points;
  for (int y = 0; y < 60; ++y)
    for (int x = 0; x < 60; ++x) points.emplace_back(static_cast<float>(x), static_cast<float>(y));
  this->expect_exact(points, 5, conformance_points(200, 60, 60, 3));
  this->expect_exact(points, 13, conformance_points(100, 60, 60, 4));
}

TYPED_TEST_P(NeighborSearchConformance, TakesCoincidentAndAlignedPoints) {
  this->expect_exact(std::vector<cv::Point2f>(500, {320, 240}), 20, {{320, 240}, {341, 240}});
  std::vector<cv::Point2f> line;
  for (int i = 0; i < 500; ++i) line.emplace_back(static_cast<float>(i), 17.5f);
  this->expect_exact(line, 20, {{0, 17.5f}, {250, 17.5f}, {250, 37.5f}, {499, 0}});
}

TYPED_TEST_P(NeighborSearchConformance, TakesQueriesOutsideThePoints) {
  const auto points = conformance_points(500, 640, 480, 7);
  this->expect_exact(points, 25,
                     {{-20, -20}, {-1000, 240}, {650, 490}, {1e7f, -1e7f}, {320, 504}, {-25, 100}});
}

TYPED_TEST_P(NeighborSearchConformance, TakesALargePicture) {
  const auto points = conformance_points(5000, 7680, 4320, 8);
  this->expect_exact(points, 64, conformance_points(200, 7680, 4320, 9));
}

TYPED_TEST_P(NeighborSearchConformance, ForgetsTheLastPoints) {
  const auto many = conformance_points(1000, 640, 480, 10),
             few = conformance_points(20, 64, 48, 11);
  const std::vector<cv::Point2f> none;
  this->expect_exact(many, 20, few);
  this->expect_exact(few, 3, many);
  this->expect_exact(none, 3, few);
  this->expect_exact(many, 8, few);
}

TYPED_TEST_P(NeighborSearchConformance, CanBeMoved) {
  const auto points = conformance_points(300, 640, 480, 12);
  TypeParam first;
  first.build(points, 20);
  TypeParam second = std::move(first);
  EXPECT_EQ(found_neighbors(second, points[5]), expected_neighbors(points, points[5], 20));
  second.build(points, 30);
  EXPECT_EQ(found_neighbors(second, points[5]), expected_neighbors(points, points[5], 30));
}

TYPED_TEST_P(NeighborSearchConformance, GivesTheFilterTheSameResultAsTheGrid) {
  DynamicMask mask;
  mask.image = cv::Mat::zeros(480, 640, CV_8UC1);
  mask.image(cv::Rect(200, 100, 120, 300)).setTo(255);
  ProbabilisticKeypointFilter<TypeParam> filter;
  ProbabilisticKeypointFilter<GridNeighborSearch> grid;
  for (std::uint64_t seed = 0; seed < 3; ++seed) {
    const auto keypoints = conformance_points(2000, 640, 480, seed);
    const Selection& a = filter.filter(keypoints, mask);
    const Selection& b = grid.filter(keypoints, mask);
    EXPECT_EQ(a.probability, b.probability);
    EXPECT_EQ(a.kept, b.kept);
    EXPECT_TRUE(a.reason == b.reason);
    EXPECT_NE(std::count(a.reason.begin(), a.reason.end(), KeypointReason::kProbable), 0);
  }
}

REGISTER_TYPED_TEST_SUITE_P(NeighborSearchConformance, FindsNothingAmongNoPoints,
                            FindsTheQueryItself, CountsTheRadiusAsInside, DecidesByTheLastDigit,
                            AtRadiusZeroFindsCoincidentPoints, AgreesWithTheDefinitionInAPicture,
                            AgreesOnAGridOfWholePixels, TakesCoincidentAndAlignedPoints,
                            TakesQueriesOutsideThePoints, TakesALargePicture, ForgetsTheLastPoints,
                            CanBeMoved, GivesTheFilterTheSameResultAsTheGrid);

}  // namespace testing
}  // namespace stillpoint
