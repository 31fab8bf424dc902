// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>

#include "stillpoint/testing/noise.hpp"

/// Arithmetic of the synthetic sequence. Only operations that IEEE 754 rounds exactly (+ - * / sqrt
/// floor) are used, so that an image is the same byte for byte whatever the compiler, the build
/// type and the mathematical library.
namespace stillpoint::synthetic {

constexpr double kPi = 3.14159265358979323846;

/// A point or direction, metres in the world: x right, y forward, z up.
struct Vec3 {
  double x = 0, y = 0, z = 0;
};

inline Vec3 operator+(Vec3 a, Vec3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec3 operator-(Vec3 a, Vec3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec3 operator-(Vec3 a) { return {-a.x, -a.y, -a.z}; }
inline Vec3 operator*(Vec3 a, double s) { return {a.x * s, a.y * s, a.z * s}; }
inline double dot(Vec3 a, Vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vec3 cross(Vec3 a, Vec3 b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline double norm(Vec3 a) { return std::sqrt(dot(a, a)); }
inline Vec3 normalized(Vec3 a) {
  const double n = norm(a);
  return n > 0 ? a * (1 / n) : Vec3{0, 0, 1};
}
inline Vec3 mix(Vec3 a, Vec3 b, double w) { return a + (b - a) * w; }

/// A rigid frame: axes and origin in the world.
struct Frame {
  Vec3 x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1}, origin;

  /// World direction of a local one.
  Vec3 rotate(Vec3 v) const { return x * v.x + y * v.y + z * v.z; }
  /// World point of a local one.
  Vec3 to_world(Vec3 p) const { return origin + rotate(p); }
  /// Local point of a world one.
  Vec3 to_local(Vec3 p) const {
    const Vec3 d = p - origin;
    return {dot(d, x), dot(d, y), dot(d, z)};
  }
};

/// Sine to 1e-10, x in radians, |x| up to a few thousand.
inline double sine(double x) {
  x -= 2 * kPi * std::floor(x / (2 * kPi) + 0.5);
  if (x > kPi / 2) x = kPi - x;
  if (x < -kPi / 2) x = -kPi - x;
  const double s = x * x;
  return x *
         (1 - s / 6 *
                  (1 - s / 20 *
                           (1 - s / 42 *
                                    (1 - s / 72 * (1 - s / 110 * (1 - s / 156 * (1 - s / 210)))))));
}

inline double cosine(double x) { return sine(x + kPi / 2); }

/// Angle of (x, y) in turns, -0.5 to 0.5, to 1e-4.
inline float angle_in_turns(float y, float x) {
  const float ax = x < 0 ? -x : x, ay = y < 0 ? -y : y;
  const float big = ax > ay ? ax : ay, small = ax > ay ? ay : ax;
  const float q = big > 0 ? small / big : 0.0f, s = q * q;
  float a = q * (0.159121f + s * (-0.0518540f + s * (0.0247611f - s * 0.00702778f)));
  if (ay > ax) a = 0.25f - a;
  if (x < 0) a = 0.5f - a;
  return y < 0 ? -a : a;
}

/// Base-2 logarithm of a positive float to 0.09, for choosing a texture level.
inline float rough_log2(float x) {
  std::uint32_t bits;
  std::memcpy(&bits, &x, sizeof(bits));
  return static_cast<float>(bits) * (1.0f / 8388608.0f) - 127.0f;
}

/// A number of about normal distribution (sum of four), mean 0, deviation 1, at most 3.5.
inline double gaussian(std::uint64_t h) {
  const auto sum = static_cast<double>((h & 0xffff) + (h >> 16 & 0xffff) + (h >> 32 & 0xffff) +
                                       (h >> 48 & 0xffff));
  return (sum - 2 * 65535.0) * (1.7320508 / 65535.0);
}

/// A stream of random numbers for building scenes; copies go on alike.
class Random {
 public:
  explicit Random(std::uint64_t seed) : seed_(seed) {}
  std::uint64_t bits() { return hash(seed_, ++count_); }
  double operator()() { return uniform(bits()); }
  double range(double low, double high) { return low + (high - low) * (*this)(); }
  /// An integer of [0, n).
  int below(int n) { return static_cast<int>((bits() >> 16) % static_cast<std::uint64_t>(n)); }

 private:
  std::uint64_t seed_, count_ = 0;
};

inline double clamp01(double x) { return x < 0 ? 0 : x > 1 ? 1 : x; }
inline double smooth_step(double x) {
  x = clamp01(x);
  return x * x * (3 - 2 * x);
}

}  // namespace stillpoint::synthetic
