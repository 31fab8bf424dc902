// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#if !defined(__GXX_RTTI) && !defined(__cpp_rtti)
#error "FLANN's own headers need RTTI; without it use nanoflann or the built-in grid"
#endif

#include <flann/algorithms/dist.h>
#include <flann/algorithms/kdtree_single_index.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <opencv2/core.hpp>
#include <vector>

#include "stillpoint/keypoints/grid_neighbor_search.hpp"

namespace stillpoint {

/// Radius search in a k-d tree of FLANN; fulfils the concept written at GridNeighborSearch and
/// gives the same neighbors.
///
/// FLANN finds the candidates within a slightly larger radius, in float; within_radius() decides.
/// build() is O(n log n), a query O(log n + candidates); both allocate. Not thread-safe; two
/// objects may be used from two threads.
class FlannNeighborSearch {
 public:
  void build(const std::vector<cv::Point2f>& points, float radius) {
    tree_.reset();
    points_ = &points;
    radius_ = radius;
    if (points.empty() || !(radius >= 0)) return;
    // Wide enough for every rounding of squares and sums in float, and for a radius of 0: FLANN
    // takes what is nearer than the radius.
    const double squared = static_cast<double>(radius) * radius * 1.0001 + 1e-20;
    candidate_radius_ = static_cast<float>(
        std::min(squared, static_cast<double>(std::numeric_limits<float>::max())));
    coordinates_.resize(points.size() * 2);
    for (std::size_t i = 0; i < points.size(); ++i) {
      coordinates_[2 * i] = points[i].x;
      coordinates_[2 * i + 1] = points[i].y;
    }
    tree_ = std::make_unique<Tree>(flann::Matrix<float>(coordinates_.data(), points.size(), 2),
                                   flann::KDTreeSingleIndexParams(10));
    tree_->buildIndex();
  }

  template <class Visit>
  void for_each_neighbor(const cv::Point2f& query, Visit&& visit) {
    if (!tree_ || !std::isfinite(query.x) || !std::isfinite(query.y)) return;
    const float coordinates[] = {query.x, query.y};
    const auto take = [&](std::size_t i) {
      if (within_radius(query, (*points_)[i], radius_)) visit(static_cast<int>(i));
    };
    Candidates<decltype(take)> candidates(candidate_radius_, take);
    tree_->findNeighbors(candidates, coordinates, flann::SearchParams(-1, 0, false));
  }

  int count_neighbors(const cv::Point2f& query) {
    int count = 0;
    for_each_neighbor(query, [&](int) { ++count; });
    return count;
  }

 private:
  using Tree = flann::KDTreeSingleIndex<flann::L2_Simple<float>>;

  template <class Take>
  class Candidates : public flann::ResultSet<float> {
   public:
    Candidates(float squared_radius, const Take& take)
        : squared_radius_(squared_radius), take_(take) {}
    bool full() const override { return true; }
    void addPoint(float, std::size_t index) override { take_(index); }
    float worstDist() const override { return squared_radius_; }

   private:
    float squared_radius_;
    const Take& take_;
  };

  const std::vector<cv::Point2f>* points_ = nullptr;
  float radius_ = 0, candidate_radius_ = 0;
  std::vector<float> coordinates_;  // the tree points into it, also after a move
  std::unique_ptr<Tree> tree_;
};

}  // namespace stillpoint
