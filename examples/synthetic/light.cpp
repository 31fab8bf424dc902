// SPDX-License-Identifier: BSD-2-Clause
#include "synthetic/light.hpp"

namespace stillpoint::synthetic {

bool is_blocked(const Occluder& box, Vec3 p, Vec3 d) {
  const Vec3 o = p - box.frame.origin;
  const double start[3] = {dot(o, box.frame.x), dot(o, box.frame.y), dot(o, box.frame.z)};
  const double way[3] = {dot(d, box.frame.x), dot(d, box.frame.y), dot(d, box.frame.z)};
  const double low[3] = {-box.size.x / 2, -box.size.y / 2, 0};
  const double high[3] = {box.size.x / 2, box.size.y / 2, box.size.z};
  double near = 0.004 / std::max(1e-9, norm(d)), far = 1;
  for (int i = 0; i < 3; ++i) {
    if (way[i] < 1e-9 && way[i] > -1e-9) {
      if (start[i] < low[i] || start[i] > high[i]) return false;
      continue;
    }
    double a = (low[i] - start[i]) / way[i], b = (high[i] - start[i]) / way[i];
    if (a > b) std::swap(a, b);
    near = std::max(near, a), far = std::min(far, b);
    if (near >= far) return false;
  }
  return true;
}

bool is_blocked(const std::vector<const BoundedOccluder*>& boxes, Vec3 p, Vec3 d) {
  const double d2 = dot(d, d);
  for (const BoundedOccluder* b : boxes) {
    const Vec3 to = b->centre - p;
    const double along = std::clamp(dot(to, d), 0.0, d2), r2 = dot(to, to);
    // Squared distance of the centre from the segment's nearest point, times d2.
    if (r2 * d2 - 2 * along * dot(to, d) + along * along > b->radius * b->radius * d2) continue;
    if (is_blocked(b->box, p, d)) return true;
  }
  return false;
}

float light_at(const std::vector<const BoundedOccluder*>& near,
               const std::vector<const BoundedOccluder*>& large, const RoomExtent& room, Vec3 p,
               Vec3 n, std::uint64_t seed) {
  Random random(seed);
  double light = 0;
  constexpr int kLamps = 6, kAmbient = 10;
  for (int i = 0; i < kLamps; ++i) {
    const Vec3 lamp{(i % 3 - 1) * room.half_x * 0.6 + random.range(-0.6, 0.6),
                    (i / 3 - 0.5) * (room.y1 - room.y0) * 0.5 + random.range(-0.3, 0.3),
                    room.height - 0.02};
    const Vec3 d = lamp - p;
    const double r2 = dot(d, d), r = std::sqrt(r2), facing = dot(n, d) / r;
    if (facing <= 0 || is_blocked(near, p, d) || is_blocked(large, p, d)) continue;
    light += 1.35 * facing * (d.z / r) / (1 + r2);
  }
  double open = 0;
  for (int i = 0; i < kAmbient; ++i) {
    Vec3 d;
    do {
      d = {random.range(-1, 1), random.range(-1, 1), random.range(-1, 1)};
    } while (dot(d, d) > 1 || dot(d, d) < 0.01);
    d = normalized(normalized(d) + n * 1.02) * kAmbientReach;
    const Vec3 end = p + d;
    const bool outside = end.x < -room.half_x || end.x > room.half_x || end.y < room.y0 ||
                         end.y > room.y1 || end.z < 0 || end.z > room.height;
    open += outside ? 0.6 : is_blocked(near, p, d) ? 0.25 : 1;
  }
  return static_cast<float>(0.14 + 0.46 * open / kAmbient + light);
}

void make_light_maps(StaticScene& scene, const RoomExtent& room) {
  std::uint64_t number = 0;
  std::vector<BoundedOccluder> all;
  for (const Occluder& box : scene.occluders)
    all.push_back({box, box.frame.to_world({0, 0, box.size.z / 2}), norm(box.size) / 2});
  std::vector<const BoundedOccluder*> large, near;
  for (const BoundedOccluder& b : all)
    if (b.radius > 0.3) large.push_back(&b);
  for (Quad& quad : scene.quads) {
    ++number;
    if (quad.glow > 0) continue;
    const auto samples = [](double length_m) {
      return std::min(34, 2 + static_cast<int>(length_m / 0.28));
    };
    LightMap& map = quad.light_map;
    map.columns = samples(norm(quad.edge_u)), map.rows = samples(norm(quad.edge_v));
    const Vec3 n = quad.normal(), middle = quad.point(0.5, 0.5);
    const double half = norm(quad.edge_u + quad.edge_v) / 2;
    near.clear();
    for (const BoundedOccluder& b : all)
      if (norm(b.centre - middle) < half + b.radius + kAmbientReach) near.push_back(&b);
    for (int j = 0; j < map.rows; ++j)
      for (int i = 0; i < map.columns; ++i) {
        const double u = 0.02 + 0.96 * i / (map.columns - 1), v = 0.02 + 0.96 * j / (map.rows - 1);
        map.light.push_back(light_at(near, large, room, quad.point(u, v) + n * 0.006, n,
                                     hash(number, static_cast<std::uint64_t>(j * 64 + i))));
      }
  }
}

}  // namespace stillpoint::synthetic
