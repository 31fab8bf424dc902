// SPDX-License-Identifier: BSD-2-Clause
#include "synthetic/room.hpp"

namespace stillpoint::synthetic {

namespace {

/// Walls, floor, ceiling and lamps.
void build_walls(StaticScene& scene, Furnisher& make, const RoomExtent& room) {
  const double width = 2 * room.half_x, length = room.y1 - room.y0,
               middle = (room.y0 + room.y1) / 2;
  const auto wall = [&](Vec3 corner, Vec3 u, Vec3 v, int texture, float texels_per_m,
                        std::array<float, 3> tint) {
    Quad q;
    q.corner = corner, q.edge_u = u, q.edge_v = v, q.texture = texture, q.tint = tint;
    q.texels_along_u = static_cast<float>(norm(u)) * texels_per_m;
    q.texels_along_v = static_cast<float>(norm(v)) * texels_per_m;
    scene.quads.push_back(q);
  };
  const double e = 0.02;  // walls reach a little beyond the corners: no cracks
  const std::array<float, 3> paints[4] = {
      {{1, 1, 1}}, {{0.75f, 0.86f, 0.95f}}, {{0.95f, 0.9f, 0.78f}}, {{0.82f, 0.92f, 0.8f}}};
  wall({-room.half_x - e, room.y1, room.height + e}, {width + 2 * e, 0, 0},
       {0, 0, -room.height - 2 * e}, make.plaster_texture(), 170, paints[0]);
  wall({room.half_x, room.y1 + e, room.height + e}, {0, -length - 2 * e, 0},
       {0, 0, -room.height - 2 * e}, make.plaster_texture(), 170, paints[1]);
  wall({room.half_x + e, room.y0, room.height + e}, {-width - 2 * e, 0, 0},
       {0, 0, -room.height - 2 * e}, make.plaster_texture(), 170, paints[2]);
  wall({-room.half_x, room.y0 - e, room.height + e}, {0, length + 2 * e, 0},
       {0, 0, -room.height - 2 * e}, make.plaster_texture(), 170, paints[3]);
  wall({-room.half_x - e, room.y1 + e, 0}, {width + 2 * e, 0, 0}, {0, -length - 2 * e, 0},
       make.carpet_texture(), 330, {{1, 1, 1}});
  scene.quads.back().floor = true;
  wall({-room.half_x - e, room.y0 - e, room.height}, {width + 2 * e, 0, 0}, {0, length + 2 * e, 0},
       make.ceiling_texture(), 420, {{1, 1, 1}});
  for (int i = 0; i < 6; ++i) {  // lamps
    const Frame f =
        placed((i % 3 - 1) * room.half_x * 0.6, middle + (i / 3 - 0.5) * length * 0.5, room.height);
    Quad q;
    q.corner = f.to_world({-0.6, -0.3, -0.01}), q.edge_u = {1.2, 0, 0}, q.edge_v = {0, 0.6, 0};
    q.texture = make.plaster_texture(), q.texels_along_u = 60, q.texels_along_v = 30, q.glow = 1.7f;
    scene.quads.push_back(q);
  }
}

/// Furniture along a wall: `f` in the middle of the wall's foot, facing the room.
void furnish_wall(Furnisher& make, const Frame& f, double wide, double deepest) {
  Random& random = make.random();
  make.box(moved(f, {0, -0.008, 0}), {wide, 0.016, 0.09}, make.oak_texture(), 300);
  for (double x = -wide / 2 + 0.15; x < wide / 2 - 0.5;) {
    const double left = wide / 2 - 0.1 - x, depth = std::min(deepest, random.range(0.28, 0.5));
    const int kind = random.below(6);
    double w = std::min(left, random.range(0.8, 1.3));
    const Frame at = moved(f, {x + w / 2, -depth / 2 - 0.02, 0});
    const Frame above = moved(f, {x + w / 2, -0.012, 0});
    if (kind < 2) {
      make.bookcase(at, w, random.range(1.5, 2.25), std::min(depth, 0.34));
    } else if (kind == 2) {
      make.cabinet(at, w, depth, random.range(0.7, 1.2));
      make.poster_on(moved(above, {0, 0, 1.95}), true);
    } else if (kind == 3) {
      for (int i = 0; i < 2; ++i) {
        const double slip = random.range(-0.05, 0.05), turn = random.range(-0.06, 0.06);
        make.box(moved(at, {slip, 0, 0.36 * i}, turn), {std::min(w, 0.6), depth * 0.85, 0.36},
                 make.carton_texture(), 0);
      }
      make.poster_on(moved(above, {0, 0, 1.55}), false);
    } else if (kind == 4) {
      const double half = w / 4;
      make.poster_on(moved(above, {-half, 0, random.range(1.35, 1.6)}), false);
      make.photo_on(moved(above, {half, 0, random.range(1.15, 1.3)}));
      make.photo_on(moved(above, {half, 0, random.range(1.75, 2.1)}));
      make.clutter(moved(f, {x + w / 2, -0.2, 0}), w, 0.35, 0.6);
    } else {
      make.poster_on(moved(above, {0, 0, 1.5}), true);
      make.photo_on(moved(above, {-0.3, 0, 2.15}));
      make.photo_on(moved(above, {0.3, 0, 2.15}));
      make.cabinet(at, w, depth, 0.6);
    }
    x += w + random.range(0.02, 0.12);
  }
}

}  // namespace

RoomPlan build_room(StaticScene& scene, std::uint64_t seed, bool pillar) {
  RoomPlan plan;
  Furnisher make(scene, hash(seed, 0xf00d));
  const RoomExtent room = plan.extent;
  const double width = 2 * room.half_x, length = room.y1 - room.y0,
               middle = (room.y0 + room.y1) / 2;
  build_walls(scene, make, room);
  furnish_wall(make, placed(0, room.y1, 0), width - 0.6, 0.34);
  furnish_wall(make, placed(room.half_x, middle, 0, -1), length - 0.6, 0.5);
  furnish_wall(make, placed(0, room.y0, 0, 2), width - 0.6, 0.45);
  furnish_wall(make, placed(-room.half_x, middle, 0, 1), length - 0.6, 0.5);

  // A low table.
  make.box(placed(0.2, -0.62, 0.47), {1.1, 0.42, 0.03}, make.oak_texture(), 300);
  for (const double side : {-1.0, 1.0})
    make.box(placed(0.2 + 0.5 * side, -0.62, 0), {0.04, 0.38, 0.47}, make.oak_texture());
  make.clutter(placed(0.2, -0.55, 0.5), 1.05, 0.24, 0.4);

  // The island with monitors, back and front, and chairs around.
  make.desk(placed(0, 0.72, 0), 1.8, 0.7, 3);
  plan.seats = {placed(1.15, -1.0, 0, -0.5), placed(-1.25, 0.75, 0, 1.15),
                placed(1.25, 0.75, 0, -1.15)};
  for (const Frame& seat : plan.seats) make.chair(seat);

  // A cabinet at the right, a partition with the door at the left.
  make.cabinet(placed(1.75, -0.9, 0, -0.1), 0.45, 0.5, 0.95);
  const Frame partition = placed(-1.7, -0.46, 0);
  make.box(partition, {0.9, 0.05, 2.05}, make.plaster_texture(), 170, {{0.8f, 0.75f, 0.65f}});
  for (int i = 0; i < 2; ++i) {
    make.photo_on(moved(partition, {0.2 * (2 * i - 1), 0.04, 1.5 - 0.3 * i}, 2));
  }
  plan.hinge = placed(-1.25, -0.52, 0);
  plan.door_texture = make.door_texture(), plan.carton_texture = make.carton_texture();

  if (pillar) make.box(placed(0, -2.1, 0), {0.4, 0.1, 2.6}, make.plaster_texture(), 170);

  make_light_maps(scene, room);
  return plan;
}

}  // namespace stillpoint::synthetic
