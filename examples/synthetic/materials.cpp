// SPDX-License-Identifier: BSD-2-Clause
#include "synthetic/materials.hpp"

namespace stillpoint::synthetic {

void paint_photo(Canvas& canvas, int x0, int y0, int x1, int y1, std::uint64_t seed) {
  Random random(seed);
  const Color sky = random_color(random, 90, 240), ground = random_color(random, 20, 160);
  const int layers = 2 + random.below(3), w = x1 - x0, h = y1 - y0;
  for (int y = y0; y < y1; ++y)
    canvas.rectangle(x0, y, x1, y + 1, scaled(sky, 0.75 + 0.5 * (y - y0) / h));
  for (int layer = 0; layer < layers; ++layer) {
    const Color color = scaled(ground, 0.6 + 0.35 * layer);
    const std::uint64_t ridge = random.bits();
    for (int x = x0; x < x1; ++x) {
      const float p = static_cast<float>(x - x0) / static_cast<float>(w) * 6;
      const double height = 0.6 * value_noise(p, 0, 64, 1, ridge) +
                            0.25 * value_noise(p * 3, 0, 64, 1, ridge + 1) +
                            0.15 * value_noise(p * 9, 0, 64, 1, ridge + 2);
      canvas.rectangle(x, y0 + static_cast<int>(h * (0.15 + 0.22 * layer + 0.4 * height)), x + 1,
                       y1, color);
    }
  }
  const int things = 6 + random.below(12);
  for (int i = 0; i < things; ++i) {
    const int r = std::max(2, static_cast<int>(h * random.range(0.02, 0.13)));
    const int cx = x0 + r + random.below(std::max(1, w - 2 * r));
    const int cy = y0 + r + random.below(std::max(1, h - 2 * r));
    const Color color = random_color(random, 0, 255);
    if (random.below(2))
      canvas.ellipse(cx, cy, r, std::max(1, r * (50 + random.below(50)) / 100), color);
    else
      canvas.rectangle(cx - r, cy - r / 2, cx + r, cy + r / 2, color);
    canvas.ellipse(cx - r / 3, cy - r / 3, r / 3, r / 4, scaled(color, 1.5));
  }
}

void paint_chart(Canvas& canvas, int x0, int y0, int x1, int y1, std::uint64_t seed) {
  Random random(seed);
  canvas.rectangle(x0, y0, x1, y1, {245, 245, 240});
  const int n = 5 + random.below(8), kind = random.below(2);
  int last = y1;
  for (int i = 0; i < n; ++i) {
    const int xa = x0 + (x1 - x0) * i / n, xb = x0 + (x1 - x0) * (i + 1) / n;
    const int top = y1 - static_cast<int>((y1 - y0) * random.range(0.1, 0.95));
    const Color color = random_color(random, 0, 200);
    if (kind == 0)
      canvas.rectangle(xa + 1, top, xb - 1, y1, color);
    else
      canvas.line(xa, i ? last : top, xb, top, 2, {200, 30, 40});
    last = top;
  }
  canvas.line(x0, y1 - 1, x1, y1 - 1, 2, {20, 20, 20});
  canvas.line(x0, y0, x0, y1, 2, {20, 20, 20});
}

Canvas poster(int width, int height, std::uint64_t seed) {
  Random random(seed);
  const bool light = random.below(3) != 0;
  const Color paper = light ? random_color(random, 205, 250) : random_color(random, 20, 90);
  const Color ink = light ? Color{25, 25, 35} : Color{235, 235, 220};
  Canvas canvas(width, height, paper);
  const int title = height / 9;
  canvas.rectangle(0, 0, width, title, random_color(random, 20, 180));
  canvas.text(8, title / 4, width - 8, title, std::max(2, title / 14), {245, 245, 245},
              random.bits());
  const int columns = 2, gap = width / 40 + 2;
  for (int c = 0; c < columns; ++c) {
    const int x0 = gap + c * (width - gap) / columns, x1 = (c + 1) * (width - gap) / columns;
    for (int y = title + gap; y < height - gap;) {
      const int block = std::min(height - gap - y, height / 10 + random.below(height / 6));
      const int kind = random.below(5);
      if (kind < 2) {
        const int size = 1 + random.below(2);
        canvas.text(x0, y, x1, y + block, size, ink, random.bits());
      } else if (kind < 4) {
        paint_photo(canvas, x0, y, x1, y + block, random.bits());
      } else {
        paint_chart(canvas, x0, y, x1, y + block, random.bits());
      }
      y += block + gap;
    }
  }
  canvas.rectangle(0, 0, 2, height, scaled(paper, 0.7));
  canvas.rectangle(width - 2, 0, width, height, scaled(paper, 0.7));
  return canvas;
}

Canvas framed_photo(int width, int height, std::uint64_t seed) {
  Random random(seed);
  Canvas canvas(width, height, random_color(random, 15, 120));
  const int rim = std::max(4, height / 16);
  canvas.rectangle(rim, rim, width - rim, height - rim, {240, 238, 230});
  paint_photo(canvas, 2 * rim, 2 * rim, width - 2 * rim, height - 2 * rim, random.bits());
  return canvas;
}

Canvas books(int width, int height, std::uint64_t seed) {
  Random random(seed);
  Canvas canvas(width, height, {28, 22, 18});
  Color color = random_color(random);
  for (int x = 0; x < width;) {
    const int w = height / 12 + random.below(height / 7);
    if (random.below(14) == 0) {  // a gap
      x += w;
      continue;
    }
    if (random.below(3)) color = random_color(random, 25, 225);
    const int top = static_cast<int>(height * random.range(0.04, 0.34));
    canvas.rectangle(x, top, x + w - 1, height, color);
    canvas.rectangle(x, top, x + 1, height, scaled(color, 1.3));
    canvas.rectangle(x + w - 2, top, x + w - 1, height, scaled(color, 0.55));
    const Color ink =
        color.red + color.green + color.blue > 380 ? Color{20, 20, 30} : Color{240, 230, 200};
    const int size = std::max(1, w / 10), start = top + height / 12 + random.below(height / 6);
    for (int y = start; y < height * 3 / 4; y += 6 * size)
      if (random.below(5))
        canvas.letter(x + (w - 7 * size) / 2, y, size, ink, random.below(48), true);
    const int band = height - height / 6 + random.below(height / 12);
    canvas.rectangle(x, band, x + w - 1, band + height / 24 + 1, random_color(random));
    if (random.below(2))
      canvas.rectangle(x, top + 3, x + w - 1, top + 3 + height / 32, scaled(color, 1.6));
    x += w;
  }
  return canvas;
}

Canvas plaster(std::uint64_t seed) {
  Canvas canvas(512, 512, {196, 190, 178});
  canvas.noise(0.10, 128, 128, seed);
  canvas.noise(0.08, 32, 32, seed + 1);
  canvas.noise(0.06, 4, 4, seed + 2);
  Random random(seed + 3);
  for (int i = 0; i < 260; ++i) {  // scratches, nail holes, stains
    const int x = random.below(512), y = random.below(512);
    const int dx = random.below(24), dy = random.below(24);
    const double s = random.range(0.62, 1.2);
    if (random.below(3))
      canvas.ellipse(x, y, 1 + dx % 3, 1 + dy % 3, scaled(unpack(canvas.at(x, y)), s));
    else
      canvas.line(x, y, x + dx - 12, y + dy - 12, 1, scaled(unpack(canvas.at(x, y)), s));
  }
  return canvas;
}

Canvas carpet(std::uint64_t seed) {
  Canvas canvas(1024, 1024, {74, 88, 108});
  Random random(seed);
  for (int y = 0; y < 4; ++y)  // tiles of slightly different shade, with patches
    for (int x = 0; x < 4; ++x)
      canvas.rectangle(x * 256, y * 256, x * 256 + 256, y * 256 + 256,
                       scaled({74, 88, 108}, random.range(0.8, 1.2)));
  canvas.noise(0.15, 128, 128, seed + 4);
  canvas.noise(0.22, 32, 32, seed + 1);
  canvas.noise(0.35, 8, 8, seed + 2);
  canvas.noise(0.45, 2, 2, seed + 3);
  for (int i = 0; i < 900; ++i) {  // flecks
    const int x = random.below(1024), y = random.below(1024);
    const int rx = 1 + random.below(5), ry = 1 + random.below(4);
    const Color color = random_color(random, 60, 190);
    canvas.ellipse(x, y, rx, ry, scaled(color, random.range(0.5, 1.2)));
  }
  return canvas;
}

Canvas ceiling(std::uint64_t seed) {
  Canvas canvas(512, 512, {226, 226, 220});
  Random random(seed);
  for (int i = 0; i < 2600; ++i) {
    const int x = random.below(512), y = random.below(512), r = 1 + random.below(3);
    canvas.ellipse(x, y, r, r, scaled({226, 226, 220}, random.range(0.62, 0.95)));
  }
  canvas.noise(0.05, 64, 64, seed + 1);
  for (int i = 0; i < 512; i += 256) {
    canvas.rectangle(i, 0, i + 4, 512, {120, 120, 118});
    canvas.rectangle(0, i, 512, i + 4, {120, 120, 118});
  }
  return canvas;
}

Canvas wood(Color color, std::uint64_t seed) {
  Canvas canvas(512, 256, color);
  canvas.noise(0.18, 256, 16, seed);
  canvas.noise(0.22, 128, 4, seed + 1);
  canvas.noise(0.12, 32, 2, seed + 2);
  Random random(seed + 3);
  for (int i = 0; i < 14; ++i) {
    const int x = random.below(512), y = random.below(256), r = 2 + random.below(4);
    canvas.ellipse(x, y, r * 2, r, scaled(color, 0.55));
    canvas.ellipse(x, y, r, r / 2 + 1, scaled(color, 0.35));
  }
  return canvas;
}

Canvas carton(std::uint64_t seed) {
  Random random(seed);
  const Color board = scaled({178, 134, 86}, random.range(0.8, 1.15));
  Canvas canvas(512, 512, board);
  canvas.noise(0.10, 64, 8, seed + 1);
  canvas.noise(0.10, 4, 4, seed + 2);
  canvas.rectangle(230, 0, 282, 512, scaled(board, 1.18));
  canvas.rectangle(30, 40, 215, 190, {238, 236, 228});
  canvas.text(40, 50, 205, 150, 2, {20, 20, 20}, random.bits());
  for (int x = 42; x < 200; x += 3)
    if (random.below(2)) canvas.rectangle(x, 155, x + 2, 184, {15, 15, 15});
  canvas.text(300, 60, 500, 200, 5, {60, 30, 20}, random.bits());
  paint_photo(canvas, 300, 260, 490, 420, random.bits());
  const Color mark = random_color(random, 10, 200);
  canvas.rectangle(60, 250, 190, 270, mark);
  canvas.line(90, 400, 90, 300, 12, mark), canvas.line(90, 300, 70, 330, 10, mark);
  canvas.line(90, 300, 110, 330, 10, mark);
  canvas.ellipse(160, 350, 30, 40, mark), canvas.ellipse(160, 345, 20, 28, board);
  canvas.text(30, 430, 220, 500, 3, mark, random.bits());
  canvas.text(300, 440, 500, 505, 2, {40, 30, 20}, random.bits());
  canvas.rectangle(0, 0, 512, 4, scaled(board, 0.6)),
      canvas.rectangle(0, 508, 512, 512, scaled(board, 0.6));
  canvas.rectangle(0, 0, 4, 512, scaled(board, 0.6)),
      canvas.rectangle(508, 0, 512, 512, scaled(board, 0.6));
  return canvas;
}

Canvas screen(std::uint64_t seed) {
  Random random(seed);
  Canvas canvas(512, 256, {14, 14, 16});
  canvas.rectangle(10, 10, 502, 246, random_color(random, 30, 110));
  for (int i = 0; i < 3; ++i) {
    const int x = 14 + random.below(200), y = 14 + random.below(80);
    const int w = 180 + random.below(120), h = 90 + random.below(60);
    const bool dark = random.below(2) != 0;
    canvas.rectangle(x, y, x + w, y + 10, random_color(random, 60, 220));
    canvas.rectangle(x, y + 10, x + w, y + h, dark ? Color{24, 26, 32} : Color{238, 238, 238});
    const int size = 1 + random.below(2);
    const Color ink = random_color(random, 120, 255);
    canvas.text(x + 6, y + 16, x + w - 6, y + h, size, dark ? ink : Color{30, 30, 40},
                random.bits());
  }
  paint_photo(canvas, 370, 130, 480, 220, random.bits());
  canvas.rectangle(10, 234, 502, 246, {40, 44, 60});
  return canvas;
}

Canvas sheet(std::uint64_t seed) {
  Random random(seed);
  Canvas canvas(128, 256, {240, 239, 232});
  canvas.text(10, 10, 118, 40, 2, {20, 20, 60}, random.bits());
  canvas.text(10, 50, 118, 150, 1, {30, 30, 30}, random.bits());
  if (random.below(2))
    paint_chart(canvas, 14, 160, 114, 240, random.bits());
  else
    paint_photo(canvas, 14, 160, 114, 240, random.bits());
  return canvas;
}

Canvas door(std::uint64_t seed) {
  Canvas canvas = wood({150, 96, 58}, seed);
  Canvas leaf(256, 512, {150, 96, 58});
  for (int y = 0; y < 512; ++y)
    for (int x = 0; x < 256; ++x) leaf.at(x, y) = canvas.at(y, x);
  Random random(seed + 9);
  for (int i = 0; i < 2; ++i) {
    const int y = 30 + i * 250;
    leaf.rectangle(28, y, 228, y + 4, {60, 36, 20}),
        leaf.rectangle(28, y + 200, 228, y + 204, {190, 140, 90});
    leaf.rectangle(28, y, 32, y + 204, {60, 36, 20}),
        leaf.rectangle(224, y, 228, y + 204, {190, 140, 90});
  }
  leaf.rectangle(70, 50, 190, 220, {236, 234, 226});
  leaf.text(80, 60, 180, 120, 2, {160, 20, 20}, random.bits());
  paint_photo(leaf, 80, 125, 180, 210, random.bits());
  leaf.rectangle(60, 300, 150, 400, {220, 225, 190});
  leaf.text(66, 306, 144, 396, 1, {20, 30, 60}, random.bits());
  leaf.rectangle(170, 320, 215, 360, {60, 120, 180});
  leaf.ellipse(240, 262, 9, 9, {210, 205, 190});
  return leaf;
}

}  // namespace stillpoint::synthetic
