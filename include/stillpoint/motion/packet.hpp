// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstring>

#include "stillpoint/core/config.hpp"

namespace stillpoint::detail {

#if defined(__GNUC__) || defined(__clang__)
using Lane = float __attribute__((vector_size(16)));
#else
using Lane = float;
#endif

/// N floats, a multiple of four, that are worked on at once: by the compiler's vectors where it has
/// them. Eigen's arrays do the same, but every program that includes them takes seconds longer to
/// compile; of plain arrays of floats, g++ makes vector instructions in some places only.
template <std::size_t N>
class PacketOf {
 public:
  STILLPOINT_ALWAYS_INLINE static PacketOf constant(float x) {
    PacketOf p;
    for (Lane& lane : p.lanes_) lane = Lane() + x;
    return p;
  }
  STILLPOINT_ALWAYS_INLINE static PacketOf load(const float* first) {
    PacketOf p;
    std::memcpy(&p.lanes_, first, sizeof p.lanes_);
    return p;
  }

  float operator[](std::size_t i) const {
    float x;
    std::memcpy(&x, reinterpret_cast<const char*>(&lanes_) + i * sizeof x, sizeof x);
    return x;
  }
  void set(std::size_t i, float x) {
    std::memcpy(reinterpret_cast<char*>(&lanes_) + i * sizeof x, &x, sizeof x);
  }

  STILLPOINT_ALWAYS_INLINE friend PacketOf operator+(const PacketOf& a, const PacketOf& b) {
    return each(a, b, [](auto x, auto y) { return x + y; });
  }
  STILLPOINT_ALWAYS_INLINE friend PacketOf operator-(const PacketOf& a, const PacketOf& b) {
    return each(a, b, [](auto x, auto y) { return x - y; });
  }
  STILLPOINT_ALWAYS_INLINE friend PacketOf operator*(const PacketOf& a, const PacketOf& b) {
    return each(a, b, [](auto x, auto y) { return x * y; });
  }
  STILLPOINT_ALWAYS_INLINE friend PacketOf operator/(const PacketOf& a, const PacketOf& b) {
    return each(a, b, [](auto x, auto y) { return x / y; });
  }
  STILLPOINT_ALWAYS_INLINE friend PacketOf operator+(const PacketOf& a, float b) {
    return a + constant(b);
  }
  STILLPOINT_ALWAYS_INLINE friend PacketOf operator-(const PacketOf& a, float b) {
    return a - constant(b);
  }
  STILLPOINT_ALWAYS_INLINE friend PacketOf operator*(const PacketOf& a, float b) {
    return a * constant(b);
  }
  STILLPOINT_ALWAYS_INLINE friend PacketOf operator/(const PacketOf& a, float b) {
    return a / constant(b);
  }
  STILLPOINT_ALWAYS_INLINE friend PacketOf operator+(float a, const PacketOf& b) {
    return constant(a) + b;
  }
  STILLPOINT_ALWAYS_INLINE friend PacketOf operator-(float a, const PacketOf& b) {
    return constant(a) - b;
  }
  STILLPOINT_ALWAYS_INLINE friend PacketOf operator*(float a, const PacketOf& b) {
    return constant(a) * b;
  }
  STILLPOINT_ALWAYS_INLINE friend PacketOf operator/(float a, const PacketOf& b) {
    return constant(a) / b;
  }
  STILLPOINT_ALWAYS_INLINE PacketOf operator-() const { return 0.0f - *this; }
  STILLPOINT_ALWAYS_INLINE PacketOf& operator+=(const PacketOf& b) { return *this = *this + b; }

  STILLPOINT_ALWAYS_INLINE PacketOf max(float b) const {
    return each(*this, constant(b), [](auto x, auto y) { return x > y ? x : y; });
  }
  STILLPOINT_ALWAYS_INLINE PacketOf min(float b) const {
    return each(*this, constant(b), [](auto x, auto y) { return x < y ? x : y; });
  }
  STILLPOINT_ALWAYS_INLINE PacketOf abs() const {
    return each(*this, -*this, [](auto x, auto minus_x) { return x < minus_x ? minus_x : x; });
  }

 private:
  // f(a, b) of each pair of numbers.
  template <class Function>
  STILLPOINT_ALWAYS_INLINE static PacketOf each(const PacketOf& a, const PacketOf& b, Function f) {
    PacketOf p;
    for (std::size_t i = 0; i < a.lanes_.size(); ++i) p.lanes_[i] = f(a.lanes_[i], b.lanes_[i]);
    return p;
  }

  std::array<Lane, N * sizeof(float) / sizeof(Lane)> lanes_;
};
using Packet = PacketOf<4>;

/// A factor that makes every number but 0 far larger than 1. Clamped to 0 to 1, such a product
/// stands for an `if`, which packets do not have.
inline constexpr float kHuge = 1e30f;

/// 1 where a number is positive, else 0.
template <std::size_t N>
STILLPOINT_ALWAYS_INLINE PacketOf<N> is_positive(const PacketOf<N>& x) {
  return (x * kHuge).max(0).min(1);
}

/// Of a number or, each for itself, of those of a packet.
inline float clamped(float x, float least, float most) {
  return std::min(most, std::max(least, x));
}
template <std::size_t N>
STILLPOINT_ALWAYS_INLINE PacketOf<N> clamped(const PacketOf<N>& x, float least, float most) {
  return x.max(least).min(most);
}

/// In double precision, and in the same order in every build.
template <std::size_t N>
double sum(const PacketOf<N>& v) {
  double low = 0, high = 0;
  for (std::size_t i = 0; i < N / 2; ++i) low += v[i], high += v[N / 2 + i];
  return low + high;
}

/// The sums of the normal equations of N unknowns, kept apart for each number of a packet until
/// matrix() and right() add them up.
template <int N>
class NormalPackets {
 public:
  /// The slopes of an error, by unknown.
  using Slopes = std::array<Packet, N>;

  NormalPackets() {
    for (Slopes& row : H_) row.fill(Packet::constant(0));
    g_.fill(Packet::constant(0));
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
