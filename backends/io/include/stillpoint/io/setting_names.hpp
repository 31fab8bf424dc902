// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <locale>
#include <numeric>
#include <optional>
#include <sstream>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "stillpoint/core/error.hpp"
#include "stillpoint/front_end_settings.hpp"
#include "stillpoint/io/text_file.hpp"

namespace stillpoint {

namespace detail {

template <class Settings, class Visit>
void for_each_setting_of_masks(Settings& s, const Visit& visit) {
  visit("use_compensation", s.use_compensation);
  visit("use_depth", s.use_depth);
  visit("use_probability", s.use_probability);
  visit("use_motion", s.use_motion);
  visit("large_mask_share", s.large_mask_share);
  visit("compensation.trigger", s.compensation.trigger);
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
  visit("depth.method", s.depth.method);
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
}

template <class Settings, class Visit>
void for_each_setting_of_motion(Settings& s, const Visit& visit) {
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

}  // namespace detail

/// Calls visit(path, member) for each number, switch and choice of the front end's settings, with
/// its path in FrontEndSettings ("depth.dilation_px"). This is the one list of their names; only
/// dynamic_classes is not in it. `Settings`: FrontEndSettings, or the same const.
template <class Settings, class Visit>
void for_each_setting(Settings& s, const Visit& visit) {
  detail::for_each_setting_of_masks(s, visit);
  detail::for_each_setting_of_motion(s, visit);
}

namespace detail {

/// The words of a choice, in the order of its enumerators.
inline const std::array<const char*, 2>& words_of(SegmentationCompensatorSettings::Trigger) {
  static const std::array<const char*, 2> words{"global", "per_object"};
  return words;
}
inline const std::array<const char*, 2>& words_of(DepthMaskFuserSettings::Method) {
  static const std::array<const char*, 2> words{"paper", "connected"};
  return words;
}

inline std::string last_name(const std::string& path) {
  const std::size_t dot = path.rfind('.');
  return dot == std::string::npos ? path : path.substr(dot + 1);
}

/// How many letters must change to make one word the other (Levenshtein).
inline std::size_t letters_between(const std::string& a, const std::string& b) {
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

/// The same value after it was read again; a point whatever the host's locale.
template <class Number>
std::string number_text(Number value) {
  std::string text;
  for (int digits = 1; digits <= 17; ++digits) {
    std::ostringstream out;
    out.imbue(std::locale::classic());
    out.precision(digits);
    out << value;
    text = out.str();
    const std::optional<double> again = parse_number(text);
    if (again && static_cast<Number>(*again) == value) break;
  }
  return text;
}

template <class Member>
void assign_setting(Member& member, const std::string& word, const std::string& path) {
  const auto refuse = [&](const std::string& expected) {
    throw Error("setting " + path + ": expected " + expected + ", found " + quoted(word));
  };
  if constexpr (std::is_enum_v<Member>) {
    const auto& words = words_of(member);
    const auto found = std::find(words.begin(), words.end(), word);
    if (found == words.end()) refuse(std::string(words[0]) + " or " + words[1]);
    member = static_cast<Member>(found - words.begin());
  } else if constexpr (std::is_same_v<Member, bool>) {
    if (word != "true" && word != "false" && word != "1" && word != "0") refuse("true or false");
    member = word == "true" || word == "1";
  } else {
    const std::optional<double> value = parse_number(word);
    if (!value) refuse("a number");
    if (std::is_integral_v<Member> && (*value != std::floor(*value) || std::abs(*value) > 1e9 ||
                                       (std::is_unsigned_v<Member> && *value < 0)))
      refuse(std::is_unsigned_v<Member> ? "a whole number of at least 0" : "a whole number");
    member = static_cast<Member>(*value);
  }
}

}  // namespace detail

/// The full path of a setting that is named by its path, or by its last name where only one setting
/// has it ("dilation_px"). Throws Error for an unknown name, with the nearest, and for a last name
/// that several settings have. O(settings).
inline std::string setting_path(const std::string& name) {
  const FrontEndSettings settings;
  std::vector<std::string> same;
  std::string nearest;
  std::size_t least = 0;
  bool exact = false;
  for_each_setting(settings, [&](const std::string& path, const auto&) {
    exact = exact || path == name;
    if (detail::last_name(path) == name) same.push_back(path);
    const std::size_t d = std::min(detail::letters_between(path, name),
                                   detail::letters_between(detail::last_name(path), name));
    if (nearest.empty() || d < least) nearest = path, least = d;
  });
  if (exact) return name;
  detail::check(!same.empty(), [&] {
    return "setting \"" + name + "\": no such one; the nearest is " + nearest +
           " (settings.yaml of `stillpoint run` has all)";
  });
  detail::check(same.size() == 1, [&] {
    return "setting \"" + name + "\": expected one of " + same[0] + " and " + same[1] +
           ", found what both are called";
  });
  return same[0];
}

/// Changes one setting, named as setting_path() takes it. `value`: a number, true or false, or the
/// word of a choice ("paper"). Throws Error for an unknown name, and for a value that does not fit.
inline void set_setting(FrontEndSettings& settings, const std::string& name,
                        const std::string& value) {
  const std::string wanted = setting_path(name);
  for_each_setting(settings, [&](const std::string& path, auto& member) {
    if (path == wanted) detail::assign_setting(member, value, path);
  });
}

/// The values of all settings as set_setting() takes them, in the order of for_each_setting().
inline std::vector<std::pair<std::string, std::string>> setting_values(
    const FrontEndSettings& settings) {
  std::vector<std::pair<std::string, std::string>> values;
  for_each_setting(settings, [&](const char* path, const auto& member) {
    using Member = std::decay_t<decltype(member)>;
    std::string text;
    if constexpr (std::is_enum_v<Member>)
      text = detail::words_of(member)[static_cast<std::size_t>(member)];
    else if constexpr (std::is_same_v<Member, bool>)
      text = member ? "true" : "false";
    else
      text = detail::number_text(member);
    values.emplace_back(path, text);
  });
  return values;
}

}  // namespace stillpoint
