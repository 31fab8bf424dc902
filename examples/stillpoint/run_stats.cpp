// SPDX-License-Identifier: BSD-2-Clause
#include "run_stats.hpp"

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <limits>
#include <map>
#include <string>

#include "front_end_options.hpp"

namespace stillpoint::cli {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

Json settings_json(const RunSettings& s, const FrontEndSettings& f) {
  Json classes;
  for (const DynamicClass& c : f.dynamic_classes) classes[c.name] = c.prior;
  return {{"front_end", s.front_end ? "on" : "off"},
          {"preset", s.preset},
          {"without", s.without},
          {"segmenter", s.segmenter},
          {"masks", s.masks.string()},
          {"model", s.model.string()},
          {"async", s.async},
          {"real_time_rate", s.real_time_rate},
          {"latency_ms", s.latency_ms < 0 ? Json() : Json(s.latency_ms)},
          {"tracker", s.tracker},
          {"features", s.features},
          {"seed", s.seed},
          {"dynamic_classes", classes},
          {"sensor", s.sensor.empty() ? "preset" : s.sensor},
          {"settings_file", s.settings_file.string()},
          {"changed", s.changed},
          {"all", all_settings(f)}};
}

Json camera_json(const Camera& c) {
  return {{"fx", c.fx},
          {"fy", c.fy},
          {"cx", c.cx},
          {"cy", c.cy},
          {"k1", c.k1},
          {"k2", c.k2},
          {"p1", c.p1},
          {"p2", c.p2},
          {"k3", c.k3},
          {"depth_units_per_m", c.depth_units_per_m},
          {"exposure_s", c.exposure_s}};
}

void add_true_blur(Json& series, const fs::path& file, const std::vector<double>& frames) {
  std::ifstream in(file);
  if (!in) return;
  struct Blur {
    double room = std::numeric_limits<double>::quiet_NaN(), way = 0, pixels = 0;
  };
  std::map<std::int64_t, Blur> blur;
  const auto key = [](double timestamp) { return std::llround(timestamp * 1e6); };
  for (std::string line; std::getline(in, line);) {
    double timestamp = 0, pixels = 0, px = 0;
    int label = 0;
    if (std::sscanf(line.c_str(), "%lf,%d,%lf,%lf", &timestamp, &label, &pixels, &px) != 4)
      continue;
    Blur& frame = blur[key(timestamp)];
    if (label == 0) frame.room = px;
    if (label >= 1 && label <= 100) frame.way += px * pixels, frame.pixels += pixels;
  }
  for (double timestamp : frames) {
    const auto found = blur.find(key(timestamp));
    const Blur b = found == blur.end() ? Blur() : found->second;
    series["room_motion_px"].push_back(b.room);
    series["people_motion_px"].push_back(b.pixels > 0 ? Json(b.way / b.pixels) : Json());
  }
}

}  // namespace stillpoint::cli
