// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "stillpoint/testing/synthetic_math.hpp"

namespace stillpoint::synthetic {

/// A color as displayed, 0 to 255 each.
struct Color {
  int red = 0, green = 0, blue = 0;
};

inline std::uint32_t pack(Color c) {
  const auto byte = [](int v) { return static_cast<std::uint32_t>(std::min(255, std::max(0, v))); };
  return byte(c.red) << 16 | byte(c.green) << 8 | byte(c.blue);
}
inline Color unpack(std::uint32_t p) {
  return {static_cast<int>(p >> 16 & 255), static_cast<int>(p >> 8 & 255),
          static_cast<int>(p & 255)};
}
inline Color scaled(Color c, double s) {
  const auto scale = [&](int v) { return static_cast<int>(v * s + 0.5); };
  return {scale(c.red), scale(c.green), scale(c.blue)};
}
/// A color between `low` and `high`, rather muted.
inline Color random_color(Random& random, int low = 30, int high = 230) {
  const auto one = [&] { return low + random.below(high - low); };
  const int red = one(), green = one(), blue = one(), gray = (red + green + blue) / 3;
  const int keep = 45 + random.below(50);  // percent of the saturation
  const auto muted = [&](int v) { return gray + (v - gray) * keep / 100; };
  return {muted(red), muted(green), muted(blue)};
}

/// A picture to paint on: pixels 0x00RRGGBB, row by row. Everything painted is clipped.
struct Canvas {
  int width = 0, height = 0;
  std::vector<std::uint32_t> pixels;

  Canvas(int width_px, int height_px, Color color)
      : width(width_px),
        height(height_px),
        pixels(static_cast<std::size_t>(width_px) * static_cast<std::size_t>(height_px),
               pack(color)) {}
  std::uint32_t& at(int x, int y) {
    return pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                  static_cast<std::size_t>(x)];
  }
  std::uint32_t at(int x, int y) const { return const_cast<Canvas*>(this)->at(x, y); }

  void rectangle(int x0, int y0, int x1, int y1, Color color) {
    const std::uint32_t value = pack(color);
    for (int y = std::max(0, y0); y < std::min(height, y1); ++y)
      for (int x = std::max(0, x0); x < std::min(width, x1); ++x) at(x, y) = value;
  }
  void ellipse(int cx, int cy, int rx, int ry, Color color) {
    const std::uint32_t value = pack(color);
    for (int y = std::max(0, cy - ry); y <= std::min(height - 1, cy + ry); ++y)
      for (int x = std::max(0, cx - rx); x <= std::min(width - 1, cx + rx); ++x) {
        const long long dx = (x - cx) * ry, dy = (y - cy) * rx, r = rx * ry;
        if (dx * dx + dy * dy <= r * r) at(x, y) = value;
      }
  }
  void line(int x0, int y0, int x1, int y1, int thickness, Color color) {
    const int n = std::max({1, x1 > x0 ? x1 - x0 : x0 - x1, y1 > y0 ? y1 - y0 : y0 - y1});
    for (int i = 0; i <= n; ++i) {
      const int x = x0 + (x1 - x0) * i / n, y = y0 + (y1 - y0) * i / n;
      rectangle(x - thickness / 2, y - thickness / 2, x + (thickness + 1) / 2,
                y + (thickness + 1) / 2, color);
    }
  }
  /// Brightens and darkens by up to `amplitude` with noise of cells of the given size in pixels
  /// (powers of two, so that it repeats seamlessly).
  void noise(double amplitude, int cell_x, int cell_y, std::uint64_t seed) {
    const int columns = std::max(1, width / cell_x), rows = std::max(1, height / cell_y);
    std::vector<float> lattice(static_cast<std::size_t>(columns * rows));
    for (std::size_t i = 0; i < lattice.size(); ++i)
      lattice[i] = static_cast<float>(2 * uniform(hash(seed, i)) - 1);
    const auto smooth = [](int i, int cell) {
      const float w = static_cast<float>(i % cell) / static_cast<float>(cell);
      return w * w * (3 - 2 * w);
    };
    for (int y = 0; y < height; ++y) {
      const float* row0 = lattice.data() + y / cell_y % rows * columns;
      const float* row1 = lattice.data() + (y / cell_y + 1) % rows * columns;
      const float wy = smooth(y, cell_y);
      for (int x = 0; x < width; ++x) {
        const int x0 = x / cell_x % columns, x1 = (x0 + 1) % columns;
        const float wx = smooth(x, cell_x);
        const float top = row0[x0] + (row0[x1] - row0[x0]) * wx;
        const float bottom = row1[x0] + (row1[x1] - row1[x0]) * wx;
        const double n = static_cast<double>(top + (bottom - top) * wy);
        at(x, y) = pack(scaled(unpack(at(x, y)), 1 + amplitude * n));
      }
    }
  }
  /// Lines of made-up letters in a rectangle; `size` is the pixels of a letter's stroke.
  void text(int x0, int y0, int x1, int y1, int size, Color ink, std::uint64_t seed) {
    Random random(seed);
    for (int y = y0; y + 7 * size <= y1; y += 10 * size) {
      const int end = random.below(4) ? x1 : x0 + (x1 - x0) * (30 + random.below(60)) / 100;
      for (int x = x0; x + 5 * size <= end; x += 6 * size)
        if (random.below(6)) letter(x, y, size, ink, random.below(48), false);
    }
  }
  /// One of 48 made-up letters of 5 x 7 strokes; `turned` writes it downward along a book's spine.
  void letter(int x0, int y0, int size, Color ink, int which, bool turned) {
    const std::uint64_t bits = hash(0x1e77e5, static_cast<std::uint64_t>(which));
    for (int i = 0; i < 7; ++i)
      for (int j = 0; j < 5; ++j) {
        const bool bar = i % 3 == 0 ? (bits >> (i / 3)) & 1 : false;
        const bool stem = j % 2 == 0 ? (bits >> (8 + j / 2 * 2 + (i > 3 ? 1 : 0))) & 1 : false;
        const bool slant = (bits >> 20 & 1) && i - 1 == j;
        if (!(bar || stem || slant)) continue;
        const int x = turned ? x0 + (6 - i) * size : x0 + j * size;
        const int y = turned ? y0 + j * size : y0 + i * size;
        rectangle(x, y, x + size, y + size, ink);
      }
  }
};

/// A texture with its smaller levels, each half as wide and high. Sides are powers of two; it
/// repeats in both directions.
class Texture {
 public:
  explicit Texture(const Canvas& canvas) : width_(canvas.width), height_(canvas.height) {
    pixels_ = canvas.pixels;
    Level level{0, width_, height_};
    levels_.push_back(level);
    while (level.width > 1 || level.height > 1) {
      const Level next{pixels_.size(), std::max(1, level.width / 2), std::max(1, level.height / 2)};
      const int step_x = level.width / next.width, step_y = level.height / next.height;
      for (int y = 0; y < next.height; ++y)
        for (int x = 0; x < next.width; ++x)
          pixels_.push_back(average(level, x, y, step_x, step_y));
      levels_.push_back(next);
      level = next;
    }
  }
  int width() const { return width_; }
  int height() const { return height_; }
  int level_count() const { return static_cast<int>(levels_.size()); }

  /// Color at (x, y) in texels of level 0, bilinear in the given level; x and y not negative.
  std::uint32_t sample(float x, float y, int level_index) const {
    const Level& level = levels_[static_cast<std::size_t>(level_index)];
    const float shrink = 256.0f / static_cast<float>(1 << level_index);
    const auto fx = static_cast<std::uint32_t>(x * shrink) - 128u;
    const auto fy = static_cast<std::uint32_t>(y * shrink) - 128u;
    const std::uint32_t mask_x = static_cast<std::uint32_t>(level.width) - 1;
    const std::uint32_t mask_y = static_cast<std::uint32_t>(level.height) - 1;
    const std::uint32_t x0 = fx >> 8 & mask_x, x1 = (x0 + 1) & mask_x;
    const std::uint32_t y0 = fy >> 8 & mask_y, y1 = (y0 + 1) & mask_y;
    const std::uint32_t* data = pixels_.data() + level.offset;
    const std::uint32_t* row0 = data + static_cast<std::size_t>(y0) * (mask_x + 1);
    const std::uint32_t* row1 = data + static_cast<std::size_t>(y1) * (mask_x + 1);
    const std::uint32_t wx = fx & 255;
    return blend(blend(row0[x0], row0[x1], wx), blend(row1[x0], row1[x1], wx), fy & 255);
  }

 private:
  struct Level {
    std::size_t offset;
    int width, height;
  };
  static std::uint32_t blend(std::uint32_t a, std::uint32_t b, std::uint32_t w) {
    const std::uint32_t red_blue =
        (((a & 0xff00ff) * (256 - w) + (b & 0xff00ff) * w + 0x800080) >> 8) & 0xff00ff;
    const std::uint32_t green =
        (((a & 0x00ff00) * (256 - w) + (b & 0x00ff00) * w + 0x008000) >> 8) & 0x00ff00;
    return red_blue | green;
  }
  /// Averages in linear light, with displayed = sqrt(light).
  std::uint32_t average(const Level& level, int x, int y, int step_x, int step_y) const {
    int red = 0, green = 0, blue = 0;
    for (int i = 0; i < step_y; ++i)
      for (int j = 0; j < step_x; ++j) {
        const Color c = unpack(pixels_[level.offset +
                                       static_cast<std::size_t>(y * step_y + i) *
                                           static_cast<std::size_t>(level.width) +
                                       static_cast<std::size_t>(x * step_x + j)]);
        red += c.red * c.red, green += c.green * c.green, blue += c.blue * c.blue;
      }
    const auto root = [&](int sum) {
      return static_cast<int>(std::sqrt(static_cast<double>(sum) / (step_x * step_y)) + 0.5);
    };
    return pack({root(red), root(green), root(blue)});
  }

  int width_, height_;
  std::vector<std::uint32_t> pixels_;
  std::vector<Level> levels_;
};

}  // namespace stillpoint::synthetic
