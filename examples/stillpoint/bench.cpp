// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <cstdio>
#include <memory>

#include "bench_paper.hpp"
#include "bench_plan.hpp"
#include "bench_results.hpp"
#include "bench_run.hpp"
#include "bench_summary.hpp"
#include "commands.hpp"
#include "files.hpp"
#include "options.hpp"
#include "stillpoint/core/error.hpp"
#include "stillpoint/io/text_file.hpp"
#include "systems.hpp"
#include "terminal.hpp"

namespace stillpoint::cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct BenchOptions {
  BenchPlan plan;
  BenchRun how;
  /// Folder with the sequences of the paper; empty: not asked for.
  fs::path paper;
  std::string shard;
  std::vector<fs::path> merge;
  /// Merge also what is incomplete.
  bool partial = false;
};

/// Part `index` of `count` of the runs, from "I/N".
struct Shard {
  std::size_t index = 0, count = 1;
};

Shard parse_shard(const std::string& text) {
  unsigned index = 0, count = 0;
  char end = 0;
  if (std::sscanf(text.c_str(), "%u/%u%c", &index, &count, &end) != 2 || index >= count)
    throw CLI::ValidationError("--shard",
                               "expected I/N with 0 <= I < N, e.g. 0/4, found \"" + text + "\"");
  return {index, count};
}

/// The first few of many, for a message.
std::string some_of(const std::vector<std::string>& all) {
  constexpr std::size_t kShown = 6;
  std::string text;
  for (std::size_t i = 0; i < std::min(all.size(), kShown); ++i) text += (i ? ", " : "") + all[i];
  return all.size() > kShown ? text + ", and " + std::to_string(all.size() - kShown) + " more"
                             : text;
}

std::string text_of(const Table& table) {
  TextTable text(table.header);
  text.rule();
  for (const std::vector<std::string>& row : table.rows) text.add(row);
  return text.text();
}

/// The result files of the runs that ended in error.
std::vector<std::string> broken_runs(const std::vector<Json>& results, const Json& plan) {
  std::vector<std::string> files;
  for (const Json& result : results) {
    if (result.contains("stats")) continue;
    for (const Json& run : plan["runs"])
      if (run["job"] == result["job"]) files.push_back(run["file"].get<std::string>());
  }
  return files;
}

/// Makes table, CSV, JSON and page of the plan's results in these folders. Returns the runs that
/// ended in error, whose rows are marked.
std::vector<std::string> write_page(const std::vector<fs::path>& folders, const Json& plan,
                                    bool partial, const fs::path& out) {
  std::vector<std::string> missing;
  const std::vector<Json> results = read_results(folders, plan, missing);
  const std::string lack = std::to_string(missing.size()) + " of " +
                           std::to_string(plan["runs"].size()) +
                           " runs are missing: " + some_of(missing);
  if (results.empty()) throw Error("bench: no results in " + (folders.front() / "runs").string());
  if (!missing.empty() && !partial)
    throw Error("bench: " + lack + "; run what is missing, or merge what is there with --partial");
  make_folder(out);
  const Json rows = make_rows(results, plan);
  const std::string command = command_line() + (missing.empty() ? "" : "\n# incomplete: " + lack);
  write_json(out / "results.json",
             {{"command", command_line()}, {"rows", rows}, {"missing", missing}});
  write_file(out / "results.csv", rows_csv(rows), "table");
  write_file(out / "index.html", make_page(rows, results, command), "page");
  const std::vector<SummaryRow> summary = summarize(rows);
  if (!summary.empty())
    std::printf("\n%s%s", text_of(summary_table(summary)).c_str(), summary_legend());
  std::printf("\n%s", rows_text(rows).c_str());
  const std::vector<Table> tables = paper_tables(rows);
  for (const Table& table : tables)
    std::printf("\n%s\n%s", table.title.c_str(), text_of(table).c_str());
  if (!tables.empty()) std::printf("\n%s", paper_legend());
  if (!missing.empty()) std::printf("\nincomplete: %s\n", lack.c_str());
  std::printf("\nwritten: %s, results.csv, results.json\n", (out / "index.html").string().c_str());
  return broken_runs(results, plan);
}

/// Refuses options that do not go together.
void check_options(const BenchOptions& options) {
  const bool sequences = !options.plan.sequences.empty(), paper = !options.paper.empty();
  if (!options.merge.empty()) {
    if (sequences || paper)
      throw CLI::ValidationError(
          "--merge", "runs nothing, so it takes no SEQUENCE and no --paper; found " +
                         (paper ? options.paper : options.plan.sequences.front()).string());
    return;
  }
  if (options.partial) throw CLI::ValidationError("--partial", "only --merge has a use for it");
  if (!sequences && !paper)
    throw CLI::RequiredError("SEQUENCE (or --paper DATA_DIR, or --merge with folders of results)");
  if (sequences && paper)
    throw CLI::ValidationError("--paper", "finds its sequences, so it takes no SEQUENCE; found " +
                                              options.plan.sequences.front().string());
}

void merge(const BenchOptions& options) {
  const Json plan = common_plan(options.merge);
  const std::vector<std::string> broken =
      write_page(options.merge, plan, options.partial, options.how.out);
  if (broken.empty()) return;
  throw Error("bench --merge: " + std::to_string(broken.size()) + " of " +
              std::to_string(plan["runs"].size()) +
              " runs ended in error, and their rows are marked: " + some_of(broken) +
              "; run their shards again");
}

void bench(const BenchOptions& options) {
  check_options(options);
  if (!options.merge.empty()) return merge(options);
  const Shard shard = options.shard.empty() ? Shard() : parse_shard(options.shard);
  std::vector<std::string> notes;
  if (options.paper.empty()) check_masks_folders(options.plan);
  std::vector<BenchJob> all = options.paper.empty()
                                  ? make_jobs(options.plan, notes)
                                  : make_paper_jobs(options.plan, options.paper, notes);
  check_each_once(all);
  check_presets_differ(all);
  add_keys(all);
  std::vector<BenchJob> jobs;
  for (std::size_t i = shard.index; i < all.size(); i += shard.count) jobs.push_back(all[i]);
  for (const std::string& note : notes) std::printf("note: %s\n", note.c_str());
  if (jobs.empty()) throw Error("bench: nothing to run");
  make_folder(options.how.out / "runs");
  const Json plan = make_plan(all, shard.count);
  write_json(options.how.out / "plan.json", plan);

  const bool good = run_jobs(jobs, options.how);
  if (shard.count == 1)
    write_page({options.how.out}, plan, true, options.how.out);
  else
    std::printf("done with shard %s; when all are: stillpoint bench --merge DIR... --out DIR\n",
                options.shard.c_str());
  if (!good) throw Error("bench: at least one run broke off; the lines above say why");
}

const char* const kBenchFooter = R"(
Variants: off, paper, network_only (without the motion check), default, no_compensation, no_depth,
no_probability, no_masks (the motion check alone), truth (masks_gt as masks, nothing to repair).

Examples:
  stillpoint bench walk_xyz walk_rpy --out bench
  stillpoint bench walk_xyz --out bench --runs 5 --masks-folder masks --masks-folder masks_4hz
  stillpoint bench walk_* --out bench --variants off,default,truth
  stillpoint bench walk_* --out bench --variants off,default --vary dilation_px=0,5,10,20
  stillpoint bench walk_* --out bench --estimate 'orb_slam3=results/{}.txt'
The ten sequences of the paper (scripts/download_tum, scripts/download_bonn), beside what it prints:
  stillpoint bench --paper data --out bench
On many machines, then one page of all:
  stillpoint bench walk_* --out shard3 --runs 5 --shard 3/16
  stillpoint bench --merge shard* --out bench
Shards of different settings, inputs or builds are refused, and so is a merge with runs missing,
unless --partial is given.

Each run writes its result to DIR/runs/ when it is done. The same command again goes on where it was
stopped; results of other settings, inputs or another build of the program are made anew. Then
DIR/index.html (one page that needs no other file), DIR/results.csv and DIR/results.json are made.

Sequences that differ in the shutter only, named NAME_00ms, NAME_20ms, ... (scripts/demo --blur makes
them), also give charts of the error against it; --vary gives charts against the setting.

Coverage stands beside every error: a tracker that is soon lost has a small error over few frames, so
rows under 95 % are marked as failed.)";

/// What every job of the bench is to be like.
void add_setting_options(CLI::App* command, BenchPlan& plan) {
  command
      ->add_option("--camera", plan.common.camera,
                   "fr1, fr2, fr3, bonn or a YAML file  [SEQUENCE/camera.yaml]")
      ->type_name("NAME|FILE");
  choices(command->add_option("--tracker", plan.common.tracker,
                              "The system that tracks  [" + default_tracker() + "]"),
          tracker_names());
  between(command->add_option("--features", plan.common.features,
                              "Keypoints per frame; up to three times as many\nwhere masks hide "
                              "much  [1000; --paper: 3000]"),
          50, 100000);
  between(command->add_option("--frames", plan.common.frames, "Only the first N frames  [all]"), 1,
          1000000);
  add_groundtruth_option(command, plan.common.groundtruth_of);
  add_front_end_options(command, plan.common);
  command
      ->add_option("--vary", plan.vary,
                   "Also the default preset with one setting changed: dilation_px=0,5,10,20")
      ->allow_extra_args(false)
      ->type_name("NAME=N,...");
}

/// Which jobs are done, and where.
void add_run_options(CLI::App* command, BenchOptions& options) {
  BenchPlan& plan = options.plan;
  command
      ->add_option("--shard", options.shard, "Do only part I of N of the runs, 0 <= I < N; no page")
      ->type_name("I/N");
  command
      ->add_option("--merge", options.merge,
                   "Run nothing: one page of the results in these folders")
      ->type_name("DIR");
  command->add_flag("--partial", options.partial,
                    "Merge also where runs are missing; the table says where");
  command
      ->add_option("--estimate", plan.estimates,
                   "Another system's trajectory; {} = the sequence's name")
      ->allow_extra_args(false)
      ->type_name("NAME=FILE");
  between(command->add_option("--jobs", options.how.parallel,
                              "Runs at the same time; times then mean less  [1]"),
          1, 256);
  command->add_flag("--fresh", options.how.fresh, "Run everything again, also what is there");
}

}  // namespace

void add_bench_command(CLI::App& app) {
  auto* command = app.add_subcommand(
      "bench", "Compare: front end off, on, without each stage, with exact masks");
  auto options = std::make_shared<BenchOptions>();
  BenchPlan& plan = options->plan;
  plan.common.tracker = default_tracker();
  command->add_option("SEQUENCE", plan.sequences, "Folders in TUM layout")->type_name("DIR");
  command->add_option("--out", options->how.out, "Folder for the results")
      ->required()
      ->type_name("DIR");
  command
      ->add_option(
          "--paper", options->paper,
          "The paper's and further public sequences in this\nfolder; prints its Tables 1 to 4")
      ->type_name("DATA_DIR");
  between(command->add_option(
              "--runs", plan.runs,
              "Of each variant, each with its own seed\n(see run --help)  [1; --paper: 5]"),
          1, 1000);
  command
      ->add_option("--masks-folder", plan.masks_folders,
                   "Inside each sequence; again for more rows (masks_4hz)  [masks]")
      ->transform(without_last_slash())
      ->allow_extra_args(false)
      ->delimiter(',')
      ->type_name("NAME");
  std::vector<std::string> names;
  for (const Variant& v : variants()) names.push_back(v.name);
  choices(command->add_option("--variants", plan.variant_names, "Only these rows; with commas"),
          names)
      ->transform(renamed({{"motion", "default"}, {"motion_alone", "no_masks"}}))
      ->allow_extra_args(false)
      ->delimiter(',')
      ->type_name("NAME,...");
  add_setting_options(command, plan);
  add_run_options(command, *options);
  command->footer(kBenchFooter);
  command->callback([options, command] {
    if (!options->paper.empty()) {
      // As the paper did, unless told otherwise.
      if (command->count("--runs") == 0) options->plan.runs = 5;
      if (command->count("--features") == 0) options->plan.common.features = 3000;
    }
    load_settings(options->plan.common);
    bench(*options);
  });
}

}  // namespace stillpoint::cli
