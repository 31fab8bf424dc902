// SPDX-License-Identifier: BSD-2-Clause
#include "synthetic/settings.hpp"

#include <sstream>

#include "stillpoint/core/error.hpp"
#include "synthetic/movers.hpp"
#include "synthetic/people.hpp"

namespace stillpoint {

namespace synthetic {

SyntheticSettings checked_settings(SyntheticSettings s) {
  const auto in_range = [](const char* name, double value, double low, double high) {
    detail::check(value >= low && value <= high, [&] {
      std::ostringstream text;
      text << "SyntheticSettings." << name << ": expected " << low << " to " << high << ", found "
           << value;
      return text.str();
    });
  };
  in_range("people", s.people, 0, s.movers > 0 ? 18 : kMostPeople);
  in_range("movers", s.movers, 0, kMostMovers);
  in_range("frames", s.frames, 0, 1e6);
  in_range("fps", s.fps, 1, 1000);
  in_range("shutter_s", s.shutter_s, 0, 2 / s.fps);
  in_range("color_noise", s.color_noise, 0, 50);
  in_range("start_s", s.start_s, 0, 1e10);
  in_range("width", s.width, 32, 8192);
  in_range("height", s.height, 24, 8192);
  if (s.frames == 0)
    s.frames = s.motion == SyntheticMotion::kLoop
                   ? static_cast<int>(CameraPath::loop_duration_s() * s.fps) + 1
                   : 150;
  return s;
}

}  // namespace synthetic
}  // namespace stillpoint
