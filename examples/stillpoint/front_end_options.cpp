// SPDX-License-Identifier: BSD-2-Clause
#include "front_end_options.hpp"

#include <type_traits>

#include "stillpoint/io/setting_names.hpp"

namespace stillpoint::cli {

void change_setting(FrontEndSettings& settings, const std::string& text) {
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos || equals == 0 || equals + 1 == text.size())
    throw Error("expected NAME=VALUE, e.g. dilation_px=5, found \"" + text + "\"");
  set_setting(settings, text.substr(0, equals), text.substr(equals + 1));
}

nlohmann::ordered_json all_settings(const FrontEndSettings& settings) {
  nlohmann::ordered_json all;
  for_each_setting(settings, [&](const char* path, const auto& member) {
    if constexpr (std::is_enum_v<std::decay_t<decltype(member)>>)
      all[path] = detail::words_of(member)[static_cast<std::size_t>(member)];
    else
      all[path] = member;
  });
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
