// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "stillpoint/testing/synthetic_room.hpp"

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
  void append(double t_s, const std::vector<Texture>& textures, MovingThings& out) const {
    if (count_ > 0) {
      // Pushed from side to side at up to 0.75 m/s, standing a moment at each end.
      const double way = cosine(2 * kPi * (t_s / 9.5 + 0.15 * phase_));
      const double x = -1.15 * (way + 0.12 * sine(4 * kPi * (t_s / 9.5))), turn = 0.06 * way;
      Quad pattern;
      pattern.label = static_cast<std::uint8_t>(kFirstMoverLabel);
      append_box(out.quads, placed(x, -1.62, 0.01, turn), {0.78, 0.46, 1.36}, plan_.carton_texture,
                 textures, 0, pattern, false);
      out.shadows.push_back({x, -1.62, 0.75, 0.6});
    }
    // The leaf opens from the partition (along -x) past -y toward +x.
    const double opening =
        count_ > 1 ? 0.5 - 0.5 * cosine(2 * kPi * (t_s / 6.0 + 0.2 * door_phase_)) : 0;
    const Frame hinge = moved(plan_.hinge, {0, 0, 0}, 2 + 1.75 * opening);
    Quad pattern;
    pattern.label = static_cast<std::uint8_t>(count_ > 1 ? kFirstMoverLabel + 1 : 0);
    append_box(out.quads, moved(hinge, {plan_.door_width_m / 2, 0, 0.02}),
               {plan_.door_width_m, 0.045, plan_.door_height_m}, plan_.door_texture, textures, 0,
               pattern);
  }

 private:
  RoomPlan plan_;
  int count_;
  double phase_, door_phase_;
};

}  // namespace stillpoint::synthetic
