// SPDX-License-Identifier: BSD-2-Clause
#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <memory>

#include "bench_plan.hpp"
#include "bench_results.hpp"
#include "commands.hpp"
#include "stillpoint/core/error.hpp"
#include "terminal.hpp"

namespace stillpoint::cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct BenchOptions {
  BenchPlan plan;
  fs::path out;
  bool fresh = false;
};

/// True if the file holds the finished result of this very job.
bool is_done(const fs::path& file, const Json& key) {
  std::ifstream in(file);
  if (!in) return false;
  const Json old = Json::parse(in, nullptr, false);
  return old.is_object() && old.contains("stats") && old.value("job", Json()) == key;
}

void run_one(const BenchJob& job, const Json& key, const fs::path& out, Progress& progress,
             std::size_t job_index) {
  const fs::path file = out / job.result_file();
  const fs::path base = fs::path(file).replace_extension();  // VARIANT.RUN
  make_folder(file.parent_path());
  RunOutputs outputs;
  outputs.trajectory = base.string() + ".trajectory.txt";
  outputs.series = true;
  const bool shown = job.run == 0 && (job.variant.name == "off" || job.variant.name == "default");
  if (shown) {
    outputs.overlays_dir = base.string() + ".overlays";
    outputs.overlays_jpeg = true;
    outputs.overlay_stems =
        frames_to_show(job, job.masks_folder.empty() ? "masks" : job.masks_folder);
    fs::remove_all(outputs.overlays_dir);
  }
  Json result;
  result["job"] = key;
  try {
    result["stats"] = run_job(job.settings, outputs, [&](std::size_t done, std::size_t total) {
      // A job is a thousand steps, so that sequences of any length share one bar.
      progress.update(1000 * job_index + 1000 * done / std::max<std::size_t>(1, total));
    });
  } catch (const Error& e) {
    result["error"] = e.what();
  }
  if (shown && result.contains("stats")) {
    result["overlays"] = Json::array();
    for (const std::string& stem : outputs.overlay_stems)
      result["overlays"].push_back(outputs.overlays_dir.filename().string() + "/" + stem + ".jpg");
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

void bench(const BenchOptions& options) {
  std::vector<std::string> notes;
  const std::vector<BenchJob> jobs = make_jobs(options.plan, notes);
  if (jobs.empty()) throw Error("bench: nothing to run; see the notes on what was left out");
  make_folder(options.out / "runs");
  for (const std::string& note : notes) std::printf("note: %s\n", note.c_str());

  bool failed = false;
  std::vector<fs::path> files;
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    const fs::path file = options.out / jobs[i].result_file();
    const Json key = job_key(jobs[i]);
    const bool done = !options.fresh && is_done(file, key);
    const auto start = std::chrono::steady_clock::now();
    if (!done) {
      Progress progress("run " + std::to_string(i + 1) + " of " + std::to_string(jobs.size()),
                        1000 * jobs.size());
      run_one(jobs[i], key, options.out, progress, i);
    }
    const double seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    print_job(jobs[i], file, done, seconds);
    failed = failed || !is_done(file, key);
  }

  const std::vector<Json> results = read_results({options.out});
  const Json rows = make_rows(results);
  std::string command = "stillpoint bench";
  for (const fs::path& s : options.plan.sequences) command += " " + s.string();
  command += " --out " + options.out.string() + " --runs " + std::to_string(options.plan.runs) +
             " --tracker " + options.plan.common.tracker;
  write_json(options.out / "results.json", {{"command", command}, {"rows", rows}});
  std::ofstream(options.out / "results.csv") << rows_csv(rows);
  std::ofstream(options.out / "index.html") << make_page(rows, results, command);
  std::printf("\n%s\nwritten: %s, results.csv, results.json, runs/\n", rows_text(rows).c_str(),
              (options.out / "index.html").string().c_str());
  if (failed) throw Error("bench: at least one run broke off; the table says why");
}

}  // namespace

void add_bench_command(CLI::App& app) {
  auto* command = app.add_subcommand(
      "bench", "Compare: front end off, presets, each stage left out, ground-truth masks");
  auto options = std::make_shared<BenchOptions>();
  BenchPlan& plan = options->plan;
  plan.common.tracker = default_tracker();
  command->add_option("SEQUENCE", plan.sequences, "Folders in TUM layout")->required();
  command->add_option("--out", options->out, "Folder for the results")->required();
  command
      ->add_option("--runs", plan.runs,
                   "Runs of each variant, each with its own seed; the table shows median and worst")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  command
      ->add_option("--masks-folder", plan.masks_folders,
                   "Folder of masks inside each sequence; again for more rows (masks_4hz ...)")
      ->allow_extra_args(false)
      ->delimiter(',')
      ->capture_default_str();
  std::string names;
  for (const Variant& v : variants()) names += (names.empty() ? "" : ",") + v.name;
  command->add_option("--variants", plan.variant_names, "Only these rows, of " + names)
      ->allow_extra_args(false)
      ->delimiter(',');
  command->add_option("--camera", plan.common.camera,
                      "fr1, fr2, fr3, bonn or a YAML file  [SEQUENCE/camera.yaml]");
  command->add_option("--tracker", plan.common.tracker, "Tracking system")
      ->check(CLI::IsMember(tracker_names()))
      ->capture_default_str();
  command
      ->add_option("--features", plan.common.features, "Keypoints per frame  [the tracker's own]")
      ->check(CLI::Range(50, 100000));
  command->add_option("--frames", plan.common.frames, "Only the first N frames  [all]");
  command->add_flag("--fresh", options->fresh, "Run everything again, also what is there");
  command->footer(R"(
Examples:
  stillpoint bench walk_xyz walk_rpy --out bench
  stillpoint bench walk_xyz --out bench --runs 5 --masks-folder masks --masks-folder masks_4hz

Each run writes its result to DIR/runs/ when it is done. The same command again goes on where it was
stopped; results of other settings, inputs or another build of the program are made anew. Then
DIR/index.html (one page that needs no other file), DIR/results.csv and DIR/results.json are made.

Coverage stands beside every error: a tracker that is soon lost has a small error over few frames, so
rows under 95 % are marked as failed.)");
  command->callback([options] { bench(*options); });
}

}  // namespace stillpoint::cli
