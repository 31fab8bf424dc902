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
#include "stillpoint/evaluation/bootstrap.hpp"

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

/// The number at a path of keys in the stats of each run that has any.
std::vector<double> values_of(const std::vector<const Json*>& runs,
                              std::initializer_list<const char*> keys) {
  std::vector<double> all;
  for (const Json* run : runs)
    if (run->contains("stats")) all.push_back(number_at_path((*run)["stats"], keys));
  return all;
}

/// How sure the error is, what it was at the time, and how evo gives the same.
void add_evaluation(Json& row, const std::vector<const Json*>& runs) {
  std::vector<double> ate = values_of(runs, {"evaluation", "ate_rmse_m"});
  const double middle = median(ate);
  ate.erase(std::remove_if(ate.begin(), ate.end(), [](double v) { return !std::isfinite(v); }),
            ate.end());
  const Interval sure = median_interval(ate);
  row["ate_rmse_low_m"] = sure.low;
  row["ate_rmse_high_m"] = sure.high;
  row["ate_online_rmse_m"] = median(values_of(runs, {"evaluation_online", "ate_rmse_m"}));
  for (const char* key : {"rpe_1s_trans_m", "rpe_1s_rot_deg", "ate_sim3_rmse_m", "scale"})
    row[key] = median(values_of(runs, {"evaluation", key}));
  row["mask_share"] = mean(values_of(runs, {"mask_share"}));
  for (const char* key : {"recall_measured", "precision_measured"})
    row[std::string("mask_") + key] = mean(values_of(runs, {"masks", key}));
  row["groundtruth_of"] = "";
  row["evo"] = "";
  // Of the run whose error is nearest to the median.
  double nearest = std::numeric_limits<double>::infinity();
  for (const Json* run : runs) {
    if (!run->contains("stats")) continue;
    row["groundtruth_of"] = (*run)["stats"].value("groundtruth_of", "");
    const double off =
        std::abs(number_at_path((*run)["stats"], {"evaluation", "ate_rmse_m"}) - middle);
    if (off < nearest) nearest = off, row["evo"] = run->value("evo", "");
  }
}

Json make_row(const std::vector<const Json*>& runs, std::size_t planned) {
  const Json& job = (*runs.front())["job"];
  const auto values = [&](std::initializer_list<const char*> keys) {
    return values_of(runs, keys);
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
  add_evaluation(row, runs);
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

}  // namespace

double number_at(const Json& json, const std::string& key) {
  return json.contains(key) && json[key].is_number() ? json[key].get<double>()
                                                     : std::numeric_limits<double>::quiet_NaN();
}

std::string trimmed(std::string label) {
  label.erase(0, label.find_first_not_of(' '));
  return label;
}

std::string trimmed_label(const Json& result) { return trimmed(result["job"]["label"]); }

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
    Json best;  // two shards may both hold a run: one that ended in error does not count for more
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
      if (best.is_null() || json.contains("stats")) best = std::move(json);
      if (best.contains("stats")) break;
    }
    if (!best.is_null())
      results.push_back(std::move(best));
    else
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

}  // namespace stillpoint::cli
