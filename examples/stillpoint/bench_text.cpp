// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "bench_results.hpp"
#include "bench_summary.hpp"
#include "terminal.hpp"

namespace stillpoint::cli {
namespace {

using Json = nlohmann::ordered_json;

std::string csv_cell(const Json& value) {
  if (value.is_null()) return "";
  if (!value.is_string()) {
    if (value.is_number_float()) {
      const double v = value.get<double>();
      if (!std::isfinite(v)) return "";
      char buffer[32];
      std::snprintf(buffer, sizeof buffer, "%.9g", v);
      return buffer;
    }
    return value.dump();
  }
  std::string text = value.get<std::string>();
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  for (std::size_t i = 0; (i = text.find('"', i)) != std::string::npos; i += 2)
    text.insert(i, "\"");
  return "\"" + text + "\"";
}

/// The rows of one sequence.
TextTable sequence_table(const std::vector<const Json*>& rows) {
  const bool several = std::any_of(rows.begin(), rows.end(),
                                   [](const Json* row) { return (*row)["runs"].get<int>() > 1; });
  std::vector<std::string> header{(*rows.front())["sequence"], "coverage", "ATE RMSE"};
  if (several) header.insert(header.end(), {"95 % sure", "worst"});
  for (const char* name : {"online", "S.D.", "dynamic", "recall", "precision", "kept", "on people",
                           "ghosts", "front end ms", "all ms"})
    header.push_back(name);
  TextTable table(header);
  table.rule();
  for (const Json* of : rows) {
    const Json& row = *of;
    const auto at = [&](const std::string& key, int digits) {
      return fixed(number_at(row, key), digits);
    };
    const auto percent = [&](const std::string& key, int digits) {
      const double share = number_at(row, key);
      return std::isfinite(share) ? fixed(100 * share, digits) + " %" : std::string("-");
    };
    const std::string why = row["failed"];
    const char* const mark = !why.empty() ? " !" : row["best"].get<bool>() ? " *" : "";
    std::vector<std::string> cells{row["label"].get<std::string>() + runs_lacking(row),
                                   why == "error" ? "error !"
                                                  : fixed(100 * number_at(row, "coverage_min"), 1) +
                                                        " %" + (why.empty() ? "" : " !"),
                                   at("ate_rmse_m", 4) + mark};
    if (several) {
      cells.push_back(at("ate_rmse_low_m", 4) + " to " + at("ate_rmse_high_m", 4));
      cells.push_back(at("ate_rmse_worst_m", 4));
    }
    cells.push_back(at("ate_online_rmse_m", 4));
    cells.push_back(at("ate_sd_m", 4));
    cells.push_back(percent("mask_share", 1));
    cells.push_back(at("mask_recall_measured", 3));
    cells.push_back(at("mask_precision_measured", 3));
    cells.push_back(at("keypoints_kept", 0));
    cells.push_back(percent("keypoints_kept_on_people", 1));
    cells.push_back(percent("map_ghost_share", 2));
    cells.push_back(fixed(front_end_ms(row), 2));
    cells.push_back(at("ms_total_median", 2));
    table.add(cells);
  }
  return table;
}

const char* const kLegend =
    "coverage: share of the frames with ground truth that have a pose (lowest of the runs); ATE: "
    "RMSE in metres after\nSE(3) alignment, poses paired within 0.02 s (median of the runs; 95 % "
    "sure: the bootstrap's interval of it);\nonline: the same of the poses that each frame had at "
    "its time; dynamic: share of the image that the final,\ndilated mask calls dynamic; recall, "
    "precision: of the final mask before dilation, over pixels with depth;\nkept: keypoints per "
    "frame that reach the tracker, and how many of them lie on people; ghosts: share of the\ndense "
    "map's voxels that lie where people were; ms: medians per frame. Times of the stages, IoU and "
    "more:\nindex.html and results.csv.\n"
    "*  smallest error of the sequence, or the same in print, failed rows and exact masks aside.\n";

}  // namespace

std::string rows_text(const Json& rows) {
  std::string out;
  for (std::size_t begin = 0; begin < rows.size();) {
    std::vector<const Json*> of_sequence;
    std::size_t i = begin;
    for (; i < rows.size() && rows[i]["sequence"] == rows[begin]["sequence"]; ++i)
      of_sequence.push_back(&rows[i]);
    out += sequence_table(of_sequence).text() + "\n";
    begin = i;
  }
  out += kLegend;
  if (std::any_of(rows.begin(), rows.end(), [](const Json& row) { return row["failed"] != ""; }))
    out +=
        "!  failed: under 95 % coverage (an error over few frames says nothing), the run broke "
        "off, or runs are missing.\n";
  for (const Json& row : rows)
    if (!row["error"].get<std::string>().empty())
      out += row["sequence"].get<std::string>() + ", " + row["label"].get<std::string>() + ": " +
             row["error"].get<std::string>() + "\n";
  return out;
}

std::string rows_csv(const Json& rows) {
  std::string out;
  if (rows.empty()) return out;
  for (const auto& [key, value] : rows[0].items()) out += (out.empty() ? "" : ",") + key;
  out += "\n";
  for (const Json& row : rows) {
    std::string line;
    bool first = true;
    for (const auto& [key, value] : row.items()) {
      line += (first ? "" : ",") + csv_cell(value);
      first = false;
    }
    out += line + "\n";
  }
  return out;
}

}  // namespace stillpoint::cli
