// SPDX-License-Identifier: BSD-2-Clause
#include "bench_run.hpp"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <functional>
#include <memory>
#include <mutex>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <thread>

#include "accuracy.hpp"
#include "bench_results.hpp"
#include "files.hpp"
#include "stillpoint/core/error.hpp"
#include "terminal.hpp"

namespace stillpoint::cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

/// True if the file holds the finished result of this very job.
bool is_done(const fs::path& file, const Json& key) {
  std::ifstream in(file);
  if (!in) return false;
  const Json old = Json::parse(in, nullptr, false);
  return old.is_object() && old.contains("stats") && old.value("job", Json()) == key;
}

/// The stems of rgb.txt, so that a sequence without masks is served as well.
std::vector<std::string> stems_of(const RunSettings& settings) {
  std::vector<std::string> stems;
  std::ifstream list(settings.sequence / "rgb.txt");
  for (std::string line; std::getline(list, line);) {
    if (line.empty() || line[0] == '#') continue;
    const std::size_t space = line.find_first_of(" \t");
    if (space == std::string::npos) continue;
    std::string name = line.substr(space + 1);
    name.erase(name.find_last_not_of(" \t\r") + 1);
    stems.push_back(fs::path(name).stem().string());
  }
  if (settings.frames > 0 && settings.frames < stems.size()) stems.resize(settings.frames);
  return stems;
}

/// Pixels of masks_gt that a mask lacks; 0 where one of the two is missing.
int missed_pixels(const fs::path& sequence, const std::string& masks_folder,
                  const std::string& stem) {
  const auto read = [&](const std::string& folder) {
    return cv::imread((sequence / folder / (stem + ".png")).string(), cv::IMREAD_GRAYSCALE);
  };
  const cv::Mat truth = read("masks_gt"), mask = read(masks_folder);
  if (truth.empty() || mask.size() != truth.size()) return 0;
  return cv::countNonZero((truth > 0) & (mask == 0));
}

/// Stems of the frames that a page should show: in each quarter of the sequence the one where the
/// given masks missed most of masks_gt (without masks_gt: the middle one).
std::vector<std::string> frames_to_show(const BenchJob& job) {
  const std::string folder = job.masks_folder.empty() ? "masks" : job.masks_folder;
  const std::vector<std::string> stems = stems_of(job.settings);
  constexpr std::size_t kParts = 4;
  std::vector<std::string> shown;
  for (std::size_t part = 0; part < kParts; ++part) {
    const std::size_t begin = part * stems.size() / kParts;
    const std::size_t end = (part + 1) * stems.size() / kParts;
    if (begin == end) continue;
    std::size_t best = begin + (end - begin) / 2;
    int most_missed = 0;
    for (std::size_t i = begin; i < end; ++i) {
      const int missed = missed_pixels(job.settings.sequence, folder, stems[i]);
      if (missed > most_missed) most_missed = missed, best = i;
    }
    shown.push_back(stems[best]);
  }
  return shown;
}

RunOutputs outputs_of(const BenchJob& job, const fs::path& base, bool shown) {
  RunOutputs outputs;
  outputs.trajectory = base.string() + ".trajectory.txt";
  outputs.trajectory_online = base.string() + ".trajectory_online.txt";
  outputs.groundtruth = base.string() + ".groundtruth.txt";
  outputs.series = true;
  if (shown) {
    outputs.overlays_dir = base.string() + ".overlays";
    outputs.overlays_jpeg = true;
    outputs.overlay_stems = frames_to_show(job);
    fs::remove_all(outputs.overlays_dir);
    outputs.map_views_dir = base.string() + ".map";
  }
  return outputs;
}

void run_one(const BenchJob& job, const BenchRun& options,
             const std::function<void(double share)>& progress) {
  const fs::path file = options.out / job.result_file();
  make_folder(file.parent_path());
  const std::string& variant = job.variant.name;
  const bool shown =
      job.run == 0 && (variant == "off" || variant == "default" || variant == "network_only");
  const RunOutputs outputs =
      outputs_of(job, fs::path(file).replace_extension(), shown);  // VARIANT.RUN
  Json result;
  result["job"] = job.key;
  try {
    if (!job.estimate.empty())
      result["stats"] = judge_estimate(job.settings, job.estimate);
    else
      result["stats"] = run_job(job.settings, outputs, [&](std::size_t done, std::size_t total) {
        progress(static_cast<double>(done) / static_cast<double>(total));
      });
  } catch (const Error& e) {
    result["error"] = e.what();
  }
  const bool same_truth = job.settings.groundtruth_of == "camera";
  // evo cannot turn the ground truth; of our own runs the turned one is beside the trajectory.
  if (result.contains("stats") && result["stats"].contains("evaluation") &&
      (same_truth || job.estimate.empty()))
    result["evo"] =
        evo_command(same_truth ? job.settings.sequence / "groundtruth.txt" : outputs.groundtruth,
                    job.estimate.empty() ? outputs.trajectory : job.estimate);
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
  std::string line =
      job.sequence + ", " + trimmed(job.label()) + ", run " + std::to_string(job.run + 1) + ": ";
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

/// The jobs, some at a time, and one progress bar for all.
class Workers {
 public:
  Workers(const std::vector<BenchJob>& jobs, const BenchRun& options)
      : jobs_(jobs),
        options_(options),
        shares_(jobs.size(), 0),
        // A job is a thousand steps, so that sequences of any length share one bar.
        bar_("bench", 1000 * jobs.size()) {}

  bool run() {
    std::vector<std::thread> threads;
    for (int t = 1; t < options_.parallel; ++t) threads.emplace_back([this] { work(); });
    work();
    for (std::thread& thread : threads) thread.join();
    return good_;
  }

 private:
  void work() {
    for (;;) {
      std::size_t i = 0;
      {
        const std::lock_guard<std::mutex> lock(mutex_);
        if (next_ == jobs_.size()) return;
        i = next_++;
      }
      do_job(i);
    }
  }

  void do_job(std::size_t i) {
    const fs::path file = options_.out / jobs_[i].result_file();
    const bool kept = !options_.fresh && is_done(file, jobs_[i].key);
    const auto start = std::chrono::steady_clock::now();
    std::string failure;
    try {
      if (!kept)
        run_one(jobs_[i], options_, [&](double share) {
          const std::lock_guard<std::mutex> lock(mutex_);
          shares_[i] = share;
          double sum = 0;
          for (double s : shares_) sum += s;
          bar_.update(static_cast<std::size_t>(1000 * sum));
        });
    } catch (const std::exception& e) {
      failure = e.what();
    }
    const double seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    const std::lock_guard<std::mutex> lock(mutex_);
    shares_[i] = 1;
    bar_.clear();
    if (failure.empty())
      print_job(jobs_[i], file, kept, seconds);
    else
      std::printf("%s: %s\n", jobs_[i].sequence.c_str(), failure.c_str());
    good_ = good_ && failure.empty() && is_done(file, jobs_[i].key);
  }

  const std::vector<BenchJob>& jobs_;
  const BenchRun& options_;
  std::mutex mutex_;
  std::size_t next_ = 0;
  bool good_ = true;
  std::vector<double> shares_;
  Progress bar_;
};

}  // namespace

bool run_jobs(const std::vector<BenchJob>& jobs, const BenchRun& options) {
  // One job has the machine for itself; more share it, each with one thread.
  if (options.parallel > 1) cv::setNumThreads(1);
  return Workers(jobs, options).run();
}

}  // namespace stillpoint::cli
