// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>

namespace stillpoint::detail {

/// Four numbers that are worked on at once, by vector instructions (see Eigen on packet math).
using Packet = Eigen::Array<float, 4, 1>;

/// A factor that makes every number but 0 far larger than 1. Clamped to 0 to 1, such a product
/// stands for an `if`, which packets do not have.
inline constexpr float kHuge = 1e30f;

/// The same in every build, whatever its vectors.
inline double sum(const Packet& v) {
  return (static_cast<double>(v[0]) + v[1]) + (static_cast<double>(v[2]) + v[3]);
}

/// The sums of the normal equations of N unknowns, kept apart for each number of a packet until
/// matrix() and right() add them up.
template <int N>
class NormalPackets {
 public:
  /// The slopes of an error, by unknown.
  using Slopes = std::array<Packet, N>;

  NormalPackets() {
    for (Slopes& row : H_) row.fill(Packet::Zero());
    g_.fill(Packet::Zero());
  }

  void add(const Packet& weight, const Slopes& J, const Packet& error) {
    for (std::size_t i = 0; i < N; ++i) {
      const Packet a = weight * J[i];
      for (std::size_t j = 0; j <= i; ++j) H_[i][j] += a * J[j];
      g_[i] += a * error;
    }
  }

  /// Two errors of the same weight, of which the first has no slope in the second unknown, nor the
  /// second in the first: a point's in u and v, which x and y move.
  void add(const Packet& weight, const Slopes& ju, const Packet& eu, const Slopes& jv,
           const Packet& ev) {
    const Packet a0 = weight * ju[0], b1 = weight * jv[1];
    H_[0][0] += a0 * ju[0], H_[1][1] += b1 * jv[1];
    g_[0] += a0 * eu, g_[1] += b1 * ev;
    for (std::size_t i = 2; i < N; ++i) {
      const Packet a = weight * ju[i], b = weight * jv[i];
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
