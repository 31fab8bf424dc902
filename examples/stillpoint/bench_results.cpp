// SPDX-License-Identifier: BSD-2-Clause
#include "bench_results.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <set>

#include "bench_plan.hpp"
#include "statistics.hpp"
#include "stillpoint/core/error.hpp"
#include "terminal.hpp"

namespace stillpoint::cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

const char* const kStages[] = {"segmentation", "motion",     "compensation", "depth",
                               "probability",  "extraction", "tracking",     "total"};

/// The number at a path of keys; NaN where there is none.
double number_at_path(const Json& json, std::initializer_list<const char*> keys) {
  const Json* at = &json;
  for (const char* key : keys) {
    if (!at->is_object() || !at->contains(key)) return std::numeric_limits<double>::quiet_NaN();
    at = &(*at)[key];
  }
  return at->is_number() ? at->get<double>() : std::numeric_limits<double>::quiet_NaN();
}

/// Position of a variant in the table; unknown ones (other systems) come last.
std::size_t variant_order(const std::string& name) {
  const auto& all = variants();
  return static_cast<std::size_t>(
      std::find_if(all.begin(), all.end(), [&](const Variant& v) { return v.name == name; }) -
      all.begin());
}

Json make_row(const std::vector<const Json*>& runs, std::size_t planned) {
  const Json& job = (*runs.front())["job"];
  const auto values = [&](std::initializer_list<const char*> keys) {
    std::vector<double> all;
    for (const Json* run : runs)
      if (run->contains("stats")) all.push_back(number_at_path((*run)["stats"], keys));
    return all;
  };
  Json row;
  for (const char* key : {"sequence", "variant", "label", "masks_folder"}) row[key] = job[key];
  int finished = 0;
  std::string error;
  for (const Json* run : runs)
    if (run->contains("stats"))
      ++finished;
    else
      error = run->value("error", "no result");
  row["runs"] = finished;
  row["runs_planned"] = planned;
  const std::vector<double> coverage = values({"coverage"});
  const double lowest = quantile(coverage, 0);
  row["failed"] = !error.empty()                ? "error"
                  : !(lowest >= kCoverageFloor) ? "coverage"
                  : runs.size() < planned       ? "incomplete"
                                                : "";
  row["coverage_min"] = lowest;
  const std::vector<double> ate = values({"evaluation", "ate_rmse_m"});
  row["ate_rmse_m"] = median(ate);
  row["ate_rmse_worst_m"] = quantile(ate, 1);
  row["ate_rmse_mean_m"] = mean(ate);
  double spread = 0;
  for (double v : ate) spread += (v - mean(ate)) * (v - mean(ate));
  row["ate_rmse_spread_m"] = ate.size() > 1
                                 ? std::sqrt(spread / static_cast<double>(ate.size() - 1))
                                 : std::numeric_limits<double>::quiet_NaN();
  row["ate_sd_m"] = median(values({"evaluation", "ate_sd_m"}));
  row["ate_sd_mean_m"] = mean(values({"evaluation", "ate_sd_m"}));
  for (const char* key : {"rpe_trans_m", "rpe_rot_deg"})
    row[key] = median(values({"evaluation", key}));
  for (const char* key :
       {"iou_before", "iou_after", "recall_before", "recall_after", "precision_before",
        "precision_after", "iou_before_blurred", "iou_after_blurred"})
    row[std::string("mask_") + key] = mean(values({"masks", key}));
  for (const char* key :
       {"extracted", "kept", "kept_on_people", "precision", "recall", "f1", "static_kept"})
    row[std::string("keypoints_") + key] = mean(values({"keypoints", key}));
  row["map_ghost_share"] = mean(values({"map", "ghost_share"}));
  for (const char* stage : kStages)
    for (const char* key : {"median", "p95"})
      row[std::string("ms_") + stage + "_" + key] = median(values({"times_ms", stage, key}));
  row["peak_memory_mb"] = quantile(values({"peak_memory_mb"}), 1);
  row["varied"] = job.value("varied", std::string());
  row["varied_value"] = job.value("varied_value", 0.0);
  row["best"] = false;
  row["error"] = error;
  return row;
}

/// Marks the smallest error of each sequence, and those that differ in no digit that is printed.
/// What failed has an error over few frames, which is no error to compare; exact masks nobody has.
void mark_best(Json& rows) {
  for (Json& row : rows) {
    const auto counts = [](const Json& r) {
      return r["failed"] == "" && r["variant"] != "truth" &&
             std::isfinite(number_at(r, "ate_rmse_m"));
    };
    const auto printed = [](const Json& r) { return std::round(1e4 * number_at(r, "ate_rmse_m")); };
    row["best"] = counts(row) && std::none_of(rows.begin(), rows.end(), [&](const Json& other) {
                    return other["sequence"] == row["sequence"] && counts(other) &&
                           printed(other) < printed(row);
                  });
  }
}

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

}  // namespace

double number_at(const Json& json, const std::string& key) {
  return json.contains(key) && json[key].is_number() ? json[key].get<double>()
                                                     : std::numeric_limits<double>::quiet_NaN();
}

std::string runs_lacking(const Json& row) {
  const auto runs = row["runs"].get<std::size_t>(),
             planned = row["runs_planned"].get<std::size_t>();
  return runs < planned ? " (" + std::to_string(runs) + " of " + std::to_string(planned) + " runs)"
                        : "";
}

std::vector<Json> read_results(const std::vector<fs::path>& folders, const Json& plan,
                               std::vector<std::string>& missing) {
  std::vector<Json> results;
  const std::size_t shards = plan["shards"];
  std::size_t index = 0;
  for (const Json& run : plan["runs"]) {
    bool found = false;
    for (const fs::path& folder : folders) {
      const fs::path file = folder / run["file"].get<std::string>();
      std::ifstream in(file);
      if (!in) continue;
      Json json = Json::parse(in, nullptr, false);
      if (!json.is_object() || !json.contains("job"))
        throw Error(file.string() +
                    ": expected the result of a run, found something else; delete it");
      if (json["job"] != run["job"]) continue;
      json["folder"] = file.parent_path().string();
      results.push_back(std::move(json));
      found = true;
      break;  // two shards may both hold a run, the same one
    }
    if (!found)
      missing.push_back(run["file"].get<std::string>() +
                        (shards > 1 ? " (shard " + std::to_string(index % shards) + "/" +
                                          std::to_string(shards) + ")"
                                    : ""));
    ++index;
  }
  const auto key = [](const Json& json) {
    const Json& job = json["job"];
    // One block per folder of masks; what needs none stands in the first block.
    const std::string label = job["label"];
    const std::string block =
        label.back() == ']' ? job["masks_folder"].get<std::string>() : std::string();
    return std::make_tuple(job["sequence"].get<std::string>(), block,
                           variant_order(job["variant"].get<std::string>()),
                           job.value("varied", std::string()), job.value("varied_value", 0.0),
                           label, job["run"].get<int>());
  };
  std::stable_sort(results.begin(), results.end(),
                   [&](const Json& a, const Json& b) { return key(a) < key(b); });
  return results;
}

Json make_rows(const std::vector<Json>& results, const Json& plan) {
  const auto planned = [&](const Json& job) {
    return std::count_if(plan["runs"].begin(), plan["runs"].end(), [&](const Json& run) {
      return run["job"]["sequence"] == job["sequence"] && run["job"]["label"] == job["label"];
    });
  };
  Json rows = Json::array();
  for (std::size_t begin = 0; begin < results.size();) {
    std::vector<const Json*> runs;
    std::size_t end = begin;
    for (; end < results.size() &&
           results[end]["job"]["sequence"] == results[begin]["job"]["sequence"] &&
           results[end]["job"]["label"] == results[begin]["job"]["label"];
         ++end)
      runs.push_back(&results[end]);
    rows.push_back(make_row(runs, static_cast<std::size_t>(planned(runs.front()->at("job")))));
    begin = end;
  }
  mark_best(rows);
  return rows;
}

std::string rows_text(const Json& rows) {
  std::string out;
  bool failed = false;
  for (std::size_t begin = 0; begin < rows.size();) {
    const std::string sequence = rows[begin]["sequence"];
    int most_runs = 1;
    for (const Json& row : rows)
      if (row["sequence"] == sequence) most_runs = std::max(most_runs, row["runs"].get<int>());
    std::vector<std::string> header{sequence, "coverage", "ATE RMSE"};
    if (most_runs > 1) header.push_back("worst");
    for (const char* name : {"S.D.", "IoU bef.", "after", "kept", "on people", "ghosts", "segm.",
                             "motion", "comp.", "depth", "prob.", "extr.", "track", "total ms"})
      header.push_back(name);
    TextTable table(header);
    table.rule();
    std::size_t i = begin;
    for (; i < rows.size() && rows[i]["sequence"] == sequence; ++i) {
      const Json& row = rows[i];
      const auto at = [&](const std::string& key, int digits, double factor = 1) {
        return fixed(factor * number_at(row, key), digits);
      };
      const std::string why = row["failed"];
      failed = failed || !why.empty();
      std::vector<std::string> cells{row["label"].get<std::string>() + runs_lacking(row),
                                     at("coverage_min", 1, 100) + " %" + (why.empty() ? "" : " !"),
                                     at("ate_rmse_m", 4) + (!why.empty()  ? " !"
                                                            : row["best"] ? " *"
                                                                          : "")};
      if (why == "error") cells[1] = "error !";
      if (most_runs > 1) cells.push_back(at("ate_rmse_worst_m", 4));
      cells.push_back(at("ate_sd_m", 4));
      cells.push_back(at("mask_iou_before", 3));
      cells.push_back(at("mask_iou_after", 3));
      cells.push_back(at("keypoints_kept", 0));
      cells.push_back(at("keypoints_kept_on_people", 1, 100) + " %");
      if (cells.back() == "- %") cells.back() = "-";
      cells.push_back(at("map_ghost_share", 2, 100) + " %");
      if (cells.back() == "- %") cells.back() = "-";
      for (const char* stage : kStages)
        cells.push_back(at(std::string("ms_") + stage + "_median", 2));
      table.add(cells);
    }
    out += table.text() + "\n";
    begin = i;
  }
  out +=
      "coverage: share of the frames with ground truth that have a pose (lowest of the runs); ATE "
      "in "
      "metres after\nSE(3) alignment (median of the runs); IoU of the dynamic masks before and "
      "after the "
      "front end, undilated;\nkept: keypoints per frame that reach the tracker, and how many of "
      "them lie "
      "on people; ghosts: share of the dense map's voxels\nthat lie where people were; stages: "
      "median ms "
      "per frame.\n";
  out +=
      "*  smallest error of the sequence, or the same in print, failed rows and exact masks "
      "aside.\n";
  if (failed)
    out +=
        "!  failed: under 95 % coverage (an error over few frames says nothing), the run broke "
        "off, "
        "or runs are missing.\n";
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
