// SPDX-License-Identifier: BSD-2-Clause
#include "front_end_options.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <type_traits>

#include "stillpoint/io/text_file.hpp"

namespace stillpoint::cli {
namespace {

/// Calls visit(path, member) for each number and switch.
template <class Settings, class Visit>
void for_each_setting(Settings& s, const Visit& visit) {
  visit("use_compensation", s.use_compensation);
  visit("use_depth", s.use_depth);
  visit("use_probability", s.use_probability);
  visit("use_motion", s.use_motion);
  visit("large_mask_share", s.large_mask_share);
  visit("compensation.area_ratio", s.compensation.area_ratio);
  visit("compensation.history", s.compensation.history);
  visit("compensation.corner_history", s.compensation.corner_history);
  visit("compensation.use_depth", s.compensation.use_depth);
  visit("compensation.search_px", s.compensation.search_px);
  visit("compensation.min_template_score", s.compensation.min_template_score);
  visit("compensation.min_depth_support", s.compensation.min_depth_support);
  visit("compensation.max_restored_frames", s.compensation.max_restored_frames);
  visit("compensation.sharp_px", s.compensation.sharp_px);
  visit("compensation.max_prediction_s", s.compensation.max_prediction_s);
  visit("compensation.max_unnamed_s", s.compensation.max_unnamed_s);
  visit("compensation.max_speed_m_s", s.compensation.max_speed_m_s);
  visit("compensation.sudden_share", s.compensation.sudden_share);
  visit("compensation.sudden_results", s.compensation.sudden_results);
  visit("depth.cell_px", s.depth.cell_px);
  visit("depth.range_m", s.depth.range_m);
  visit("depth.growth_m", s.depth.growth_m);
  visit("depth.dilation_px", s.depth.dilation_px);
  visit("depth.dilation_per_blur_px", s.depth.dilation_per_blur_px);
  visit("depth.seed", s.depth.seed);
  visit("probability.radius_px", s.probability.radius_px);
  visit("probability.weight", s.probability.weight);
  visit("probability.decay_per_px", s.probability.decay_per_px);
  visit("probability.threshold", s.probability.threshold);
  visit("probability.min_kept", s.probability.min_kept);
  visit("motion.block_px", s.motion.block_px);
  visit("motion.movers.min_moved_cells", s.motion.movers.min_moved_cells);
  visit("motion.movers.min_moved_area_m2", s.motion.movers.min_moved_area_m2);
  visit("motion.movers.min_moved_share", s.motion.movers.min_moved_share);
  visit("motion.movers.growth_m", s.motion.movers.growth_m);
  visit("motion.movers.max_open_share", s.motion.movers.max_open_share);
  visit("ego.measure", s.ego.measure);
  visit("ego.max_step_m", s.ego.max_step_m);
  visit("ego.max_rotation_deg", s.ego.max_rotation_deg);
  visit("ego.max_doubt", s.ego.max_doubt);
  visit("ego.jump_m", s.ego.jump_m);
  visit("ego.jump_rad", s.ego.jump_rad);
  visit("late.predict", s.late.predict);
  visit("late.max_age_s", s.late.max_age_s);
  visit("late.widen_after_s", s.late.widen_after_s);
  visit("late.widen_px_per_s", s.late.widen_px_per_s);
  visit("blur.exposure_s", s.blur.exposure_s);
  visit("objects.max_lost_s", s.objects.max_lost_s);
  visit("objects.velocity_m_s", s.objects.velocity_m_s);
  visit("objects.acceleration_m_s2", s.objects.acceleration_m_s2);
  visit("objects.centroid_m", s.objects.centroid_m);
  visit("sensor.depth_floor_m", s.sensor.depth_floor_m);
  visit("sensor.depth_slope", s.sensor.depth_slope);
  visit("sensor.depth_square", s.sensor.depth_square);
  visit("sensor.depth_systematic", s.sensor.depth_systematic);
  visit("sensor.sigmas", s.sensor.sigmas);
  visit("sensor.delay_s", s.sensor.delay_s);
  visit("sensor.readout_s", s.sensor.readout_s);
  visit("sensor.min_range_m", s.sensor.min_range_m);
  visit("sensor.max_range_m", s.sensor.max_range_m);
}

std::string last_name(const std::string& path) {
  const std::size_t dot = path.rfind('.');
  return dot == std::string::npos ? path : path.substr(dot + 1);
}

/// How many letters must change to make one word the other (Levenshtein).
std::size_t distance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t changed = diagonal + (a[i - 1] != b[j - 1]);
      diagonal = row[j];
      row[j] = std::min({changed, row[j] + 1, row[j - 1] + 1});
    }
  }
  return row[b.size()];
}

/// The full path of a setting.
std::string path_of(const std::string& name) {
  FrontEndSettings settings;
  std::vector<std::string> same;
  std::string nearest;
  std::size_t least = 0;
  for_each_setting(settings, [&](const std::string& path, auto&) {
    if (path == name) same.assign(1, path);
    if (same.size() != 1 || same[0] != name)
      if (last_name(path) == name) same.push_back(path);
    const std::size_t d = std::min(distance(path, name), distance(last_name(path), name));
    if (nearest.empty() || d < least) nearest = path, least = d;
  });
  if (same.empty())
    throw Error("setting \"" + name + "\": no such one; the nearest is " + nearest +
                " (docs/tuning.md lists all)");
  if (same.size() > 1)
    throw Error("setting \"" + name + "\": expected one of " + same[0] + " and " + same[1] +
                ", found what both are called");
  return same[0];
}

template <class Member>
void assign(Member& member, double value, const std::string& path) {
  const auto refuse = [&](const char* expected) {
    throw Error("setting " + path + ": expected " + expected + ", found " +
                nlohmann::ordered_json(value).dump());
  };
  if constexpr (std::is_same_v<Member, bool>) {
    if (value != 0 && value != 1) refuse("true or false");
    member = value != 0;
  } else if constexpr (std::is_integral_v<Member>) {
    if (value != std::floor(value) || std::abs(value) > 1e9 ||
        (std::is_unsigned_v<Member> && value < 0))
      refuse(std::is_unsigned_v<Member> ? "a whole number of at least 0" : "a whole number");
    member = static_cast<Member>(value);
  } else {
    member = static_cast<Member>(value);
  }
}

}  // namespace

void change_setting(FrontEndSettings& settings, const std::string& name, double value) {
  const std::string wanted = path_of(name);
  for_each_setting(settings, [&](const std::string& path, auto& member) {
    if (path == wanted) assign(member, value, path);
  });
}

void change_setting(FrontEndSettings& settings, const std::string& text) {
  const std::size_t equals = text.find('=');
  const std::string word = equals == std::string::npos ? "" : text.substr(equals + 1);
  const std::optional<double> value = word == "true"    ? 1.0
                                      : word == "false" ? 0.0
                                                        : detail::parse_number(word);
  if (!value || equals == 0)
    throw Error("expected NAME=NUMBER, e.g. dilation_px=5, found \"" + text + "\"");
  change_setting(settings, text.substr(0, equals), *value);
}

nlohmann::ordered_json all_settings(const FrontEndSettings& settings) {
  nlohmann::ordered_json all;
  for_each_setting(settings, [&](const char* path, const auto& member) { all[path] = member; });
  return all;
}

const std::vector<std::string>& sensor_names() {
  static const std::vector<std::string> names{"kinect_v1", "time_of_flight", "realsense_d400",
                                              "exact"};
  return names;
}

SensorModel sensor_of(const std::string& name) {
  if (name == "kinect_v1") return SensorModel::kinect_v1();
  if (name == "time_of_flight") return SensorModel::time_of_flight();
  if (name == "realsense_d400") return SensorModel::realsense_d400();
  if (name == "exact") return SensorModel::exact();
  throw Error("--sensor: expected kinect_v1, time_of_flight, realsense_d400 or exact, found \"" +
              name + "\"");
}

}  // namespace stillpoint::cli
