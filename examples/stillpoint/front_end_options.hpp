// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "stillpoint/front_end_settings.hpp"

namespace stillpoint::cli {

/// Changes one setting by "NAME=VALUE" (see set_setting()).
void change_setting(FrontEndSettings& settings, const std::string& name_and_value);

/// All settings by path.
nlohmann::ordered_json all_settings(const FrontEndSettings& settings);

/// The names of the sensor models, and the model of a name.
const std::vector<std::string>& sensor_names();
SensorModel sensor_of(const std::string& name);

}  // namespace stillpoint::cli
