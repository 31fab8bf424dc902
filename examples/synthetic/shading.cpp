// SPDX-License-Identifier: BSD-2-Clause
#include "synthetic/shading.hpp"

namespace stillpoint::synthetic {

void Shader::add(const Rasterizer& raster, float weight, float dither,
                 std::vector<float>& sum) const {
  const int width = raster.camera().width, height = raster.camera().height;
  for (int y = 0; y < height; ++y) {
    const int* ids = raster.surface_row(y);
    float* row = sum.data() + static_cast<std::size_t>(3 * width) * static_cast<std::size_t>(y);
    for (int x = 0; x < width;) {
      int end = x + 1;
      while (end < width && ids[end] == ids[x]) ++end;
      if (ids[x] != Rasterizer::kNothing) {
        if (raster.is_part(ids[x]))
          add_part(raster, ids[x], x, end, y, weight, dither, row);
        else
          add_quad(raster, ids[x], x, end, y, weight, dither, row);
      }
      x = end;
    }
  }
}

void Shader::add_quad(const Rasterizer& raster, int id, int begin, int end, int y, float weight,
                      float dither, float* row) const {
  const Quad& quad = raster.quad(id);
  const Rasterizer::Plane& plane = raster.plane(id);
  const Texture& texture = raster.fixed().textures[static_cast<std::size_t>(quad.texture)];
  const float* inverse_depth = raster.inverse_depth_row(y);
  const auto ux = static_cast<float>(plane.u.x), vx = static_cast<float>(plane.v.x);
  const auto u0 = static_cast<float>(plane.u.y * y + plane.u.c);
  const auto v0 = static_cast<float>(plane.v.y * y + plane.v.c);
  const auto u_at = [&](int x) { return (u0 + ux * static_cast<float>(x)) / inverse_depth[x]; };
  const auto v_at = [&](int x) { return (v0 + vx * static_cast<float>(x)) / inverse_depth[x]; };
  const float open = quad.light_map.columns > 0 || quad.glow > 0 ? 0 : open_light(quad.normal());
  for (int x0 = begin; x0 < end; x0 += kChunk) {
    const int x1 = std::min(end, x0 + kChunk), middle = (x0 + x1) / 2;
    const int level = level_for(texture, footprint(quad, plane, middle, y), dither);
    const float ua = clamp(u_at(x0)), va = clamp(v_at(x0));
    const float ub = clamp(u_at(x1 - 1)), vb = clamp(v_at(x1 - 1));
    float light = quad.glow > 0 ? quad.glow : open, step = 0;
    if (quad.light_map.columns > 0) {
      light = quad.light_map.at(ua, va);
      if (x1 - 1 > x0) step = (quad.light_map.at(ub, vb) - light) / static_cast<float>(x1 - 1 - x0);
    }
    if (quad.floor && !raster.moving().shadows.empty()) {
      const float a = shadow(raster, quad, ua, va), b = shadow(raster, quad, ub, vb);
      const float last = (light + step * static_cast<float>(x1 - 1 - x0)) * b;
      light *= a;
      if (x1 - 1 > x0) step = (last - light) / static_cast<float>(x1 - 1 - x0);
    }
    light *= weight, step *= weight;
    for (int x = x0; x < x1; ++x) {
      const float u = clamp(u_at(x)), v = clamp(v_at(x));
      const std::uint32_t texel =
          texture.sample(quad.texel_u + u * quad.texels_along_u + border(texture.width()),
                         quad.texel_v + v * quad.texels_along_v + border(texture.height()), level);
      put(row + 3 * x, texel, quad.tint, light + step * static_cast<float>(x - x0));
    }
  }
}

float Shader::footprint(const Quad& quad, const Rasterizer::Plane& plane, int x, int y) {
  const double w = plane.inverse_depth.at(x, y), u = plane.u.at(x, y) / w, v = plane.v.at(x, y) / w;
  const double su = quad.texels_along_u / w, sv = quad.texels_along_v / w;
  const double ux = (plane.u.x - u * plane.inverse_depth.x) * su;
  const double uy = (plane.u.y - u * plane.inverse_depth.y) * su;
  const double vx = (plane.v.x - v * plane.inverse_depth.x) * sv;
  const double vy = (plane.v.y - v * plane.inverse_depth.y) * sv;
  const double sum = ux * ux + uy * uy + vx * vx + vy * vy, area = std::abs(ux * vy - uy * vx);
  const double spread = std::sqrt(std::max(0.0, sum * sum - 4 * area * area));
  const double wide = std::sqrt((sum + spread) / 2);
  const double narrow = wide > 0 ? area / wide : 0;
  return static_cast<float>(std::max(narrow, wide * 0.2));
}

float Shader::shadow(const Rasterizer& raster, const Quad& quad, float u, float v) {
  const Vec3 p = quad.point(u, v);
  double light = 1;
  for (const ShadowSpot& spot : raster.moving().shadows) {
    const double dx = p.x - spot.x, dy = p.y - spot.y;
    const double q = (dx * dx + dy * dy) / (spot.radius_m * spot.radius_m);
    if (q < 1) light *= 1 - spot.strength * (1 - q) * (1 - q);
  }
  return static_cast<float>(light);
}

void Shader::add_part(const Rasterizer& raster, int id, int begin, int end, int y, float weight,
                      float dither, float* row) const {
  const RoundPart& part = raster.part(id);
  const Rasterizer::Round& round = raster.round(id);
  const Texture& texture = raster.fixed().textures[static_cast<std::size_t>(part.texture)];
  const float* inverse_depth = raster.inverse_depth_row(y);
  float s0[3], sx[3], d0[3], dx[3];
  for (int i = 0; i < 3; ++i) {
    s0[i] = static_cast<float>(round.start[i].y * y + round.start[i].c);
    sx[i] = static_cast<float>(round.start[i].x);
    d0[i] = static_cast<float>(round.direction[i].y * y + round.direction[i].c);
    dx[i] = static_cast<float>(round.direction[i].x);
  }
  const auto base = static_cast<float>(round.depth0);
  const auto r0 = static_cast<float>(part.radius0), length = static_cast<float>(part.length);
  const auto r1 = static_cast<float>(part.radius1), sine = static_cast<float>(round.sine);
  const float whole = length + r0 + r1;
  const auto inverse_x = static_cast<float>(1 / part.stretch_x);
  const auto inverse_y = static_cast<float>(1 / part.stretch_y);
  const float around = 6.2832f * std::max(r0, r1);
  const float density = std::max(part.texels_around / around, part.texels_along / whole) /
                        static_cast<float>(raster.camera().fx);
  const int level = level_for(texture, density / inverse_depth[begin], dither);
  for (int x = begin; x < end; ++x) {
    const float t = 1 / inverse_depth[x] - base, px = static_cast<float>(x);
    const float p = s0[0] + sx[0] * px + t * (d0[0] + dx[0] * px);
    const float q = s0[1] + sx[1] * px + t * (d0[1] + dx[1] * px);
    const float r = s0[2] + sx[2] * px + t * (d0[2] + dx[2] * px);
    const float u = (angle_in_turns(q, p) + 0.5f) * part.texels_around;
    const float v = clamp((length + r1 - r) / whole) * part.texels_along;
    const std::uint32_t texel = texture.sample(part.texel_u + u + border(texture.width()),
                                               part.texel_v + v + border(texture.height()), level);
    // The normal: away from the axis on the cone, from the end's centre on the ends.
    const float flat = std::sqrt(p * p + q * q);
    float along = r < r0 * sine ? r : r > length + r1 * sine ? r - length : flat * sine;
    const float nx = p * inverse_x, ny = q * inverse_y;
    const float n = std::sqrt(nx * nx + ny * ny + along * along);
    const float scale = n > 0 ? 1 / n : 0;
    along *= scale;
    const Frame& f = part.frame;
    const Vec3 normal = f.x * static_cast<double>(nx * scale) +
                        f.y * static_cast<double>(ny * scale) + f.z * static_cast<double>(along);
    put(row + 3 * x, texel, part.tint, open_light(normal) * weight);
  }
}

}  // namespace stillpoint::synthetic
