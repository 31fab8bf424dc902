// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "stillpoint/front_end.hpp"

namespace stillpoint::cli {

/// Changes one setting: by its path in FrontEndSettings ("depth.dilation_px"), or by its last name
/// where only one setting has it. Throws Error for a name that is none, with the nearest; for one
/// that several have; and for a value that does not fit.
void change_setting(FrontEndSettings& settings, const std::string& name, double value);

/// The same for "NAME=VALUE"; true and false are 1 and 0.
void change_setting(FrontEndSettings& settings, const std::string& name_and_value);

/// All settings by path.
nlohmann::ordered_json all_settings(const FrontEndSettings& settings);

/// The names of the sensor models, and the model of a name.
const std::vector<std::string>& sensor_names();
SensorModel sensor_of(const std::string& name);

}  // namespace stillpoint::cli
