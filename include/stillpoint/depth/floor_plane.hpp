// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "stillpoint/core/depth_view.hpp"
#include "stillpoint/core/instance.hpp"
#include "stillpoint/core/normal_equations.hpp"
#include "stillpoint/core/random.hpp"

namespace stillpoint {

/// A plane in inverse depth: 1 / z = n . (x, y, 1) with x = (u - cx) / fx, y = (v - cy) / fy.
struct InversePlane {
  Eigen::Vector3f n = Eigen::Vector3f::Zero();  ///< normal over distance, 1/m
  bool found = false;

  /// One over the depth at which the ray (x, y, 1) meets the plane, 1/m.
  float inverse_depth(float x, float y) const { return n.x() * x + n.y() * y + n.z(); }

  /// The same plane after the camera has moved: `T_current_last` maps points of the camera that the
  /// plane was found by into the present one's.
  InversePlane moved(const Eigen::Isometry3d& T_current_last) const {
    const Eigen::Vector3d turned = T_current_last.linear() * n.cast<double>();
    const double scale = 1 + turned.dot(T_current_last.translation());
    if (!found || !(scale > 0)) return {};
    return {(turned / scale).cast<float>(), true};
  }
};

/// A depth sample for find_floor(): ray (x, y, 1) and inverse depth in 1/m.
struct InverseSample {
  float x, y, inverse;
};

/// Takes samples, 28 in a row, outside the instances. O(samples x instances).
inline void collect_floor_samples(const DepthView& depth, const std::vector<Instance>& instances,
                                  std::vector<InverseSample>& samples) {
  samples.clear();
  const cv::Size size = depth.size();
  const int step = std::max(8, size.width / 28);
  for (cv::Point p(0, step / 2); p.y < size.height; p.y += step)
    for (p.x = step / 2; p.x < size.width; p.x += step) {
      const auto covers = [&p](const Instance& s) {
        return s.box.contains(p) && (s.mask.empty() || s.mask.at<uchar>(p - s.box.tl()) != 0);
      };
      const std::uint16_t z = depth.row(p.y)[p.x];
      if (z == 0 || std::any_of(instances.begin(), instances.end(), covers)) continue;
      const Eigen::Vector2f ray = depth.ray(p);
      if (!ray.allFinite()) continue;
      samples.push_back({ray.x(), ray.y(), 1 / depth.to_m(z)});
    }
}

/// Finds the floor among samples by RANSAC: the plane with most samples, less those below it, among
/// those that face the camera from below (camera upright within about 50 degrees, 0.2 to 3 m above
/// the floor). So a table is no floor: the floor is seen below it. `last`, the floor of the last
/// frame, is the first candidate. Was it `carried` along with the camera's motion, a few samples
/// suffice: people hide most of it. Deterministic for a seed. Cost: `trials` times samples.
inline InversePlane find_floor(const std::vector<InverseSample>& samples, const InversePlane& last,
                               std::uint64_t seed, bool carried = false, int trials = 64) {
  InversePlane best;
  const std::size_t n = samples.size();
  if (n < 30) return best;
  const auto tolerance = [](float inverse) { return 0.006f + 0.015f * inverse; };
  RandomGenerator random(seed);
  const int enough = static_cast<int>(n / 8);
  int best_count = carried && last.found ? static_cast<int>(n / 32) : enough;
  const auto consider = [&](const InversePlane& plane) {
    const float norm = plane.n.norm();
    // norm is one over the camera's height, y / norm the cosine between normal and image "down".
    if (!(norm > 1 / 3.0f && norm < 1 / 0.2f && plane.n.y() > 0.64f * norm)) return;
    int count = 0;
    for (const InverseSample& s : samples) {
      // How much nearer the plane is than what is seen; nothing is seen below a floor.
      const float nearer = plane.inverse_depth(s.x, s.y) - s.inverse;
      const float limit = tolerance(s.inverse);
      count += (std::abs(nearer) < limit) - (nearer > 3 * limit);
    }
    if (count > best_count) best = plane, best_count = count;
  };
  if (last.found) consider(last);
  // A floor that still holds a good part of the samples need not be looked for, one that holds at
  // all only now and then: a better one is found within a few frames.
  if (best_count > static_cast<int>(n / 4)) trials = 0;
  if (best_count > enough) trials /= 4;
  best_count = std::max(best_count, enough);
  // Most of the floor is in the lower half, and samples come in rows from the top.
  const std::size_t half = n / 2;
  for (int t = 0; t < trials; ++t) {
    const InverseSample& p = samples[half + random.below(n - half)];
    const InverseSample& q = samples[half + random.below(n - half)];
    const InverseSample& r = samples[half + random.below(n - half)];
    const float d1x = q.x - p.x, d1y = q.y - p.y, d2x = r.x - p.x, d2y = r.y - p.y;
    const float det = d1x * d2y - d1y * d2x;
    if (std::abs(det) < 0.01f) continue;
    const float d1 = q.inverse - p.inverse, d2 = r.inverse - p.inverse;
    const float a = (d1 * d2y - d2 * d1y) / det, b = (d2 * d1x - d1 * d2x) / det;
    consider({{a, b, p.inverse - a * p.x - b * p.y}, true});
  }
  if (!best.found || best_count <= enough) return best;  // too few to better it
  // One least-squares pass over the inliers takes out the noise of three samples.
  Eigen::Matrix3d square = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (const InverseSample& s : samples) {
    if (std::abs(best.inverse_depth(s.x, s.y) - s.inverse) >= tolerance(s.inverse)) continue;
    const Eigen::Vector3d row(s.x, s.y, 1);
    square += row * row.transpose();
    right += row * s.inverse;
  }
  const auto plane = detail::solve_normal_equations<3>(square, right);
  if (plane) best.n = plane->cast<float>();
  return best;
}

}  // namespace stillpoint
