// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "bench_plan.hpp"

namespace stillpoint::cli {

/// A public sequence whose camera is known.
struct PaperSequence {
  /// Name of its folder, as the data set's archive has it.
  const char* folder;
  /// What tables call it: for the paper's, the paper's word.
  const char* name;
  /// Its camera: fr2, fr3 or bonn.
  const char* camera;
};

/// The ten sequences of the paper.
const std::vector<PaperSequence>& paper_sequences();

/// Other sequences of the same two data sets that dynamic SLAM systems are measured on.
const std::vector<PaperSequence>& further_sequences();

/// The jobs of those of the sequences that are in `data`, with the right camera unless the plan
/// names one or the folder has a camera.yaml. What is missing of the paper's ten gets a line in
/// `notes`. Throws Error if none of all is there.
std::vector<BenchJob> make_paper_jobs(const BenchPlan& plan, const std::filesystem::path& data,
                                      std::vector<std::string>& notes);

/// A table of cells, the first column being names.
struct Table {
  std::string title;
  std::vector<std::string> header;
  std::vector<std::vector<std::string>> rows;
};

/// The paper's Tables 1 to 4: the published columns, and ours from `rows` (see make_rows). Empty if
/// no row is of one of the ten sequences.
std::vector<Table> paper_tables(const nlohmann::ordered_json& rows);

/// What stands below the tables: where the published numbers are from, what ours are.
const char* paper_legend();

}  // namespace stillpoint::cli
