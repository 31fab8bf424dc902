// SPDX-License-Identifier: BSD-2-Clause
#include "page_tables.hpp"

#include "bench_results.hpp"
#include "terminal.hpp"

namespace stillpoint::cli {
namespace {

using Json = nlohmann::ordered_json;

struct Column {
  const char *name, *hint;
  /// Key of a row, what its number is multiplied by, and how many digits are shown.
  const char* key;
  double factor;
  int digits;
};

const Column kAccuracy[] = {
    {"runs", "that finished", "runs", 1, 0},
    {"coverage %", "share of the frames with ground truth that have a pose (lowest of the runs)",
     "coverage_min", 100, 1},
    {"ATE [m]", "RMSE after SE(3) alignment (median of the runs)", "ate_rmse_m", 1, 4},
    {"95 % from", "bootstrap interval of the median", "ate_rmse_low_m", 1, 4},
    {"to", "bootstrap interval of the median", "ate_rmse_high_m", 1, 4},
    {"worst", "largest ATE of the runs", "ate_rmse_worst_m", 1, 4},
    {"online", "ATE of the poses that each frame had at its time", "ate_online_rmse_m", 1, 4},
    {"mean", "of the runs", "ate_rmse_mean_m", 1, 4},
    {"spread", "standard deviation of the runs' ATE", "ate_rmse_spread_m", 1, 4},
    {"S.D.", "standard deviation of the position error in a run", "ate_sd_m", 1, 4},
    {"RPE [m]", "relative pose error from frame to frame, RMSE", "rpe_trans_m", 1, 4},
    {"RPE [deg]", "the same for the rotation", "rpe_rot_deg", 1, 3},
    {"RPE 1 s [m]", "relative pose error over a second, RMSE", "rpe_1s_trans_m", 1, 4},
    {"RPE 1 s [deg]", "the same for the rotation", "rpe_1s_rot_deg", 1, 3},
    {"Sim(3) [m]", "ATE with the scale aligned, too", "ate_sim3_rmse_m", 1, 4},
    {"scale", "by which Sim(3) alignment multiplies the estimate", "scale", 1, 4},
    {"kept", "keypoints per frame that reach the tracker", "keypoints_kept", 1, 0},
    {"on people %", "of the kept keypoints", "keypoints_kept_on_people", 100, 2},
    {"ghosts %", "voxels of the dense map where people were and nothing static is",
     "map_ghost_share", 100, 2}};

const Column kMasks[] = {
    {"dynamic %", "share of the image that the final, dilated mask calls dynamic", "mask_share",
     100, 1},
    {"given: IoU", "the segmenter's masks against masks_gt, undilated", "mask_iou_before", 1, 3},
    {"recall", "of the given masks", "mask_recall_before", 1, 3},
    {"precision", "of the given masks", "mask_precision_before", 1, 3},
    {"final: IoU", "what the front end made of them", "mask_iou_after", 1, 3},
    {"recall", "of the final masks", "mask_recall_after", 1, 3},
    {"precision", "of the final masks", "mask_precision_after", 1, 3},
    {"with depth: recall", "of the final masks, over pixels with depth", "mask_recall_measured", 1,
     3},
    {"precision", "of the final masks, over pixels with depth", "mask_precision_measured", 1, 3},
    {"blurred: given", "IoU over the least sharp third", "mask_iou_before_blurred", 1, 3},
    {"final", "IoU over the least sharp third", "mask_iou_after_blurred", 1, 3},
    {"keypoints: precision", "of the decision to remove one", "keypoints_precision", 1, 3},
    {"recall", "of the decision to remove one", "keypoints_recall", 1, 3},
    {"F1", "of the decision to remove one", "keypoints_f1", 1, 3},
    {"static kept %", "of the static keypoints", "keypoints_static_kept", 100, 1}};

Json text_cell(const std::string& text, const std::string& kind = "") {
  return {{"text", text}, {"kind", kind}};
}

std::string failed_class(const Json& row) {
  return row["failed"].get<std::string>().empty() ? "" : "failed";
}

std::string row_name(const Json& row) {
  const std::string failed = row["failed"];
  return row["label"].get<std::string>() + runs_lacking(row) +
         (failed == "coverage"                       ? "  (failed: coverage)"
          : failed.empty() || failed == "incomplete" ? ""
                                                     : "  (failed)");
}

template <std::size_t N>
Json number_table(const std::vector<const Json*>& rows, const Column (&columns)[N]) {
  Json table = {{"header", Json::array({{{"text", "variant"}, {"hint", ""}}})},
                {"rows", Json::array()}};
  for (const Column& c : columns) table["header"].push_back({{"text", c.name}, {"hint", c.hint}});
  for (const Json* row : rows) {
    Json cells = Json::array({text_cell(row_name(*row))});
    for (const Column& c : columns)
      cells.push_back(text_cell(
          fixed(c.factor * number_at(*row, c.key), c.digits),
          c.key == std::string("ate_rmse_m") && (*row)["best"].get<bool>() ? "best" : ""));
    table["rows"].push_back({{"kind", failed_class(*row)}, {"cells", cells}});
  }
  return table;
}

}  // namespace

Json accuracy_table(const std::vector<const Json*>& rows) { return number_table(rows, kAccuracy); }

Json masks_table(const std::vector<const Json*>& rows) { return number_table(rows, kMasks); }

Json time_table(const std::vector<const Json*>& rows) {
  Json table = {{"header", Json::array({{{"text", "ms, median (p95)"}, {"hint", ""}}})},
                {"rows", Json::array()}};
  const auto stages = {"segmentation", "motion",     "compensation", "depth",
                       "probability",  "extraction", "tracking",     "total"};
  for (const char* stage : stages) table["header"].push_back({{"text", stage}, {"hint", ""}});
  table["header"].push_back({{"text", "memory MB"}, {"hint", "largest of the runs"}});
  for (const Json* row : rows) {
    if ((*row)["runs"].get<int>() == 0) continue;
    Json cells = Json::array({text_cell((*row)["label"])});
    for (const char* stage : stages) {
      const std::string key = std::string("ms_") + stage;
      cells.push_back(text_cell(fixed(number_at(*row, key + "_median"), 2) + " (" +
                                fixed(number_at(*row, key + "_p95"), 2) + ")"));
    }
    cells.push_back(text_cell(fixed(number_at(*row, "peak_memory_mb"), 0)));
    table["rows"].push_back({{"kind", ""}, {"cells", cells}});
  }
  return table;
}

Json to_view(const Table& table) {
  Json view = {{"title", table.title}, {"header", Json::array()}, {"rows", Json::array()}};
  for (const std::string& name : table.header)
    view["header"].push_back({{"text", name}, {"hint", ""}});
  for (const std::vector<std::string>& row : table.rows) {
    Json cells = Json::array();
    for (const std::string& text : row)
      cells.push_back(text_cell(text, text.compare(0, 6, "failed") == 0 ? "failed" : ""));
    view["rows"].push_back({{"kind", ""}, {"cells", cells}});
  }
  return view;
}

}  // namespace stillpoint::cli
