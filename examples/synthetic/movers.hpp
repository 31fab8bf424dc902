// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "synthetic/room.hpp"

namespace stillpoint::synthetic {

/// Most movers: 1 = a carton pushed to and fro before the camera, 2 = also a door that swings.
constexpr int kMostMovers = 2;

/// Things that move although no network has a name for them. Without movers the door stands closed
/// at its partition and the carton is not there.
class Movers {
 public:
  Movers(const RoomPlan& plan, int count, std::uint64_t seed) : plan_(plan), count_(count) {
    phase_ = uniform(hash(seed, 0x0b0c5)), door_phase_ = uniform(hash(seed, 0xd002));
  }

  /// Appends the movers as they are at time `t_s`.
  void append(double t_s, const std::vector<Texture>& textures, MovingThings& out) const;

 private:
  RoomPlan plan_;
  int count_;
  double phase_, door_phase_;
};

}  // namespace stillpoint::synthetic
