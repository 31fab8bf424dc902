// SPDX-License-Identifier: BSD-2-Clause
#include "synthetic/furniture.hpp"

namespace stillpoint::synthetic {

Frame placed(double x, double y, double z, double turns) {
  const double c = cosine(turns * kPi / 2), s = sine(turns * kPi / 2);
  Frame f;
  f.x = {c, s, 0}, f.y = {-s, c, 0}, f.origin = {x, y, z};
  return f;
}

Frame moved(const Frame& f, Vec3 offset, double turns) {
  const double c = cosine(turns * kPi / 2), s = sine(turns * kPi / 2);
  Frame g;
  g.x = f.rotate({c, s, 0}), g.y = f.rotate({-s, c, 0}), g.z = f.z, g.origin = f.to_world(offset);
  return g;
}

Furnisher::Furnisher(StaticScene& scene, std::uint64_t seed) : scene_(scene), random_(seed) {
  plaster_ = paint(plaster(random_.bits()));
  carpet_ = paint(carpet(random_.bits()));
  ceiling_ = paint(ceiling(random_.bits()));
  oak_ = paint(wood({196, 146, 92}, random_.bits()));
  dark_wood_ = paint(wood({110, 70, 44}, random_.bits()));
  gray_ = paint(wood({150, 152, 156}, random_.bits()));
  door_ = paint(door(random_.bits()));
  for (int i = 0; i < 9; ++i) posters_.push_back(paint(poster(256, 512, random_.bits())));
  for (int i = 0; i < 4; ++i) posters_wide_.push_back(paint(poster(512, 256, random_.bits())));
  for (int i = 0; i < 8; ++i) photos_.push_back(paint(framed_photo(256, 256, random_.bits())));
  for (int i = 0; i < 7; ++i) books_.push_back(paint(books(1024, 128, random_.bits())));
  for (int i = 0; i < 4; ++i) cartons_.push_back(paint(carton(random_.bits())));
  for (int i = 0; i < 5; ++i) screens_.push_back(paint(screen(random_.bits())));
  for (int i = 0; i < 5; ++i) sheets_.push_back(paint(sheet(random_.bits())));
}

void Furnisher::box(const Frame& frame, Vec3 size, int texture, float texels_per_m,
                    std::array<float, 3> tint, bool hole_prone) {
  Quad pattern;
  pattern.tint = tint, pattern.hole_prone = hole_prone;
  pattern.texel_u = static_cast<float>(random_.below(512));
  pattern.texel_v = static_cast<float>(random_.below(256));
  append_box(scene_.quads, frame, size, texture, scene_.textures, texels_per_m, pattern,
             frame.origin.z > 0.05);
  if (size.x * size.y * size.z > 2e-4) scene_.occluders.push_back({frame, size});
}

void Furnisher::panel(const Frame& frame, double width, double height, int texture, bool hole_prone,
                      float glow) {
  Quad q;
  const Texture& t = scene_.textures[static_cast<std::size_t>(texture)];
  q.corner = frame.to_world({-width / 2, 0, height / 2});
  q.edge_u = frame.rotate({width, 0, 0}), q.edge_v = frame.rotate({0, 0, -height});
  q.texture = texture, q.hole_prone = hole_prone, q.glow = glow;
  q.texels_along_u = static_cast<float>(t.width());
  q.texels_along_v = static_cast<float>(t.height());
  scene_.quads.push_back(q);
}

void Furnisher::sheet_on(const Frame& frame, double width, double depth, int texture) {
  Quad q;
  const Texture& t = scene_.textures[static_cast<std::size_t>(texture)];
  q.corner = frame.to_world({-width / 2, depth / 2, 0.003});
  q.edge_u = frame.rotate({width, 0, 0}), q.edge_v = frame.rotate({0, -depth, 0});
  q.texture = texture;
  q.texels_along_u = static_cast<float>(t.width());
  q.texels_along_v = static_cast<float>(t.height());
  scene_.quads.push_back(q);
}

void Furnisher::round(const Frame& frame, double height, double radius0, double radius1,
                      int texture, std::array<float, 3> tint) {
  RoundPart part;
  part.frame = frame;
  part.length = height, part.radius0 = radius0, part.radius1 = radius1;
  part.texture = texture, part.tint = tint;
  part.texels_around = 256, part.texels_along = 256;
  scene_.parts.push_back(part);
  scene_.occluders.push_back({frame, {1.5 * radius0, 1.5 * radius0, height}});
}

void Furnisher::bookcase(const Frame& f, double width, double height, double depth) {
  const int wood = random_.below(2) ? oak_ : dark_wood_;
  box(moved(f, {-width / 2 + 0.015, 0, 0}), {0.03, depth, height}, wood);
  box(moved(f, {width / 2 - 0.015, 0, 0}), {0.03, depth, height}, wood);
  box(moved(f, {0, depth / 2 - 0.01, 0}), {width - 0.06, 0.02, height}, wood);
  const int shelves = static_cast<int>(height / 0.34);
  const double step = (height - 0.03) / shelves;
  for (int i = 0; i <= shelves; ++i) {
    const double z = i * step;
    box(moved(f, {0, 0, z}), {width - 0.06, depth, 0.03}, wood);
    if (i == shelves) break;
    const double room = step - 0.05, inner = width - 0.07;
    if (random_.below(5) == 0) {
      clutter(moved(f, {0, 0, z + 0.03}), inner, depth - 0.04, room);
      continue;
    }
    const double part = random_.below(3) ? inner : inner * random_.range(0.45, 0.8);
    Quad q;
    const double y = -depth / 2 + random_.range(0.02, 0.06);
    q.corner = f.to_world({-inner / 2, y, z + 0.03 + room * 0.92});
    q.edge_u = f.rotate({part, 0, 0}), q.edge_v = f.rotate({0, 0, -room * 0.92});
    q.texture = pick(books_);
    q.texel_u = static_cast<float>(random_.below(1024));
    q.texels_along_u = static_cast<float>(part * 480);
    q.texels_along_v = 128;
    scene_.quads.push_back(q);
    if (part < inner - 0.15)
      clutter(moved(f, {(part) / 2, 0, z + 0.03}), inner - part - 0.04, depth - 0.06, room);
  }
}

void Furnisher::clutter(const Frame& f, double width, double depth, double height) {
  for (double x = -width / 2; x < width / 2 - 0.08;) {
    const double w = std::min(width / 2 - x, random_.range(0.1, 0.3));
    const Frame at = moved(f, {x + w / 2, random_.range(-0.1, 0.1) * depth, 0});
    const double d = std::min(depth * 0.8, random_.range(0.1, 0.25));
    const double h = std::min(height * 0.95, random_.range(0.08, 0.32));
    const int kind = random_.below(5);
    const std::array<float, 3> color = tint(kind > 2 ? 0.6 : 0.5);
    const double turn = random_.range(-0.1, 0.1);
    switch (kind) {
      case 0:
        round(moved(at, {0, 0, 0.01}), h * 0.7, std::min(w, d) * 0.28, std::min(w, d) * 0.36,
              pick(photos_), color);
        break;
      case 1:
        for (double z = 0; z < h - 0.03; z += 0.035) {
          const Frame layer =
              moved(at, {random_.range(-0.01, 0.01), 0, z}, turn * (z > 0.07 ? -1 : 0.5));
          box(layer, {w * 0.85, d * 0.8, 0.033}, plaster_, 500, tint());
        }
        break;
      case 2:
        panel(moved(at, {0, -d * 0.2, h / 2}), w * 0.9, h, pick(photos_));
        box(moved(at, {0, -d * 0.2 + 0.02, 0}), {w * 0.9, 0.03, h}, dark_wood_);
        break;
      default:
        box(moved(at, {0, 0, 0}, turn), {w * 0.85, d, h}, pick(cartons_), 0, color);
    }
    x += w + random_.range(0.0, 0.06);
  }
}

void Furnisher::desk(const Frame& f, double width, double depth, int monitors) {
  const double top = 0.73;
  box(moved(f, {0, 0, top - 0.03}), {width, depth, 0.03}, oak_);
  for (const double sx : {-1.0, 1.0})
    for (const double sy : {-1.0, 1.0})
      box(moved(f, {sx * (width / 2 - 0.04), sy * (depth / 2 - 0.04), 0}), {0.05, 0.05, top - 0.03},
          gray_);
  for (int i = 0; i < monitors; ++i) {
    const double x = (i + 0.5) * width / monitors - width / 2 + random_.range(-0.06, 0.06);
    const Frame m = moved(f, {x, depth * 0.2, top}, random_.range(-0.2, 0.2));
    box(m, {0.2, 0.16, 0.02}, gray_, 300, {{0.2f, 0.2f, 0.2f}}, true);
    box(moved(m, {0, 0.03, 0.02}), {0.05, 0.03, 0.16}, gray_, 300, {{0.2f, 0.2f, 0.2f}}, true);
    box(moved(m, {0, 0, 0.12}), {0.54, 0.04, 0.33}, gray_, 300, {{0.12f, 0.12f, 0.13f}}, true);
    panel(moved(m, {0, -0.024, 0.285}), 0.51, 0.3, pick(screens_), true, 0.62f);
    const Frame keyboard = moved(f, {x, -depth * 0.22, top}, random_.range(-0.1, 0.1));
    box(keyboard, {0.42, 0.14, 0.02}, pick(sheets_), 0, {{0.35f, 0.35f, 0.38f}});
  }
  for (int i = 0; i < 6; ++i) {
    const double x = random_.range(-0.45, 0.45) * width, y = random_.range(-0.35, 0.3) * depth;
    const Frame at = moved(f, {x, y, top + 0.001 * i}, random_.range(-1, 1));
    sheet_on(at, 0.21, 0.3, pick(sheets_));
  }
  clutter(moved(f, {0, depth * 0.38, top}), width * 0.9, depth * 0.25, 0.3);
}

void Furnisher::chair(const Frame& f) {
  const std::array<float, 3> cloth = tint(0.35);
  box(moved(f, {0, 0, 0.42}), {0.44, 0.42, 0.04}, carpet_, 700, cloth, true);
  box(moved(f, {0, 0.2, 0.5}), {0.42, 0.03, 0.42}, carpet_, 700, cloth, true);
  for (const double sx : {-1.0, 1.0})
    for (const double sy : {-1.0, 1.0})
      box(moved(f, {sx * 0.19, sy * 0.18, 0}), {0.03, 0.03, sy > 0 ? 0.6 : 0.42}, dark_wood_);
}

void Furnisher::cabinet(const Frame& f, double width, double depth, double height) {
  const int front = random_.below(2) ? gray_ : oak_;
  box(f, {width, depth, height}, front, 300, tint(0.25));
  const int drawers = std::max(1, static_cast<int>(height / 0.32));
  for (int i = 0; i < drawers; ++i) {
    const double h = height / drawers, z = (i + 0.5) * h;
    Quad q;
    q.corner = f.to_world({-width / 2 + 0.02, -depth / 2 - 0.006, z + h / 2 - 0.02});
    q.edge_u = f.rotate({width - 0.04, 0, 0}), q.edge_v = f.rotate({0, 0, 0.04 - h});
    q.texture = random_.below(2) ? oak_ : gray_;
    q.texel_u = static_cast<float>(random_.below(500));
    q.texels_along_u = static_cast<float>(width * 300);
    q.texels_along_v = static_cast<float>(h * 300);
    scene_.quads.push_back(q);
    panel(moved(f, {0, -depth / 2 - 0.012, z}), 0.12, 0.07, pick(sheets_));
  }
  clutter(moved(f, {0, 0, height}), width * 0.95, depth * 0.8, 0.4);
}

}  // namespace stillpoint::synthetic
