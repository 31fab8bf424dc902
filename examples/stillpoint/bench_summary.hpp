// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "bench_paper.hpp"

namespace stillpoint::cli {

/// What a reader wants to know first of a sequence: the front end off, on, and with exact masks.
/// Rows of make_rows(), null where there is none.
struct SummaryRow {
  std::string sequence, masks_folder;
  const nlohmann::ordered_json *off = nullptr, *on = nullptr, *limit = nullptr;

  /// "walking_xyz", "walking_xyz [masks_4hz]".
  std::string name() const;
};

/// The variant that stands for "front end on": what `stillpoint run` takes, if it is here.
std::string variant_on(const nlohmann::ordered_json& rows);

/// One for each sequence and folder of masks with a row of the front end on or off. The result
/// points into `rows`.
std::vector<SummaryRow> summarize(const nlohmann::ordered_json& rows);

/// "0.0016", "0.0016 !" for a row that failed, "-" for none.
std::string ate_text(const nlohmann::ordered_json* row);

/// Milliseconds per frame that the front end itself takes: its stages without the segmenter.
double front_end_ms(const nlohmann::ordered_json& row);

/// The table that stands first, in the terminal and on the page.
Table summary_table(const std::vector<SummaryRow>& summary);

/// What stands below it.
const char* summary_legend();

}  // namespace stillpoint::cli
