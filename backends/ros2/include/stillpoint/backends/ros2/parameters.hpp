// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <type_traits>
#include <variant>
#include <vector>

#include "stillpoint/backends/ros2/messages.hpp"
#include "stillpoint/backends/ros2/synchronizer.hpp"
#include "stillpoint/front_end_settings.hpp"

namespace stillpoint::ros2 {

/// What a user of the node can set. docs/ros2.md has them in a table.
struct Parameters {
  std::string preset = "default";
  std::vector<std::string> dynamic_classes{"person"};
  std::string sensor = "kinect_v1";
  std::vector<std::int64_t> dynamic_labels;
  bool use_depth = true, rectified = false, any_depth_frame = false;
  double depth_units_per_m = 1000, dilation_px = -1, exposure_s = 0;
  double max_time_difference_s = 0.02, max_wait_s = 0.1, mask_wait_s = 0, max_mask_age_s = 1.5;
  double stalled_after_s = 1, jump_back_s = 0.5, warn_period_s = 10;
  std::int64_t queue_size = 5;
  std::string poses = "none", world_frame = "odom";

  SynchronizerSettings synchronizer() const {
    SynchronizerSettings s;
    s.queue_size = static_cast<std::size_t>(queue_size);
    s.depth = use_depth;
    s.max_difference = nanoseconds(max_time_difference_s);
    s.max_wait = nanoseconds(max_wait_s);
    s.mask_wait = nanoseconds(mask_wait_s);
    s.stalled_after = nanoseconds(stalled_after_s);
    s.jump_back = nanoseconds(jump_back_s);
    return s;
  }

  FrontEndSettings front_end() const {
    FrontEndSettings s = FrontEndSettings::preset(preset);
    if (sensor == "realsense_d400") s.sensor = SensorModel::realsense_d400();
    if (sensor == "time_of_flight") s.sensor = SensorModel::time_of_flight();
    if (sensor == "exact") s.sensor = SensorModel::exact();
    s.dynamic_classes.clear();
    for (const std::string& name : dynamic_classes) s.dynamic_classes.emplace_back(name);
    s.late.max_age_s = max_mask_age_s;
    s.blur.exposure_s = exposure_s;
    if (dilation_px >= 0) s.depth.dilation_px = static_cast<int>(std::lround(dilation_px));
    return s;
  }
};

using ParameterValue = std::variant<bool, std::int64_t, double, std::string,
                                    std::vector<std::string>, std::vector<std::int64_t>>;

/// One parameter: where its value is, what it means, and what it may be.
struct ParameterDescription {
  using Member = std::variant<bool Parameters::*, std::int64_t Parameters::*, double Parameters::*,
                              std::string Parameters::*, std::vector<std::string> Parameters::*,
                              std::vector<std::int64_t> Parameters::*>;
  const char* name;
  Member member;
  const char* text;
  double least = 0, most = 0;          ///< Of a number.
  std::vector<std::string> choices{};  ///< Of a text; empty: any.
  bool read_only = false;              ///< Set at the start only.

  ParameterValue value(const Parameters& parameters) const {
    return std::visit([&](auto m) { return ParameterValue(parameters.*m); }, member);
  }
};

/// All parameters.
inline const std::vector<ParameterDescription>& parameter_descriptions() {
  using P = Parameters;
  static const std::vector<ParameterDescription> all = {
      {"preset",
       &P::preset,
       "settings of the front end",
       0,
       0,
       {"default", "network_only", "paper"}},
      {"dynamic_classes", &P::dynamic_classes, "classes that move; of label images, the first"},
      {"sensor",
       &P::sensor,
       "what the depth is worth",
       0,
       0,
       {"kinect_v1", "realsense_d400", "time_of_flight", "exact"}},
      {"dynamic_labels", &P::dynamic_labels,
       "label images hold classes, and these move; empty: they hold instances"},
      {"use_depth", &P::use_depth, "wait for depth images and use them"},
      {"rectified", &P::rectified, "the images are rectified: P of camera_info, no distortion"},
      {"any_depth_frame", &P::any_depth_frame, "take depth of another frame_id for registered"},
      {"depth_units_per_m", &P::depth_units_per_m, "units of 16UC1 depth", 1e-3, 1e6},
      {"dilation_px", &P::dilation_px, "widen masks by so much; -1: the preset's", -1, 100},
      {"exposure_s", &P::exposure_s, "of a color image; 0: not known, half of 1/30 s", 0, 9},
      {"max_time_difference_s", &P::max_time_difference_s, "of color and depth", 0,
       kMostDepthOffsetS},
      {"max_wait_s", &P::max_wait_s, "wait for depth, in time of the stamps", 0, 10},
      {"mask_wait_s", &P::mask_wait_s,
       "wait for the segmentation of the same stamp; 0: late ones are predicted forward", 0, 10},
      {"max_mask_age_s", &P::max_mask_age_s, "drop segmentations that are older", 0, 60},
      {"stalled_after_s", &P::stalled_after_s, "without a message for so long a topic has stopped",
       0.01, 3600},
      {"jump_back_s", &P::jump_back_s, "stamps that go back so far begin a new recording", 0.01,
       3600},
      {"warn_period_s", &P::warn_period_s, "say each warning at most so often", 0, 3600},
      {"queue_size", &P::queue_size, "color images that wait at most", 1, 1000},
      {"poses",
       &P::poses,
       "where the camera's motion is known from",
       0,
       0,
       {"none", "tf", "odometry"},
       true},
      {"world_frame", &P::world_frame, "frame of TF that stands still", 0, 0, {}, true},
  };
  return all;
}

/// Whether there is one of that name.
inline bool is_parameter(const std::string& name) {
  const std::vector<ParameterDescription>& all = parameter_descriptions();
  return std::any_of(all.begin(), all.end(),
                     [&](const ParameterDescription& d) { return name == d.name; });
}

namespace detail {

template <class To, class From>
bool assign(To& to, const From& from) {
  if constexpr (std::is_same_v<To, From>) {
    to = from;
    return true;
  } else if constexpr (std::is_same_v<To, double> && std::is_same_v<From, std::int64_t>) {
    to = static_cast<double>(from);
    return true;
  } else {
    return false;
  }
}

inline const char* type_name(const ParameterValue& value) {
  static const char* const names[] = {"true or false",   "a whole number",
                                      "a number",        "a text",
                                      "a list of texts", "a list of whole numbers"};
  return names[value.index()];
}

inline std::string range_problem(const ParameterDescription& d, double value) {
  if (value >= d.least && value <= d.most) return "";
  return "expected " + std::to_string(d.least) + " to " + std::to_string(d.most) + ", found " +
         std::to_string(value);
}

inline std::string choice_problem(const ParameterDescription& d, const std::string& value) {
  if (d.choices.empty() || std::find(d.choices.begin(), d.choices.end(), value) != d.choices.end())
    return value.empty() ? "expected a name, found an empty text" : "";
  std::string list;
  for (const std::string& choice : d.choices) list += (list.empty() ? "" : ", ") + choice;
  return "expected one of " + list + ", found '" + value + "'";
}

inline std::string problem_of(const ParameterDescription& d, const Parameters& parameters) {
  if (const auto* m = std::get_if<double Parameters::*>(&d.member))
    return range_problem(d, parameters.**m);
  if (const auto* m = std::get_if<std::int64_t Parameters::*>(&d.member))
    return range_problem(d, static_cast<double>(parameters.**m));
  if (const auto* m = std::get_if<std::string Parameters::*>(&d.member))
    return choice_problem(d, parameters.**m);
  if (d.member == ParameterDescription::Member(&Parameters::dynamic_classes)) {
    const std::vector<std::string>& names = parameters.dynamic_classes;
    if (names.empty() || std::count(names.begin(), names.end(), "") > 0)
      return "expected at least one name, and none empty";
  }
  return "";
}

}  // namespace detail

/// Sets a parameter if its value is right: a whole number will do where a number is expected.
/// Returns an empty text, or the parameter's name, what was expected and what was found;
/// `parameters` is then as it was.
inline std::string set_parameter(Parameters& parameters, const std::string& name,
                                 const ParameterValue& value) {
  for (const ParameterDescription& d : parameter_descriptions()) {
    if (name != d.name) continue;
    Parameters changed = parameters;
    const bool fits = std::visit(
        [&](auto m, const auto& v) { return detail::assign(changed.*m, v); }, d.member, value);
    std::string problem;
    if (!fits)
      problem = std::string("expected ") + detail::type_name(d.value(parameters)) + ", found " +
                detail::type_name(value);
    else
      problem = detail::problem_of(d, changed);
    if (!problem.empty()) return "parameter " + name + ": " + problem;
    parameters = changed;
    return "";
  }
  return "parameter " + name + ": there is none of that name";
}

}  // namespace stillpoint::ros2
