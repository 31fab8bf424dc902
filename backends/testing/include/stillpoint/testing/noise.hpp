// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cmath>
#include <cstdint>

/// Numbers that look random and depend on nothing but the arguments. Only operations that IEEE 754
/// rounds exactly are used, so that they are the same whatever the compiler and the build type.
namespace stillpoint::synthetic {

/// Scrambles 64 bits.
inline std::uint64_t scramble(std::uint64_t h) {
  h ^= h >> 32, h *= 0xd6e8feb86659fd93ull;
  h ^= h >> 32, h *= 0xd6e8feb86659fd93ull;
  return h ^ (h >> 32);
}

/// Random bits that depend on nothing but the arguments.
inline std::uint64_t hash(std::uint64_t a, std::uint64_t b = 0, std::uint64_t c = 0) {
  return scramble(a * 0x9e3779b97f4a7c15ull +
                  scramble(b * 0xc2b2ae3d27d4eb4full + scramble(c + 0x165667b19e3779f9ull)));
}

/// A number of [0, 1) from random bits.
inline double uniform(std::uint64_t h) {
  return static_cast<double>(h >> 11) * (1.0 / (1ull << 53));
}

/// Smooth noise of [0, 1] with one random value per unit cell; repeats after `period` cells.
inline float value_noise(float x, float y, int period_x, int period_y, std::uint64_t seed) {
  const float fx = std::floor(x), fy = std::floor(y);
  const float wx = x - fx, wy = y - fy;
  const auto wrap = [](int i, int n) { return ((i % n) + n) % n; };
  const int x0 = wrap(static_cast<int>(fx), period_x), x1 = wrap(x0 + 1, period_x);
  const int y0 = wrap(static_cast<int>(fy), period_y), y1 = wrap(y0 + 1, period_y);
  const auto at = [&](int cx, int cy) {
    const std::uint64_t h =
        scramble(seed + (static_cast<std::uint64_t>(cy) << 32) + static_cast<std::uint64_t>(cx));
    return static_cast<float>(h >> 40) * (1.0f / 16777216.0f);
  };
  const float sx = wx * wx * (3 - 2 * wx), sy = wy * wy * (3 - 2 * wy);
  const float top = at(x0, y0) + (at(x1, y0) - at(x0, y0)) * sx;
  const float bottom = at(x0, y1) + (at(x1, y1) - at(x0, y1)) * sx;
  return top + (bottom - top) * sy;
}

}  // namespace stillpoint::synthetic
