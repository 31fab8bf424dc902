// SPDX-License-Identifier: BSD-2-Clause
#include "synthetic/texture.hpp"

namespace stillpoint::synthetic {

void Canvas::ellipse(int cx, int cy, int rx, int ry, Color color) {
  const std::uint32_t value = pack(color);
  for (int y = std::max(0, cy - ry); y <= std::min(height - 1, cy + ry); ++y)
    for (int x = std::max(0, cx - rx); x <= std::min(width - 1, cx + rx); ++x) {
      const long long dx = (x - cx) * ry, dy = (y - cy) * rx, r = rx * ry;
      if (dx * dx + dy * dy <= r * r) at(x, y) = value;
    }
}

void Canvas::line(int x0, int y0, int x1, int y1, int thickness, Color color) {
  const int n = std::max({1, x1 > x0 ? x1 - x0 : x0 - x1, y1 > y0 ? y1 - y0 : y0 - y1});
  for (int i = 0; i <= n; ++i) {
    const int x = x0 + (x1 - x0) * i / n, y = y0 + (y1 - y0) * i / n;
    rectangle(x - thickness / 2, y - thickness / 2, x + (thickness + 1) / 2,
              y + (thickness + 1) / 2, color);
  }
}

void Canvas::noise(double amplitude, int cell_x, int cell_y, std::uint64_t seed) {
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

void Canvas::text(int x0, int y0, int x1, int y1, int size, Color ink, std::uint64_t seed) {
  Random random(seed);
  for (int y = y0; y + 7 * size <= y1; y += 10 * size) {
    const int end = random.below(4) ? x1 : x0 + (x1 - x0) * (30 + random.below(60)) / 100;
    for (int x = x0; x + 5 * size <= end; x += 6 * size)
      if (random.below(6)) letter(x, y, size, ink, random.below(48), false);
  }
}

void Canvas::letter(int x0, int y0, int size, Color ink, int which, bool turned) {
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

Texture::Texture(const Canvas& canvas) : width_(canvas.width), height_(canvas.height) {
  pixels_ = canvas.pixels;
  Level level{0, width_, height_};
  levels_.push_back(level);
  while (level.width > 1 || level.height > 1) {
    const Level next{pixels_.size(), std::max(1, level.width / 2), std::max(1, level.height / 2)};
    const int step_x = level.width / next.width, step_y = level.height / next.height;
    for (int y = 0; y < next.height; ++y)
      for (int x = 0; x < next.width; ++x) pixels_.push_back(average(level, x, y, step_x, step_y));
    levels_.push_back(next);
    level = next;
  }
}

std::uint32_t Texture::average(const Level& level, int x, int y, int step_x, int step_y) const {
  int red = 0, green = 0, blue = 0;
  for (int i = 0; i < step_y; ++i)
    for (int j = 0; j < step_x; ++j) {
      const Color c = unpack(
          pixels_[level.offset +
                  static_cast<std::size_t>(y * step_y + i) * static_cast<std::size_t>(level.width) +
                  static_cast<std::size_t>(x * step_x + j)]);
      red += c.red * c.red, green += c.green * c.green, blue += c.blue * c.blue;
    }
  const auto root = [&](int sum) {
    return static_cast<int>(std::sqrt(static_cast<double>(sum) / (step_x * step_y)) + 0.5);
  };
  return pack({root(red), root(green), root(blue)});
}

}  // namespace stillpoint::synthetic
