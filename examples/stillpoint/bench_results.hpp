// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace stillpoint::cli {

/// Coverage below this makes a row a failure, whatever its error.
constexpr double kCoverageFloor = 0.95;

/// The number of a key; NaN where there is none.
double number_at(const nlohmann::ordered_json& json, const std::string& key);

/// The results (runs/*/*.json) below some bench folders, in the order of sequence, variant, run.
/// Throws Error for a file that is no result.
std::vector<nlohmann::ordered_json> read_results(const std::vector<std::filesystem::path>& folders);

/// One row per sequence, variant and folder of masks; the runs joined: median and worst ATE, lowest
/// coverage, means of the rest. Keys are those of results.csv's header.
nlohmann::ordered_json make_rows(const std::vector<nlohmann::ordered_json>& results);

/// The rows as text tables, one per sequence, with a legend.
std::string rows_text(const nlohmann::ordered_json& rows);
std::string rows_csv(const nlohmann::ordered_json& rows);

/// One self-contained HTML page: tables, plots, overlays. `folders` as for read_results().
std::string make_page(const nlohmann::ordered_json& rows,
                      const std::vector<nlohmann::ordered_json>& results,
                      const std::string& command);

}  // namespace stillpoint::cli
