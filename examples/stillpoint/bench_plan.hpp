// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "run_job.hpp"

namespace stillpoint::cli {

/// One way to run the system that a table compares.
struct Variant {
  std::string name;
  /// How tables call it.
  std::string label;
  bool front_end = true;
  std::string preset = "default";
  std::vector<std::string> without;
  /// Takes the exact masks of masks_gt.
  bool truth = false;
  /// Takes the masks of a segmenter.
  bool segmenter = true;
  /// One setting with another value than the preset's; empty: none.
  std::string varied = {};
  double varied_value = 0;
};

/// All variants, in the order of the table.
const std::vector<Variant>& variants();

/// One run: a sequence, a variant, a folder of masks, a number.
struct BenchJob {
  /// The sequence's name in tables and paths; unique in a bench.
  std::string sequence;
  Variant variant;
  /// Folder of masks inside the sequence; empty where the variant has its own or needs none.
  std::string masks_folder;
  int run = 0;
  RunSettings settings;
  /// A trajectory of another system, which is only judged; empty: a run of our own.
  std::filesystem::path estimate;
  /// What must be equal for an old result to be taken again: settings, input files (names and
  /// sizes), and the program itself. Filled in by add_keys().
  nlohmann::ordered_json key;

  /// Where its result lives, relative to the bench's folder: runs/SEQUENCE/VARIANT[+MASKS].RUN.json
  std::filesystem::path result_file() const;
  /// What the table calls it: "default", "default [masks_4hz]".
  std::string label() const;
};

/// What `stillpoint bench` was asked for.
struct BenchPlan {
  std::vector<std::filesystem::path> sequences;
  /// Empty: all.
  std::vector<std::string> variant_names;
  std::vector<std::string> masks_folders{"masks"};
  int runs = 1;
  /// NAME=VALUE,VALUE,...: the default preset with one setting changed, a row for each value.
  std::vector<std::string> vary;
  /// NAME=FILE: other systems' trajectories; {} in FILE stands for the sequence's name.
  std::vector<std::string> estimates;
  /// Camera, tracker, features, frames for every job.
  RunSettings common;
};

/// One sequence may lack a folder of masks; a name that none has is mistyped. Throws Error.
void check_masks_folders(const BenchPlan& plan);

/// A row that is asked for twice would count its runs twice. Throws Error.
void check_each_once(const std::vector<BenchJob>& jobs);

/// Rows of two presets that --settings or --set made one would be equal without a word. Throws
/// Error.
void check_presets_differ(const std::vector<BenchJob>& jobs);

/// The jobs of a plan, in the order of the table. Variants that a sequence has no masks for are
/// left out, with a line for each in `notes`. Throws Error for an unknown variant, a folder that
/// is no sequence, or an estimate that is not NAME=FILE.
std::vector<BenchJob> make_jobs(const BenchPlan& plan, std::vector<std::string>& notes);

/// Fills in the jobs' keys. Looks at each sequence once.
void add_keys(std::vector<BenchJob>& jobs);

/// What plan.json in a bench's folder holds, so that shards know what they are a part of: "shards",
/// and "runs", each with its "file" in the folder and its "job" (the key).
nlohmann::ordered_json make_plan(const std::vector<BenchJob>& jobs, std::size_t shards);

/// The plan that all folders are a part of. Throws Error naming what differs between two of them,
/// or the folder that has no plan.
nlohmann::ordered_json common_plan(const std::vector<std::filesystem::path>& folders);

}  // namespace stillpoint::cli
