// SPDX-License-Identifier: BSD-2-Clause
#include "synthetic/clothes.hpp"

namespace stillpoint::synthetic {

Canvas cloth(std::uint64_t seed, bool trousers) {
  Random random(seed);
  const Color base =
      trousers ? scaled(random_color(random, 40, 130), 1) : random_color(random, 50, 220);
  const Color second = random_color(random, 20, 240);
  Canvas canvas(512, 256, base);
  const int kind = trousers ? 3 + random.below(2) : random.below(5);
  const int step = 14 + random.below(16);
  if (kind == 0 || kind == 1) {  // checks, of uneven width
    for (int x = 0; x < 512; x += step + random.below(7))
      for (int y = 0; y < 256; ++y)
        for (int i = 0; i < step / 2 && x + i < 512; ++i)
          canvas.at(x + i, y) = pack(scaled(unpack(canvas.at(x + i, y)), 0.62));
    for (int y = 0; y < 256; y += step + random.below(7)) {
      for (int i = 0; i < step / 2 && y + i < 256; ++i)
        for (int x = 0; x < 512; ++x)
          canvas.at(x, y + i) = pack(scaled(unpack(canvas.at(x, y + i)), 0.66));
      canvas.rectangle(0, y, 512, y + 2, second);
    }
    for (int x = 0; x < 512; x += 2 * step + random.below(9))
      canvas.rectangle(x, 0, x + 2, 256, second);
  } else if (kind == 2) {  // stripes around the body
    for (int y = 0; y < 256; y += step + random.below(10))
      canvas.rectangle(0, y, 512, y + step / 2, second);
  } else if (kind == 4 && !trousers) {  // scattered prints
    for (int i = 0; i < 160; ++i) {
      const int x = random.below(512), y = random.below(256), r = 3 + random.below(7);
      const int ry = r * (60 + random.below(60)) / 100;
      canvas.ellipse(x, y, r, ry, random_color(random, 0, 255));
    }
  }
  if (!trousers) {  // front: buttons or a printed image; back: a line of text
    if (kind < 2) {
      canvas.rectangle(252, 0, 260, 256, scaled(base, 0.8));
      for (int y = 16; y < 256; y += 36) canvas.ellipse(256, y, 3, 3, {235, 230, 215});
    } else if (random.below(3)) {
      paint_photo(canvas, 205, 60, 307, 150, random.bits());
    }
    canvas.text(6, 40, 110, 120, 3, second, random.bits());
  } else {  // seams, pockets, worn knees
    for (const int x : {128, 384}) canvas.rectangle(x, 0, x + 3, 256, scaled(base, 0.6));
    canvas.line(200, 10, 160, 60, 2, scaled(base, 0.5)),
        canvas.line(312, 10, 352, 60, 2, scaled(base, 0.5));
    canvas.ellipse(256, 130, 46, 40, scaled(base, 1.3));
  }
  canvas.noise(0.30, 64, 64, seed + 1);  // folds
  canvas.noise(0.24, 16, 32, seed + 2);
  canvas.noise(0.20, 4, 4, seed + 3);
  canvas.noise(0.22, 2, 2, seed + 4);
  return canvas;
}

Canvas face(std::uint64_t seed) {
  Random random(seed);
  const double shade = random.range(0.5, 1.15);
  const Color skin = scaled({214, 166, 134}, shade);
  const Color hairs[4] = {{30, 22, 18}, {84, 54, 30}, {164, 124, 70}, {120, 116, 112}};
  const Color hair = hairs[random.below(4)];
  Canvas canvas(256, 256, hair);
  canvas.noise(0.4, 4, 32, seed + 5);
  canvas.ellipse(128, 150, 66, 96, skin);
  canvas.rectangle(0, 200, 256, 256, skin);
  canvas.ellipse(58, 140, 7, 13, scaled(skin, 0.9)),
      canvas.ellipse(198, 140, 7, 13, scaled(skin, 0.9));
  for (const int x : {104, 152}) {
    canvas.rectangle(x - 13, 102, x + 13, 107, scaled(hair, 0.8));
    canvas.ellipse(x, 118, 10, 6, {240, 240, 238});
    canvas.ellipse(x, 118, 5, 6, {40, 50, 60});
  }
  canvas.line(128, 116, 124, 150, 3, scaled(skin, 0.8)),
      canvas.line(122, 152, 136, 152, 4, scaled(skin, 0.7));
  canvas.ellipse(128, 176, 20, 5, {150, 74, 70});
  if (random.below(3) == 0)
    for (int i = 0; i < 300; ++i) {
      const int x = 96 + random.below(64);
      canvas.ellipse(x, 186 + random.below(36), 1, 2, hair);
    }
  if (random.below(2)) {  // glasses
    for (const int x : {104, 152})
      for (int i = 0; i < 2; ++i)
        canvas.rectangle(x - 18, 108 + 22 * i, x + 18, 111 + 22 * i, {20, 20, 20});
    canvas.rectangle(60, 112, 200, 115, {20, 20, 20});
  }
  canvas.noise(0.10, 32, 32, seed + 6);
  canvas.noise(0.12, 4, 4, seed + 7);
  return canvas;
}

Canvas skin(std::uint64_t seed) {
  Random random(seed);
  Canvas canvas(128, 128, scaled({214, 166, 134}, random.range(0.5, 1.15)));
  canvas.noise(0.16, 32, 32, seed + 1);
  canvas.noise(0.18, 4, 4, seed + 2);
  for (int i = 0; i < 40; ++i) {
    const int x = random.below(128);
    canvas.ellipse(x, random.below(128), 1, 1, {130, 80, 60});
  }
  return canvas;
}

Canvas leather(std::uint64_t seed) {
  Random random(seed);
  Canvas canvas(128, 128, random_color(random, 25, 120));
  canvas.noise(0.3, 16, 16, seed + 1);
  canvas.noise(0.2, 4, 4, seed + 2);
  canvas.rectangle(0, 100, 128, 108, {220, 216, 208});
  for (int y = 20; y < 90; y += 12) canvas.line(50, y, 78, y + 4, 2, {225, 225, 220});
  return canvas;
}

}  // namespace stillpoint::synthetic
