// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "synthetic/math.hpp"

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

/// An image to paint on: pixels 0x00RRGGBB, row by row. Everything painted is clipped.
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
  void ellipse(int cx, int cy, int rx, int ry, Color color);
  void line(int x0, int y0, int x1, int y1, int thickness, Color color);
  /// Brightens and darkens by up to `amplitude` with noise of cells of the given size in pixels
  /// (powers of two, so that it repeats seamlessly).
  void noise(double amplitude, int cell_x, int cell_y, std::uint64_t seed);
  /// Lines of made-up letters in a rectangle; `size` is the pixels of a letter's stroke.
  void text(int x0, int y0, int x1, int y1, int size, Color ink, std::uint64_t seed);
  /// One of 48 made-up letters of 5 x 7 strokes; `turned` writes it downward along a book's spine.
  void letter(int x0, int y0, int size, Color ink, int which, bool turned);
};

/// A texture with its smaller levels, each half as wide and high. Sides are powers of two; it
/// repeats in both directions.
class Texture {
 public:
  explicit Texture(const Canvas& canvas);
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
  std::uint32_t average(const Level& level, int x, int y, int step_x, int step_y) const;

  int width_, height_;
  std::vector<std::uint32_t> pixels_;
  std::vector<Level> levels_;
};

}  // namespace stillpoint::synthetic
