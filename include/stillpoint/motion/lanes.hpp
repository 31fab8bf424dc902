// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>

namespace stillpoint::detail {

/// Four numbers side by side, as vector instructions take them.
using Lanes = Eigen::Array<float, 4, 1>;

/// Times this, what is not 0 is far beyond 1 or -1: for there is no `if` in lanes.
inline constexpr float kHuge = 1e30f;

/// The same in every build, whatever its vectors.
inline double sum(const Lanes& v) {
  return (static_cast<double>(v[0]) + v[1]) + (static_cast<double>(v[2]) + v[3]);
}

/// The sums of the normal equations of N unknowns, lane by lane until the end.
template <int N>
class NormalLanes {
 public:
  /// The slopes of an error, by unknown.
  using Slopes = std::array<Lanes, N>;

  NormalLanes() {
    for (Slopes& row : H_) row.fill(Lanes::Zero());
    g_.fill(Lanes::Zero());
  }

  void add(const Lanes& weight, const Slopes& J, const Lanes& error) {
    for (std::size_t i = 0; i < N; ++i) {
      const Lanes a = weight * J[i];
      for (std::size_t j = 0; j <= i; ++j) H_[i][j] += a * J[j];
      g_[i] += a * error;
    }
  }

  /// Two errors of the same weight, of which the first has no slope in the second unknown, nor the
  /// second in the first: a point's in u and v, which x and y move.
  void add(const Lanes& weight, const Slopes& ju, const Lanes& eu, const Slopes& jv,
           const Lanes& ev) {
    const Lanes a0 = weight * ju[0], b1 = weight * jv[1];
    H_[0][0] += a0 * ju[0], H_[1][1] += b1 * jv[1];
    g_[0] += a0 * eu, g_[1] += b1 * ev;
    for (std::size_t i = 2; i < N; ++i) {
      const Lanes a = weight * ju[i], b = weight * jv[i];
      H_[i][0] += a * ju[0], H_[i][1] += b * jv[1];
      for (std::size_t j = 2; j <= i; ++j) H_[i][j] += a * ju[j] + b * jv[j];
      g_[i] += a * eu + b * ev;
    }
  }

  /// The lower half; 0 above.
  Eigen::Matrix<double, N, N> matrix() const {
    Eigen::Matrix<double, N, N> H;
    H.setZero();
    for (std::size_t i = 0; i < N; ++i)
      for (std::size_t j = 0; j <= i; ++j)
        H(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) = sum(H_[i][j]);
    return H;
  }

  Eigen::Matrix<double, N, 1> right() const {
    Eigen::Matrix<double, N, 1> g;
    for (std::size_t i = 0; i < N; ++i) g[static_cast<Eigen::Index>(i)] = sum(g_[i]);
    return g;
  }

 private:
  std::array<Slopes, N> H_;  // lower half
  Slopes g_;
};

}  // namespace stillpoint::detail
