// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <optional>

namespace stillpoint::detail {

/// The x with `H` x = `g`, of a symmetric, positive definite H of which the lower half is read;
/// none if H is not positive definite or not finite. By OpenCV, whose solver is compiled: Eigen's
/// costs every program that includes it three seconds for each N. O(N^3), below a microsecond for N
/// = 6.
template <int N>
std::optional<Eigen::Matrix<double, N, 1>> solve_normal_equations(
    const Eigen::Matrix<double, N, N>& H, const Eigen::Matrix<double, N, 1>& g) {
  cv::Matx<double, N, N> both;
  for (int i = 0; i < N; ++i)
    for (int j = 0; j <= i; ++j) both(i, j) = both(j, i) = H(i, j);
  const cv::Matx<double, N, 1> right(g.data());
  cv::Matx<double, N, 1> x;
  if (!cv::solve(both, right, x, cv::DECOMP_CHOLESKY)) return std::nullopt;
  const Eigen::Matrix<double, N, 1> solution(x.val);
  if (!solution.allFinite()) return std::nullopt;
  return solution;
}

}  // namespace stillpoint::detail
