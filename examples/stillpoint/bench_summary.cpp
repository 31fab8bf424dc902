// SPDX-License-Identifier: BSD-2-Clause
#include "bench_summary.hpp"

#include <algorithm>
#include <cmath>

#include "bench_results.hpp"
#include "terminal.hpp"

namespace stillpoint::cli {
namespace {

using Json = nlohmann::ordered_json;

const Json* first(const Json& rows, const std::string& sequence, const std::string& variant,
                  const std::string* masks = nullptr) {
  for (const Json& row : rows)
    if (row["sequence"] == sequence && row["variant"] == variant &&
        (!masks || row["masks_folder"] == *masks))
      return &row;
  return nullptr;
}

}  // namespace

std::string SummaryRow::name() const {
  return masks_folder.empty() || masks_folder == "masks" ? sequence
                                                         : sequence + " [" + masks_folder + "]";
}

std::string variant_on(const Json& rows) {
  for (const Json& row : rows)
    if (row["variant"] == "default" && row["runs"].get<int>() > 0) return "default";
  return "network_only";
}

std::vector<SummaryRow> summarize(const Json& rows) {
  const std::string on = variant_on(rows);
  std::vector<SummaryRow> summary;
  for (const Json& row : rows) {
    const std::string sequence = row["sequence"], variant = row["variant"];
    if (variant != on && variant != "off") continue;
    SummaryRow s;
    s.sequence = sequence;
    s.off = first(rows, sequence, "off");
    s.limit = first(rows, sequence, "truth");
    if (variant == on) {
      s.masks_folder = row["masks_folder"];
      s.on = &row;
    } else if (first(rows, sequence, on)) {
      continue;  // it stands beside the front end on
    }
    summary.push_back(std::move(s));
  }
  return summary;
}

std::string ate_text(const Json* row) {
  if (!row) return "-";
  return fixed(number_at(*row, "ate_rmse_m"), 4) +
         ((*row)["failed"].get<std::string>().empty() ? "" : " !");
}

double front_end_ms(const Json& row) {
  double sum = 0;
  for (const char* stage : {"motion", "compensation", "depth", "probability"})
    sum += number_at(row, std::string("ms_") + stage + "_median");
  return sum;
}

Table summary_table(const std::vector<SummaryRow>& summary) {
  Table table{"",
              {"ATE RMSE [m]", "front end off", "on", "on, online", "limit", "coverage",
               "front end ms", "all ms"},
              {}};
  for (const SummaryRow& s : summary) {
    const Json& row = s.on ? *s.on : *s.off;
    table.rows.push_back({s.name(), ate_text(s.off), ate_text(s.on),
                          s.on ? fixed(number_at(*s.on, "ate_online_rmse_m"), 4) : "-",
                          ate_text(s.limit), fixed(100 * number_at(row, "coverage_min"), 1) + " %",
                          s.on ? fixed(front_end_ms(*s.on), 2) : "-",
                          fixed(number_at(row, "ms_total_median"), 1)});
  }
  return table;
}

const char* summary_legend() {
  return "on: what stillpoint run does; online: the poses that each frame had at its time; "
         "limit: "
         "the same tracker\nwith exact masks (masks_gt), which nobody has; coverage: share of the "
         "frames that have a pose, front end on;\nms: medians per frame of the front end alone and "
         "of all, tracking included.\n";
}

}  // namespace stillpoint::cli
