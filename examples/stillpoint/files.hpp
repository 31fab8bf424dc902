// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

namespace stillpoint::cli {

/// Writes `json` (indented, numbers that are not finite as null) by way of a temporary file, so
/// that a killed program never leaves half a file. Throws Error if that fails.
void write_json(const std::filesystem::path& path, const nlohmann::ordered_json& json);

/// Throws Error if `file`, which `option` names, is to lie in a folder that is not there. Empty:
/// none.
void check_can_hold(const std::filesystem::path& file, const std::string& option);

/// Makes a folder and its parents. Throws Error if that fails.
void make_folder(const std::filesystem::path& path);

}  // namespace stillpoint::cli
