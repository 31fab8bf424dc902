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

/// A label without the spaces that indent it in a table.
std::string trimmed(std::string label);
std::string trimmed_label(const nlohmann::ordered_json& result);

/// " (1 of 2 runs)" for a row that lacks some, else nothing.
std::string runs_lacking(const nlohmann::ordered_json& row);

/// The results of a plan (see make_plan()) in some bench folders, in the order of sequence,
/// variant, run. What else lies there, of other sequences or settings, is passed over. The runs
/// that have no result are added to `missing`, as words. Throws Error for a file that is no result.
std::vector<nlohmann::ordered_json> read_results(const std::vector<std::filesystem::path>& folders,
                                                 const nlohmann::ordered_json& plan,
                                                 std::vector<std::string>& missing);

/// One row per sequence, variant and folder of masks; the runs joined: median and worst ATE, lowest
/// coverage, means of the rest. A row that lacks runs of the plan fails as "incomplete". Keys are
/// those of results.csv's header.
nlohmann::ordered_json make_rows(const std::vector<nlohmann::ordered_json>& results,
                                 const nlohmann::ordered_json& plan);

/// The rows as text tables, one per sequence, with a legend.
std::string rows_text(const nlohmann::ordered_json& rows);
std::string rows_csv(const nlohmann::ordered_json& rows);

/// One self-contained HTML page: tables, charts, overlays (see page/).
std::string make_page(const nlohmann::ordered_json& rows,
                      const std::vector<nlohmann::ordered_json>& results,
                      const std::string& command);

}  // namespace stillpoint::cli
