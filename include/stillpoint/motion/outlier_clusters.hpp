// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <opencv2/core.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "stillpoint/core/depth_view.hpp"
#include "stillpoint/motion/corner_image.hpp"
#include "stillpoint/motion/flow_consensus.hpp"
#include "stillpoint/motion/patch_shift.hpp"

namespace stillpoint {

/// A corner that moves otherwise than the camera says, with others around it that do so too.
struct OutlierCorner {
  /// Where it is in the new frame, raw pixels; its depth, and how far off it is in space, metres.
  float u, v, depth_m, off_m;
};

namespace detail {

/// Finds such corners among those that were followed from one frame to the next.
class OutlierClusters {
 public:
  /// The corners in clusters that move otherwise than a motion says, and than another one if there
  /// is one: off by over 1.3 pixels (of 640 in a row), four times the median by area, and, of their
  /// own displacement, `smeared_share` (shutter) and four times the median share, at most 0.12; and
  /// by 4 mm in space, which counts within 1.6 m. With at least four others within 0.3 m that move
  /// alike, and more than do not. None lies at an edge of `depth`, that of the frame they were
  /// followed into. O(corners squared).
  const std::vector<OutlierCorner>& find(const std::vector<Flow>& flows, const CornerImage& now,
                                         const DepthView& depth,
                                         const Eigen::Isometry3d& T_current_last,
                                         const std::optional<Eigen::Isometry3d>& another,
                                         double smeared_share) {
    outliers_.clear();
    if (flows.empty()) return outliers_;
    const float limit_another = another ? measure(flows, now, *another, other_errors_) : 0;
    const float limit = measure(flows, now, T_current_last, errors_);
    const float blurred_share =
        kTimesMedian * median_by_area(flows, [&](std::size_t i) {
          return errors_[i].norm() / std::max(1.0f, length_px(flows[i], now));
        });
    const float per_px =
        std::max(std::min(blurred_share, kMostBlurred), static_cast<float>(smeared_share));
    sizes_.clear();
    for (std::size_t i = 0; i < flows.size(); ++i) sizes_.push_back(size_of(flows[i], errors_[i]));
    for (std::size_t i = 0; i < flows.size(); ++i) {
      const Flow& f = flows[i];
      const float size = sizes_[i];
      const float not_noise =
          std::max({limit, per_px * length_px(f, now), kLeastOutlierM * now.fx / f.depth_m});
      if (size < not_noise || (another && size_of(f, other_errors_[i]) < limit_another) ||
          !is_smooth(f, now, depth))
        continue;
      int with = 0, against = 0;
      for (std::size_t j = 0; j < flows.size(); ++j) {
        if ((f.from - flows[j].from).squaredNorm() > kClusterM * kClusterM) continue;
        if ((errors_[i] - errors_[j]).norm() > 0.5f * size)
          ++against;
        else if (sizes_[j] >= limit && !same_patch(f, flows[j]))
          ++with;
      }
      if (with >= kFewestWith && with > against)
        outliers_.push_back({f.u, f.v, f.depth_m, size * f.depth_m / now.fx});
    }
    return outliers_;
  }

 private:
  static constexpr float kLeastOutlierPx = 0.65f;  // fine pixels
  // The camera's motion is off by millimetres: before a wall far away a small displacement looks
  // like a rotation. That shows in what is close by.
  static constexpr float kLeastOutlierM = 0.004f;
  static constexpr float kClusterM = 0.3f;
  static constexpr int kFewestWith = 4;
  static constexpr float kTimesMedian = 4;
  // What is blurred is followed ill, in parts of its displacement; no more than this is taken for
  // blur, as in an image full of people the median is theirs.
  static constexpr float kMostBlurred = 0.12f;

  // Fills the errors, pixels; returns from which on one is not just noise.
  float measure(const std::vector<Flow>& flows, const CornerImage& now,
                const Eigen::Isometry3d& T_current_last, std::vector<Eigen::Vector2f>& errors) {
    const Eigen::Matrix3f R = T_current_last.linear().cast<float>();
    const Eigen::Vector3f t = T_current_last.translation().cast<float>();
    errors.clear();
    for (const Flow& f : flows) errors.push_back(error_px(f, now, R * f.from + t));
    const float median = median_by_area(flows, [&](std::size_t i) { return errors[i].norm(); });
    return std::max(kLeastOutlierPx * static_cast<float>(now.scale), kTimesMedian * median);
  }

  // The median by area of a value of each flow: people close by may have most of the corners.
  template <class Value>
  float median_by_area(const std::vector<Flow>& flows, Value&& value) {
    sorted_.clear();
    float half = 0;
    for (std::size_t i = 0; i < flows.size(); ++i) {
      sorted_.emplace_back(value(i), flows[i].area);
      half += 0.5f * flows[i].area;
    }
    std::sort(sorted_.begin(), sorted_.end());
    std::size_t median = 0;
    while (median + 1 < sorted_.size() && (half -= sorted_[median].second) > 0) ++median;
    return sorted_[median].first;
  }

  static Eigen::Vector2f error_px(const Flow& f, const CornerImage& now, const Eigen::Vector3f& q) {
    if (q.z() < CornerImage::kLeastDepthM) return {1e6f, 1e6f};
    return now.project(q) - Eigen::Vector2f(f.flat_u, f.flat_v);
  }

  // The size of a flow's error, as far as its patch can tell (Mahalanobis distance).
  static float size_of(const Flow& f, const Eigen::Vector2f& error) {
    return std::sqrt(std::max(0.0f, error.dot(f.information * error)));
  }

  // Its displacement in the image.
  static float length_px(const Flow& f, const CornerImage& now) {
    const float du = f.u - now.frame_px(f.x), dv = f.v - now.frame_px(f.y);
    return std::sqrt(du * du + dv * dv);
  }

  // No depth edge in all of its patch.
  static bool is_smooth(const Flow& f, const CornerImage& now, const DepthView& depth) {
    return f.depth_m > 0 && now.is_even(depth, f.nearest_pixel(), f.depth_m);
  }

  static bool same_patch(const Flow& a, const Flow& b) {
    return std::abs(a.x - b.x) <= Patch::kRadius && std::abs(a.y - b.y) <= Patch::kRadius;
  }

  std::vector<Eigen::Vector2f> errors_, other_errors_;
  std::vector<float> sizes_;                     // of errors_
  std::vector<std::pair<float, float>> sorted_;  // value and area
  std::vector<OutlierCorner> outliers_;
};

}  // namespace detail
}  // namespace stillpoint
