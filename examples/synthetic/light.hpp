// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>

#include "synthetic/surface.hpp"

/// Light maps of the static scene, made once: lamps at the ceiling with soft shadows, and ambient
/// light that furniture keeps off.
namespace stillpoint::synthetic {

/// The room's inside: -half_x..half_x, y0..y1, 0..height.
struct RoomExtent {
  double half_x = 4.9, y0 = -4.0, y1 = 4.1, height = 2.8;
};

/// True where the segment from `p` to `p + d` meets the box. The first millimetres at `p` do not
/// count, so that a surface does not shade itself.
bool is_blocked(const Occluder& box, Vec3 p, Vec3 d);

/// Length of the rays that ask how much of the surroundings is open.
constexpr double kAmbientReach = 0.7;

/// An occluder with the ball around it.
struct BoundedOccluder {
  Occluder box;
  Vec3 centre;
  double radius = 0;
};

/// True where any box lies between `p` and `p + d`; boxes whose ball the segment misses cost
/// little.
bool is_blocked(const std::vector<const BoundedOccluder*>& boxes, Vec3 p, Vec3 d);

/// Light at a point with normal `n`: 1 is white paper under the lamps. `near` are the boxes within
/// reach of the ambient rays, `large` those that throw visible shadows from afar. `seed` moves the
/// samples.
float light_at(const std::vector<const BoundedOccluder*>& near,
               const std::vector<const BoundedOccluder*>& large, const RoomExtent& room, Vec3 p,
               Vec3 n, std::uint64_t seed);

/// Gives every quad of the scene its light map; cells of about 0.25 m, at least 2 x 2 samples.
void make_light_maps(StaticScene& scene, const RoomExtent& room);

}  // namespace stillpoint::synthetic
