// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "stillpoint/front_end_settings.hpp"

namespace stillpoint::cli {

/// What a settings file asks for, as the options --set and --dynamic take it.
struct SettingsFile {
  /// PATH=VALUE, in the order of the file.
  std::vector<std::string> changed;
  /// NAME=PRIOR; empty: the file does not say.
  std::vector<std::string> dynamic;
};

/// Reads a YAML file of settings, by their names in FrontEndSettings: nested by stage
/// (`depth: {dilation_px: 5}`), by path (`depth.dilation_px: 5`) or by a last name that only one
/// setting has; and `dynamic_classes`, a list of names or [name, prior]. Throws Error naming file
/// and line: no YAML, an unknown setting, a value that does not fit, a setting twice.
SettingsFile read_settings(const std::filesystem::path& file);

/// Writes all settings as read_settings() takes them. Throws Error if that fails.
void write_settings(const std::filesystem::path& file, const FrontEndSettings& settings);

}  // namespace stillpoint::cli
