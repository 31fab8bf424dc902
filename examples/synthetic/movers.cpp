// SPDX-License-Identifier: BSD-2-Clause
#include "synthetic/movers.hpp"

namespace stillpoint::synthetic {

void Movers::append(double t_s, const std::vector<Texture>& textures, MovingThings& out) const {
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

}  // namespace stillpoint::synthetic
