// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "stillpoint/core/normal_equations.hpp"
#include "stillpoint/core/random.hpp"

namespace stillpoint {

/// A plane in inverse depth: 1 / z = a x + b y + c with x = (u - cx) / fx, y = (v - cy) / fy.
struct InversePlane {
  float a = 0, b = 0, c = 0;
  bool found = false;

  /// Depth at which the ray (x, y, 1) meets the plane, metres; 0 if it does not.
  float depth_m(float x, float y) const {
    const float inverse = a * x + b * y + c;
    return found && inverse > 1e-4f ? 1 / inverse : 0;
  }

  /// The same plane after the camera has moved: `T_current_last` maps points of the camera that the
  /// plane was found by into the present one's.
  InversePlane moved(const Eigen::Isometry3d& T_current_last) const {
    // (a, b, c) p = 1 for its points p.
    Eigen::Vector3d n = T_current_last.linear() * Eigen::Vector3d(a, b, c);
    const double scale = 1 + n.dot(T_current_last.translation());
    if (!found || !(scale > 0)) return {};
    n /= scale;
    return {static_cast<float>(n.x()), static_cast<float>(n.y()), static_cast<float>(n.z()), true};
  }
};

/// A depth sample for find_floor(): ray (x, y, 1) and inverse depth in 1/m.
struct InverseSample {
  float x, y, inverse;
};

/// Finds the floor among samples by RANSAC: the plane with most samples, less those below it, among
/// those that face the camera from below (camera upright within about 50 degrees, 0.2 to 3 m above
/// the floor). So a table is no floor: the floor is seen below it. `last`,
/// the floor of the last frame, is the first candidate. Was it `carried` along with the camera's
/// motion, a few samples suffice: people hide most of it. Deterministic for a seed. Cost: `trials`
/// times samples.
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
    const float norm = std::sqrt(plane.a * plane.a + plane.b * plane.b + plane.c * plane.c);
    // norm is one over the camera's height, b / norm the cosine between normal and image "down".
    if (!(norm > 1 / 3.0f && norm < 1 / 0.2f && plane.b > 0.64f * norm)) return;
    int count = 0;
    for (const InverseSample& s : samples) {
      // How much nearer the plane is than what is seen; nothing is seen below a floor.
      const float nearer = plane.a * s.x + plane.b * s.y + plane.c - s.inverse;
      const float limit = tolerance(s.inverse);
      count += (std::abs(nearer) < limit) - (nearer > 3 * limit);
    }
    if (count > best_count) best = plane, best_count = count, best.found = true;
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
    InversePlane plane;
    plane.a = (d1 * d2y - d2 * d1y) / det;
    plane.b = (d2 * d1x - d1 * d2x) / det;
    plane.c = p.inverse - plane.a * p.x - plane.b * p.y;
    consider(plane);
  }
  if (!best.found || best_count <= enough) return best;  // too few to better it
  // One least-squares pass over the inliers takes out the noise of three samples.
  Eigen::Matrix3d square = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (const InverseSample& s : samples) {
    if (std::abs(best.a * s.x + best.b * s.y + best.c - s.inverse) >= tolerance(s.inverse))
      continue;
    const Eigen::Vector3d row(s.x, s.y, 1);
    square += row * row.transpose();
    right += row * s.inverse;
  }
  const auto plane = detail::solve_normal_equations<3>(square, right);
  if (!plane) return best;
  best.a = static_cast<float>((*plane)[0]);
  best.b = static_cast<float>((*plane)[1]);
  best.c = static_cast<float>((*plane)[2]);
  return best;
}

}  // namespace stillpoint
