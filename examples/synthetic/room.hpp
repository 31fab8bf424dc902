// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <vector>

#include "synthetic/furniture.hpp"

namespace stillpoint::synthetic {

/// Where people may sit, and what the movers need of the room.
struct RoomPlan {
  RoomExtent extent;
  /// Seats: origin on the floor below the seat's middle, the sitter looks toward -y.
  std::vector<Frame> seats;
  /// The hinge of the door: origin on the floor, leaf along +x when closed, seen from -y.
  Frame hinge;
  double door_width_m = 0.85, door_height_m = 2.0;
  int door_texture = 0, carton_texture = 0;
};

/// An office of 9.8 x 8.1 m. From the camera's place at (0, -2.9), looking along +y: a chair and a
/// cabinet at 2 m, a low table and a partition at 2.4 m, a desk with monitors at 3.8 m, walls with
/// bookcases, posters and photos at 7 m. Between them lie the lanes on which people walk
/// (synthetic_people.hpp), and a corridor of the camera around all of it.
/// With `pillar`, one stands 0.8 m before the camera, 0.4 m wide.
RoomPlan build_room(StaticScene& scene, std::uint64_t seed, bool pillar = false);

}  // namespace stillpoint::synthetic
