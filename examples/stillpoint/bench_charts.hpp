// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "charts.hpp"

namespace stillpoint::cli {

/// The runs whose curves are drawn: the first run of front end off, paper, `on` and truth, and
/// other systems' estimates. `results`: those of one sequence.
std::vector<const nlohmann::ordered_json*> shown_runs(
    const std::vector<const nlohmann::ordered_json*>& results, const std::string& on);

/// The paths from above and from the side.
std::vector<LineChart> path_charts(const std::vector<const nlohmann::ordered_json*>& shown);

/// Position error over time: one chart, or none without ground truth.
std::vector<LineChart> error_chart(const std::vector<const nlohmann::ordered_json*>& shown);

/// Masks, sharpness and motion over time.
std::vector<LineChart> time_charts(const std::vector<const nlohmann::ordered_json*>& shown);

/// Median times of the stages; `rows`: those of one sequence.
BarChart stage_chart(const std::vector<const nlohmann::ordered_json*>& rows);

}  // namespace stillpoint::cli
