// SPDX-License-Identifier: BSD-2-Clause
#include "bench_paper.hpp"

#include <algorithm>
#include <cmath>

#include "bench_results.hpp"
#include "stillpoint/core/error.hpp"
#include "terminal.hpp"

namespace stillpoint::cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

// Published numbers, as printed; "-": not given. ATE RMSE / S.D. in metres, times in milliseconds.
const std::vector<std::string> kAteHeader{
    "ATE RMSE / S.D. [m]", "ORB-SLAM2", "DynaSLAM", "Crowd-SLAM",
    "YOLO-SLAM",           "SG-SLAM",   "the paper"};
const std::vector<std::vector<std::string>> kTable1{
    {"w/xyz", ".729/.386", ".016/.009", ".020/.017", ".015/.007", ".015/.008", ".014/.007"},
    {"w/half", ".419/.245", ".030/.016", ".026/.022", ".028/.014", ".027/.013", ".023/.011"},
    {"w/static", ".367/.161", ".007/.003", ".007/.007", ".007/.004", ".007/.003", ".006/.003"},
    {"w/rpy", ".775/.411", ".035/.019", ".044/.031", ".216/.100", ".032/.019", ".031/.018"},
    {"s/static", ".009/.004", "-", ".008/.007", ".007/.003", ".006/.003", ".005/.003"}};
const std::vector<std::vector<std::string>> kTable2{
    {"crowd1", ".533/.361", ".016", ".018", ".033", ".023/.014", ".016/.008"},
    {"crowd2", "1.311/.257", ".031", ".030", ".423", ".060/.040", ".031/.018"},
    {"crowd3", ".780/.306", ".038", ".034", ".069", ".032/.022", ".026/.017"},
    {"person1", ".796/.709", "-", "-", ".157", ".040/.014", ".038/.012"},
    {"person2", ".898/.405", "-", "-", ".037", ".038/.016", ".034/.013"}};
const std::vector<std::vector<std::string>> kTable3{
    {"w/xyz", ".0143/.0072", ".0150/.0075", ".0153/.0075", ".0156/.0077"},
    {"w/half", ".0233/.0114", ".0245/.0128", ".0244/.0121", ".0253/.0134"},
    {"w/static", ".0058/.0027", ".0064/.0029", ".0065/.0030", ".0064/.0032"},
    {"w/rpy", ".0314/.0177", ".0331/.0196", ".0329/.0180", ".0344/.0211"},
    {"s/static", ".0054/.0026", ".0060/.0029", ".0053/.0025", ".0064/.0028"}};
const std::vector<std::vector<std::string>> kTable4{
    {"w/half", "14.44", "4.35", "7.34", "4.57", "16.79", "47.49"},
    {"w/static", "14.61", "4.14", "7.58", "4.56", "8.58", "39.47"},
    {"s/static", "15.14", "4.37", "11.85", "4.29", "7.84", "43.49"}};

/// The row of a sequence (by the paper's name) and variant, null if there is none.
const Json* find_row(const Json& rows, const std::string& paper_name, const std::string& variant) {
  for (const auto* all : {&paper_sequences(), &further_sequences()})
    for (const PaperSequence& s : *all)
      if (paper_name == s.name)
        for (const Json& row : rows)
          if (row["sequence"] == s.folder && row["variant"] == variant) return &row;
  return nullptr;
}

/// "0.0143/0.0072", or why there is no number to compare.
std::string ate_cell(const Json* row) {
  if (!row) return "-";
  if (row->value("failed", "") == "error") return "error";
  if (row->value("failed", "") == "coverage")
    return "failed: " + fixed(100 * number_at(*row, "coverage_min"), 0) + " %";
  return fixed(number_at(*row, "ate_rmse_mean_m"), 4) + "/" +
         fixed(number_at(*row, "ate_sd_mean_m"), 4);
}

/// Extraction, compensation, fusion, probability, all else, total.
std::string time_cell(const Json* row, std::size_t column) {
  if (!row || row->value("failed", "") == "error") return "-";
  static const char* const kKeys[] = {"ms_extraction_median", "ms_compensation_median",
                                      "ms_depth_median", "ms_probability_median"};
  if (column < 4) return fixed(number_at(*row, kKeys[column]), 2);
  double rest = number_at(*row, "ms_total_median");
  if (column == 5) return fixed(rest, 2);
  for (const char* key : kKeys) rest -= number_at(*row, key);
  return fixed(rest, 2);
}

/// Published rows with a column of ours for each of `variants`.
Table ate_table(const char* title, std::vector<std::string> header,
                const std::vector<std::vector<std::string>>& published,
                const std::vector<std::pair<std::string, std::string>>& ours, const Json& rows) {
  Table table{title, std::move(header), published};
  for (const auto& [variant, label] : ours) {
    table.header.push_back(label);
    for (auto& row : table.rows) row.push_back(ate_cell(find_row(rows, row[0], variant)));
  }
  return table;
}

}  // namespace

const std::vector<PaperSequence>& paper_sequences() {
  static const std::vector<PaperSequence> all{
      {"rgbd_dataset_freiburg3_walking_xyz", "w/xyz", "fr3"},
      {"rgbd_dataset_freiburg3_walking_halfsphere", "w/half", "fr3"},
      {"rgbd_dataset_freiburg3_walking_static", "w/static", "fr3"},
      {"rgbd_dataset_freiburg3_walking_rpy", "w/rpy", "fr3"},
      {"rgbd_dataset_freiburg3_sitting_static", "s/static", "fr3"},
      {"rgbd_bonn_crowd", "crowd1", "bonn"},
      {"rgbd_bonn_crowd2", "crowd2", "bonn"},
      {"rgbd_bonn_crowd3", "crowd3", "bonn"},
      {"rgbd_bonn_person_tracking", "person1", "bonn"},
      {"rgbd_bonn_person_tracking2", "person2", "bonn"}};
  return all;
}

const std::vector<PaperSequence>& further_sequences() {
  static const std::vector<PaperSequence> all{
      {"rgbd_dataset_freiburg2_desk_with_person", "desk/person", "fr2"},
      {"rgbd_dataset_freiburg3_sitting_xyz", "s/xyz", "fr3"},
      {"rgbd_dataset_freiburg3_sitting_halfsphere", "s/half", "fr3"},
      {"rgbd_dataset_freiburg3_sitting_rpy", "s/rpy", "fr3"},
      {"rgbd_bonn_balloon", "balloon", "bonn"},
      {"rgbd_bonn_balloon2", "balloon2", "bonn"},
      {"rgbd_bonn_balloon_tracking", "balloon_track", "bonn"},
      {"rgbd_bonn_balloon_tracking2", "balloon_track2", "bonn"},
      {"rgbd_bonn_moving_nonobstructing_box", "mv_box", "bonn"},
      {"rgbd_bonn_moving_nonobstructing_box2", "mv_box2", "bonn"},
      {"rgbd_bonn_moving_obstructing_box", "mv_o_box", "bonn"},
      {"rgbd_bonn_moving_obstructing_box2", "mv_o_box2", "bonn"},
      {"rgbd_bonn_placing_nonobstructing_box", "p_box", "bonn"},
      {"rgbd_bonn_placing_nonobstructing_box2", "p_box2", "bonn"},
      {"rgbd_bonn_placing_nonobstructing_box3", "p_box3", "bonn"},
      {"rgbd_bonn_placing_obstructing_box", "p_o_box", "bonn"},
      {"rgbd_bonn_removing_nonobstructing_box", "rm_box", "bonn"},
      {"rgbd_bonn_removing_nonobstructing_box2", "rm_box2", "bonn"},
      {"rgbd_bonn_removing_obstructing_box", "rm_o_box", "bonn"},
      {"rgbd_bonn_synchronous", "sync", "bonn"},
      {"rgbd_bonn_synchronous2", "sync2", "bonn"},
      {"rgbd_bonn_static", "static", "bonn"},
      {"rgbd_bonn_static_close_far", "static_close_far", "bonn"}};
  return all;
}

std::vector<BenchJob> make_paper_jobs(const BenchPlan& plan, const fs::path& data,
                                      std::vector<std::string>& notes) {
  std::vector<BenchJob> jobs;
  if (plan.common.frames > 0)
    notes.push_back("--frames: parts of sequences cannot be compared with the published numbers");
  const auto is_there = [&](const PaperSequence& s) {
    return fs::is_regular_file(data / s.folder / "rgb.txt");
  };
  const auto add = [&](const PaperSequence& s) {
    BenchPlan one = plan;
    one.sequences = {data / s.folder};
    if (one.common.camera.empty() && !fs::exists(data / s.folder / "camera.yaml"))
      one.common.camera = s.camera;
    for (BenchJob& job : make_jobs(one, notes)) jobs.push_back(std::move(job));
  };
  for (const PaperSequence& s : paper_sequences())
    if (is_there(s))
      add(s);
    else
      notes.push_back(std::string(s.folder) + ": not in " + data.string() + " (scripts/download_" +
                      (s.camera == std::string("bonn") ? "bonn" : "tum") + " fetches it)");
  for (const PaperSequence& s : further_sequences())
    if (is_there(s)) add(s);
  if (jobs.empty())
    throw Error("--paper " + data.string() +
                ": expected at least one of the ten sequences, such as " +
                paper_sequences().front().folder + ", found none");
  return jobs;
}

std::vector<Table> paper_tables(const Json& rows) {
  const auto has_row = [&](const PaperSequence& s) {
    return std::any_of(rows.begin(), rows.end(),
                       [&](const Json& row) { return row["sequence"] == s.folder; });
  };
  std::vector<std::vector<std::string>> further;
  for (const PaperSequence& s : further_sequences())
    if (has_row(s)) further.push_back({s.name});
  const bool any = std::any_of(paper_sequences().begin(), paper_sequences().end(), has_row);
  if (!any && further.empty()) return {};
  const std::vector<std::pair<std::string, std::string>> presets{
      {"off", "ours: off"},
      {"paper", "ours: paper"},
      {"network_only", "ours: network_only"},
      {"default", "ours: default"}};
  std::vector<Table> tables;
  if (!further.empty())
    tables.push_back(
        ate_table("Further sequences", {"ATE RMSE / S.D. [m]"}, further, presets, rows));
  if (!any) return tables;
  tables.push_back(ate_table("Table 1. TUM RGB-D, freiburg3", kAteHeader, kTable1, presets, rows));
  tables.push_back(ate_table("Table 2. Bonn RGB-D Dynamic", kAteHeader, kTable2, presets, rows));
  tables.push_back(ate_table(
      "Table 3. Ablation",
      {"ATE RMSE / S.D. [m]", "the paper", "w/o comp.", "w/o depth", "w/o prob."}, kTable3,
      {{"default", "ours: default"},
       {"no_compensation", "ours: w/o comp."},
       {"no_depth", "ours: w/o depth"},
       {"no_probability", "ours: w/o prob."}},
      rows));
  Table times{"Table 4. Time per frame",
              {"[ms]", "ORB", "compensation", "fusion", "probability", "others", "total"},
              {}};
  for (const auto& published : kTable4) {
    times.rows.push_back(published);
    times.rows.back()[0] += ", the paper";
    for (const auto& [variant, label] : {std::make_pair("paper", ", ours: paper preset"),
                                         std::make_pair("default", ", ours: default")}) {
      times.rows.push_back({published[0] + label});
      for (std::size_t c = 0; c < 6; ++c)
        times.rows.back().push_back(time_cell(find_row(rows, published[0], variant), c));
    }
  }
  tables.push_back(times);
  return tables;
}

const char* paper_legend() {
  return "Published: as the paper prints them (Sensors 2025, 25, 1696; mean of five runs, 3000 ORB "
         "features, its own\nmachine and network). Ours: mean of the runs above, SE(3) alignment, "
         "all "
         "frames; \"failed\" gives the coverage\nof a run under 95 %, whose error says nothing. "
         "Others: segmentation, motion check and tracking.\n";
}

}  // namespace stillpoint::cli
