// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <nlohmann/json.hpp>
#include <vector>

#include "bench_paper.hpp"

namespace stillpoint::cli {

// Tables as page/table.mustache takes them: title, header (text, hint) and rows (kind, cells of
// text and kind). `rows`: those of one sequence (see make_rows()).
nlohmann::ordered_json accuracy_table(const std::vector<const nlohmann::ordered_json*>& rows);
nlohmann::ordered_json masks_table(const std::vector<const nlohmann::ordered_json*>& rows);
nlohmann::ordered_json time_table(const std::vector<const nlohmann::ordered_json*>& rows);
nlohmann::ordered_json to_view(const Table& table);

}  // namespace stillpoint::cli
