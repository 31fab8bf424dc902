// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <nanoflann.hpp>
#include <opencv2/core.hpp>
#include <vector>

#include "stillpoint/keypoints/grid_neighbor_search.hpp"

namespace stillpoint {

/// Radius search in a k-d tree of nanoflann; fulfils the concept written at GridNeighborSearch and
/// gives the same neighbors.
///
/// nanoflann finds the candidates within a slightly larger radius, in float; within_radius()
/// decides. build() is O(n log n) and allocates, a query O(log n + candidates). Not thread-safe;
/// two objects may be used from two threads.
class NanoflannNeighborSearch {
 public:
  void build(const std::vector<cv::Point2f>& points, float radius) {
    points_ = &points;
    radius_ = radius;
    // Wide enough for every rounding of squares and sums in float, and for a radius of 0.
    const double squared = static_cast<double>(radius) * radius * 1.0001 + 1e-20;
    candidate_radius_ = static_cast<float>(
        std::min(squared, static_cast<double>(std::numeric_limits<float>::max())));
    if (!tree_) tree_ = std::make_unique<Tree>();
    tree_->cloud.points = &points;
    if (!points.empty()) tree_->index.buildIndex();
  }

  template <class Visit>
  void for_each_neighbor(const cv::Point2f& query, Visit&& visit) {
    if (!tree_ || points_->empty() || !(radius_ >= 0)) return;
    if (!std::isfinite(query.x) || !std::isfinite(query.y)) return;
    const float coordinates[] = {query.x, query.y};
    const auto take = [&](std::size_t i) {
      if (within_radius(query, (*points_)[i], radius_)) visit(static_cast<int>(i));
    };
    Candidates<decltype(take)> candidates{candidate_radius_, take};
    tree_->index.radiusSearchCustomCallback(coordinates, candidates);
  }

  int count_neighbors(const cv::Point2f& query) {
    int count = 0;
    for_each_neighbor(query, [&](int) { ++count; });
    return count;
  }

 private:
  struct Cloud {
    std::size_t kdtree_get_point_count() const { return points ? points->size() : 0; }
    float kdtree_get_pt(std::size_t i, std::size_t axis) const {
      return axis == 0 ? (*points)[i].x : (*points)[i].y;
    }
    template <class Box>
    bool kdtree_get_bbox(Box&) const {
      return false;  // nanoflann finds it
    }
    const std::vector<cv::Point2f>* points = nullptr;
  };
  using Index =
      nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, Cloud>, Cloud, 2>;
  // On the heap, because the index keeps a reference to the cloud: the search object can be moved.
  struct Tree {
    Cloud cloud;
    Index index{2, cloud, nanoflann::KDTreeSingleIndexAdaptorParams(10)};
  };

  // What nanoflann expects of a result set.
  template <class Take>
  struct Candidates {
    using DistanceType = float;
    using IndexType = std::size_t;
    float squared_radius;
    const Take& take;
    std::size_t count = 0;

    template <class I>
    bool addPoint(float squared_distance, I index) {
      if (squared_distance <= squared_radius) {
        ++count;
        take(static_cast<std::size_t>(index));
      }
      return true;
    }
    float worstDist() const { return squared_radius; }
    bool full() const { return true; }
    bool empty() const { return count == 0; }
    std::size_t size() const { return count; }
    void sort() {}
  };

  const std::vector<cv::Point2f>* points_ = nullptr;
  float radius_ = 0, candidate_radius_ = 0;
  std::unique_ptr<Tree> tree_;
};

}  // namespace stillpoint
