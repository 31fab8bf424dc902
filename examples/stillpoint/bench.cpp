// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <functional>
#include <memory>
#include <mutex>
#include <opencv2/core.hpp>
#include <thread>

#include "bench_paper.hpp"
#include "bench_plan.hpp"
#include "bench_results.hpp"
#include "bench_studies.hpp"
#include "commands.hpp"
#include "options.hpp"
#include "stillpoint/core/error.hpp"
#include "stillpoint/io/text_file.hpp"
#include "terminal.hpp"

namespace stillpoint::cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct BenchOptions {
  BenchPlan plan;
  fs::path out;
  /// Folder with the sequences of the paper; empty: not asked for.
  fs::path paper;
  std::string shard;
  std::vector<fs::path> merge;
  /// Merge also what is incomplete.
  bool partial = false;
  int parallel = 1;
  bool fresh = false;
};

/// True if the file holds the finished result of this very job.
bool is_done(const fs::path& file, const Json& key) {
  std::ifstream in(file);
  if (!in) return false;
  const Json old = Json::parse(in, nullptr, false);
  return old.is_object() && old.contains("stats") && old.value("job", Json()) == key;
}

void run_one(const BenchJob& job, const BenchOptions& options,
             const std::function<void(double share)>& progress) {
  const fs::path file = options.out / job.result_file();
  const fs::path base = fs::path(file).replace_extension();  // VARIANT.RUN
  make_folder(file.parent_path());
  RunOutputs outputs;
  outputs.trajectory = base.string() + ".trajectory.txt";
  outputs.series = true;
  const std::string& variant = job.variant.name;
  const bool shown =
      job.run == 0 && (variant == "off" || variant == "default" || variant == "network_only");
  if (shown) {
    outputs.overlays_dir = base.string() + ".overlays";
    outputs.overlays_jpeg = true;
    outputs.overlay_stems =
        frames_to_show(job, job.masks_folder.empty() ? "masks" : job.masks_folder);
    fs::remove_all(outputs.overlays_dir);
    outputs.map_views_dir = base.string() + ".map";
  }
  Json result;
  result["job"] = job.key;
  try {
    if (!job.estimate.empty())
      result["stats"] = judge_estimate(job.settings.sequence, job.estimate, job.settings.frames);
    else
      result["stats"] = run_job(job.settings, outputs, [&](std::size_t done, std::size_t total) {
        progress(static_cast<double>(done) / static_cast<double>(total));
      });
  } catch (const Error& e) {
    result["error"] = e.what();
  }
  // Beside other jobs the process's memory is not this one's.
  if (options.parallel > 1 && result.contains("stats")) result["stats"].erase("peak_memory_mb");
  if (shown && result.contains("stats")) {
    result["overlays"] = Json::array();
    for (const std::string& stem : outputs.overlay_stems)
      result["overlays"].push_back(outputs.overlays_dir.filename().string() + "/" + stem + ".jpg");
    for (const char* name : {"behind", "above"})
      result["map_views"].push_back(outputs.map_views_dir.filename().string() + "/" + name +
                                    ".jpg");
  }
  write_json(file, result);
}

void print_job(const BenchJob& job, const fs::path& file, bool kept, double seconds) {
  std::ifstream in(file);
  const Json result = Json::parse(in, nullptr, false);
  std::string label = job.label();
  label.erase(0, label.find_first_not_of(' '));
  std::string line = job.sequence + ", " + label + ", run " + std::to_string(job.run + 1) + ": ";
  if (result.contains("error")) {
    line += result["error"].get<std::string>();
  } else {
    const Json& stats = result["stats"];
    line += "coverage " + fixed(100 * stats.value("coverage", 0.0), 1) + " %";
    if (stats.contains("evaluation") && stats["evaluation"]["ate_rmse_m"].is_number())
      line += ", ATE " + fixed(stats["evaluation"]["ate_rmse_m"].get<double>(), 4) + " m";
  }
  if (result.contains("stats"))
    for (const Json& note : result["stats"].value("notes", Json::array()))
      line += "\n  note: " + note.get<std::string>();
  line += kept ? "  (kept from before)" : "  (" + fixed(seconds, 1) + " s)";
  std::printf("%s\n", line.c_str());
  std::fflush(stdout);
}

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

/// Makes table, CSV, JSON and page of the plan's results in these folders.
void write_page(const std::vector<fs::path>& folders, const Json& plan, bool partial,
                const fs::path& out) {
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
  std::string pictures;
  for (const auto& [name, picture] : {std::make_pair("blur.svg", blur_picture(rows, results)),
                                      std::make_pair("settings.svg", setting_picture(rows))}) {
    if (picture.empty()) continue;
    write_file(out / name, picture, "picture");
    pictures += std::string(", ") + name;
  }
  std::printf("\n%s", rows_text(rows).c_str());
  const std::vector<Table> tables = paper_tables(rows);
  for (const Table& table : tables) {
    TextTable text(table.header);
    text.rule();
    for (const std::vector<std::string>& row : table.rows) text.add(row);
    std::printf("\n%s\n%s", table.title.c_str(), text.text().c_str());
  }
  if (!tables.empty()) std::printf("\n%s", paper_legend());
  if (!missing.empty()) std::printf("\nincomplete: %s\n", lack.c_str());
  std::printf("\nwritten: %s, results.csv, results.json%s\n", (out / "index.html").string().c_str(),
              pictures.c_str());
}

/// One sequence may lack a folder of masks; a name that none has is mistyped.
void check_masks_folders(const BenchPlan& plan) {
  for (const std::string& folder : plan.masks_folders)
    if (folder != "masks" &&
        std::none_of(plan.sequences.begin(), plan.sequences.end(),
                     [&](const fs::path& s) { return fs::is_directory(s / folder); }))
      throw Error("--masks-folder: expected a folder inside a sequence, found no \"" + folder +
                  "\" in any of them");
}

/// Does the jobs that are not done yet, some at a time. Returns false if one of them broke off.
bool run_jobs(const std::vector<BenchJob>& jobs, const BenchOptions& options) {
  // One job has the machine for itself; more share it, each with one thread.
  if (options.parallel > 1) cv::setNumThreads(1);
  std::mutex mutex;
  std::size_t next = 0;
  bool good = true;
  std::vector<double> shares(jobs.size(), 0);
  auto bar = std::make_unique<Progress>("bench", 1000 * jobs.size());
  const auto work = [&] {
    for (;;) {
      std::size_t i = 0;
      {
        const std::lock_guard<std::mutex> lock(mutex);
        if (next == jobs.size()) return;
        i = next++;
      }
      const fs::path file = options.out / jobs[i].result_file();
      const bool kept = !options.fresh && is_done(file, jobs[i].key);
      const auto start = std::chrono::steady_clock::now();
      std::string failure;
      try {
        if (!kept)
          run_one(jobs[i], options, [&](double share) {
            const std::lock_guard<std::mutex> lock(mutex);
            shares[i] = share;
            double sum = 0;
            for (double s : shares) sum += s;
            // A job is a thousand steps, so that sequences of any length share one bar.
            if (bar) bar->update(static_cast<std::size_t>(1000 * sum));
          });
      } catch (const std::exception& e) {
        failure = e.what();
      }
      const double seconds =
          std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
      const std::lock_guard<std::mutex> lock(mutex);
      shares[i] = 1;
      bar->clear();
      if (failure.empty()) {
        print_job(jobs[i], file, kept, seconds);
      } else {
        std::printf("%s: %s\n", jobs[i].sequence.c_str(), failure.c_str());
      }
      good = good && failure.empty() && is_done(file, jobs[i].key);
    }
  };
  std::vector<std::thread> threads;
  for (int t = 1; t < options.parallel; ++t) threads.emplace_back(work);
  work();
  for (std::thread& thread : threads) thread.join();
  return good;
}

void bench(const BenchOptions& options) {
  if (!options.merge.empty()) {
    if (!options.plan.sequences.empty() || !options.paper.empty())
      throw CLI::ValidationError(
          "--merge",
          "runs nothing, so it takes no SEQUENCE and no --paper; found " +
              (options.paper.empty() ? options.plan.sequences.front() : options.paper).string());
    const Json plan = common_plan(options.merge);
    write_page(options.merge, plan, options.partial, options.out);
    return;
  }
  if (options.partial) throw CLI::ValidationError("--partial", "only --merge has a use for it");
  if (options.plan.sequences.empty() && options.paper.empty())
    throw CLI::RequiredError("SEQUENCE (or --paper DATA_DIR, or --merge with folders of results)");
  if (!options.plan.sequences.empty() && !options.paper.empty())
    throw CLI::ValidationError("--paper", "finds its sequences, so it takes no SEQUENCE; found " +
                                              options.plan.sequences.front().string());
  const Shard shard = options.shard.empty() ? Shard() : parse_shard(options.shard);
  std::vector<std::string> notes;
  if (options.paper.empty()) check_masks_folders(options.plan);
  std::vector<BenchJob> all = options.paper.empty()
                                  ? make_jobs(options.plan, notes)
                                  : make_paper_jobs(options.plan, options.paper, notes);
  add_keys(all);
  std::vector<BenchJob> jobs;
  for (std::size_t i = shard.index; i < all.size(); i += shard.count) jobs.push_back(all[i]);
  for (const std::string& note : notes) std::printf("note: %s\n", note.c_str());
  if (jobs.empty()) throw Error("bench: nothing to run");
  make_folder(options.out / "runs");
  const Json plan = make_plan(all, shard.count);
  write_json(options.out / "plan.json", plan);

  const bool good = run_jobs(jobs, options);
  if (shard.count == 1) {
    write_page({options.out}, plan, true, options.out);
  } else {
    std::printf("done with shard %s; when all are: stillpoint bench --merge DIR... --out DIR\n",
                options.shard.c_str());
  }
  if (!good) throw Error("bench: at least one run broke off; the lines above say why");
}

}  // namespace

void add_bench_command(CLI::App& app) {
  auto* command = app.add_subcommand(
      "bench", "Compare: front end off, on, without each stage, with exact masks");
  auto options = std::make_shared<BenchOptions>();
  BenchPlan& plan = options->plan;
  plan.common.tracker = default_tracker();
  command->add_option("SEQUENCE", plan.sequences, "Folders in TUM layout")->type_name("DIR");
  command->add_option("--out", options->out, "Folder for the results")
      ->required()
      ->type_name("DIR");
  command
      ->add_option("--paper", options->paper,
                   "The ten sequences of the paper in this folder; prints its Tables 1 to 4")
      ->type_name("DATA_DIR");
  between(command->add_option(
              "--runs", plan.runs,
              "Of each variant, each with its own seed (see run --help)  [1; --paper: 5]"),
          1, 1000);
  command
      ->add_option("--masks-folder", plan.masks_folders,
                   "Inside each sequence; again for more rows (masks_4hz)  [masks]")
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
  add_front_end_options(command, plan.common);
  command
      ->add_option("--vary", plan.vary,
                   "Also the default preset with one setting changed: dilation_px=0,5,10,20")
      ->allow_extra_args(false)
      ->type_name("NAME=N,...");
  command
      ->add_option("--shard", options->shard,
                   "Do only part I of N of the runs, 0 <= I < N; no page")
      ->type_name("I/N");
  command
      ->add_option("--merge", options->merge,
                   "Run nothing: one page of the results in these folders")
      ->type_name("DIR");
  command->add_flag("--partial", options->partial,
                    "Merge also where runs are missing; the table says where");
  command
      ->add_option("--estimate", plan.estimates,
                   "Another system's trajectory; {} = the sequence's name")
      ->allow_extra_args(false)
      ->type_name("NAME=FILE");
  between(command->add_option("--jobs", options->parallel,
                              "Runs at the same time; times then mean less  [1]"),
          1, 256);
  command->add_flag("--fresh", options->fresh, "Run everything again, also what is there");
  command->footer(R"(
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
them), also give plots of the error against it: DIR/blur.svg. --vary gives DIR/settings.svg.

Coverage stands beside every error: a tracker that is soon lost has a small error over few frames, so
rows under 95 % are marked as failed.)");
  command->callback([options, command] {
    if (!options->paper.empty()) {
      // As the paper did, unless told otherwise.
      if (command->count("--runs") == 0) options->plan.runs = 5;
      if (command->count("--features") == 0) options->plan.common.features = 3000;
    }
    bench(*options);
  });
}

}  // namespace stillpoint::cli
