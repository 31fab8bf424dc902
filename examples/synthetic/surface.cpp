// SPDX-License-Identifier: BSD-2-Clause
#include "synthetic/surface.hpp"

namespace stillpoint::synthetic {

float open_light(Vec3 n) {
  const double from_above = 0.55 * n.z;
  const double from_window = 0.28 * std::max(0.0, dot(n, Vec3{0.55, -0.78, 0.3}));
  const double from_lamp = 0.20 * std::max(0.0, dot(n, Vec3{-0.6, 0.6, 0.53}));
  return static_cast<float>(0.62 + 0.5 * from_above + from_window + from_lamp);
}

void append_box(std::vector<Quad>& quads, const Frame& frame, Vec3 size, int texture,
                const std::vector<Texture>& textures, float texels_per_m, Quad pattern,
                bool with_bottom) {
  const Vec3 h{size.x / 2, size.y / 2, size.z};
  const auto face = [&](Vec3 corner, Vec3 u, Vec3 v, int number) {
    Quad quad = pattern;
    quad.corner = frame.to_world(corner);
    quad.edge_u = frame.rotate(u), quad.edge_v = frame.rotate(v);
    quad.texture = texture;
    const Texture& t = textures[static_cast<std::size_t>(texture)];
    if (texels_per_m > 0) {
      quad.texel_u = pattern.texel_u + static_cast<float>(number * 37);
      quad.texel_v = pattern.texel_v + static_cast<float>(number * 71);
      quad.texels_along_u = static_cast<float>(norm(u)) * texels_per_m;
      quad.texels_along_v = static_cast<float>(norm(v)) * texels_per_m;
    } else {
      quad.texel_u = quad.texel_v = 0;
      quad.texels_along_u = static_cast<float>(t.width());
      quad.texels_along_v = static_cast<float>(t.height());
    }
    quads.push_back(quad);
  };
  const Vec3 x{size.x, 0, 0}, y{0, size.y, 0}, down{0, 0, -size.z};
  face({-h.x, -h.y, h.z}, x, down, 0);
  face({h.x, -h.y, h.z}, y, down, 1);
  face({h.x, h.y, h.z}, -x, down, 2);
  face({-h.x, h.y, h.z}, -y, down, 3);
  face({-h.x, h.y, h.z}, x, -y, 4);
  if (with_bottom) face({-h.x, -h.y, 0}, x, y, 5);
}

}  // namespace stillpoint::synthetic
