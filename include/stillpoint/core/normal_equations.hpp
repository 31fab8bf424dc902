// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <limits>
#include <optional>

namespace stillpoint::detail {

/// The x with `H` x = `g`, of a symmetric, positive definite H of which the lower half is read;
/// none if H is not positive definite or not finite. Cholesky's decomposition, written out: for so
/// few unknowns cv::solve() takes several times as long, and Eigen's costs every program that includes
/// it three seconds for each N. O(N^3).
template <int N>
std::optional<Eigen::Matrix<double, N, 1>> solve_normal_equations(
    const Eigen::Matrix<double, N, N>& H, const Eigen::Matrix<double, N, 1>& g) {
  Eigen::Matrix<double, N, N> L;  // lower half, with one over its diagonal
  Eigen::Matrix<double, N, 1> x;
  for (int i = 0; i < N; ++i) {
    for (int j = 0; j <= i; ++j) {
      double rest = H(i, j);
      for (int k = 0; k < j; ++k) rest -= L(i, k) * L(j, k);
      if (j < i)
        L(i, j) = rest * L(j, j);
      else if (rest >= std::numeric_limits<double>::epsilon())
        L(i, i) = 1 / std::sqrt(rest);
      else
        return std::nullopt;
    }
    double rest = g[i];
    for (int k = 0; k < i; ++k) rest -= L(i, k) * x[k];
    x[i] = rest * L(i, i);
  }
  for (int i = N - 1; i >= 0; --i) {
    double rest = x[i];
    for (int k = N - 1; k > i; --k) rest -= L(k, i) * x[k];
    x[i] = rest * L(i, i);
  }
  if (!x.allFinite()) return std::nullopt;
  return x;
}

}  // namespace stillpoint::detail
