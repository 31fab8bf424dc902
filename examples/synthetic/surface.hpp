// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "stillpoint/testing/labels.hpp"
#include "synthetic/math.hpp"
#include "synthetic/texture.hpp"

namespace stillpoint::synthetic {

/// Light that falls on a static quad, on a grid of columns x rows over its two edges.
struct LightMap {
  int columns = 0, rows = 0;
  std::vector<float> light;

  /// Bilinear light at (u, v) of [0, 1] each.
  float at(float u, float v) const {
    const float x = u * static_cast<float>(columns - 1), y = v * static_cast<float>(rows - 1);
    const int x0 = std::min(columns - 2, std::max(0, static_cast<int>(x)));
    const int y0 = std::min(rows - 2, std::max(0, static_cast<int>(y)));
    const float wx = x - static_cast<float>(x0), wy = y - static_cast<float>(y0);
    const float* p = light.data() + y0 * columns + x0;
    const float top = p[0] + (p[1] - p[0]) * wx;
    const float bottom = p[columns] + (p[columns + 1] - p[columns]) * wx;
    return top + (bottom - top) * wy;
  }
};

/// A textured rectangle. Seen from its front, `edge_u` points right and `edge_v` down; its back is
/// not drawn.
struct Quad {
  Vec3 corner, edge_u, edge_v;
  /// Index into the scene's textures, and the texels at the corner and along each edge (not
  /// negative).
  int texture = 0;
  float texel_u = 0, texel_v = 0, texels_along_u = 1, texels_along_v = 1;
  /// Multiplies the texture's light.
  std::array<float, 3> tint{{1, 1, 1}};
  /// 0 = the static world, 1.. = people, kFirstMoverLabel.. = movers.
  std::uint8_t label = 0;
  /// Dark or shiny: a depth camera often gets no answer.
  bool hole_prone = false;
  /// Receives the soft shadows under people.
  bool floor = false;
  /// Shines by itself; 0 = not.
  float glow = 0;
  LightMap light_map;

  Vec3 normal() const { return normalized(cross(edge_v, edge_u)); }
  Vec3 point(double u, double v) const { return corner + edge_u * u + edge_v * v; }
};

/// A round part: all points within a radius that runs from `radius0` at the frame's origin to
/// `radius1` at `length` along the frame's z axis, stretched along x and y.
struct RoundPart {
  Frame frame;
  double length = 0.1, radius0 = 0.1, radius1 = 0.1, stretch_x = 1, stretch_y = 1;
  int texture = 0;
  /// Texels around the whole part and along it, and where the texture begins.
  float texel_u = 0, texel_v = 0, texels_around = 64, texels_along = 64;
  std::array<float, 3> tint{{1, 1, 1}};
  std::uint8_t label = 0;
  Limb limb = kNoLimb;
  bool hole_prone = false;
};

/// Something that throws shadow when the light maps are made: a box in a frame, centre of its base
/// at the origin.
struct Occluder {
  Frame frame;
  Vec3 size;
};

/// A soft dark spot under a person's foot or body.
struct ShadowSpot {
  double x = 0, y = 0, radius_m = 0.3, strength = 0.5;
};

/// What moves, at one instant.
struct MovingThings {
  std::vector<Quad> quads;
  std::vector<RoundPart> parts;
  std::vector<ShadowSpot> shadows;
};

/// What stands still, with the textures of everything. Immutable once built.
struct StaticScene {
  std::vector<Texture> textures;
  std::vector<Quad> quads;
  std::vector<RoundPart> parts;
  std::vector<Occluder> occluders;
};

/// Light on a surface that has no light map: lamps at the ceiling, bright floor and walls around.
float open_light(Vec3 n);

/// The six faces of a box (base centre at the frame's origin), textured by 0..1 per face or by
/// metres; see `texels_per_m`. `texels_per_m` = 0 stretches the whole texture over each face.
void append_box(std::vector<Quad>& quads, const Frame& frame, Vec3 size, int texture,
                const std::vector<Texture>& textures, float texels_per_m, Quad pattern = {},
                bool with_bottom = true);

}  // namespace stillpoint::synthetic
