// SPDX-License-Identifier: BSD-2-Clause
#include <cstdio>
#include <filesystem>
#include <memory>

#include "accuracy.hpp"
#include "bench_results.hpp"
#include "commands.hpp"
#include "options.hpp"
#include "stillpoint/io/trajectory_file.hpp"
#include "stillpoint/io/tum_sequence.hpp"
#include "terminal.hpp"

namespace stillpoint::cli {
namespace {

struct EvaluateOptions {
  std::filesystem::path groundtruth, estimate, frames;
  double rpe_seconds = 0;
  std::string groundtruth_of = "camera";
  bool json = false;
};

/// The frames that coverage is about, and where they were found.
struct Frames {
  std::vector<double> times;
  std::string source;
};

/// By the rule of `run`: the pairs of color and depth of the sequence that `list` (rgb.txt) belongs
/// to. Where there is no such sequence, the list alone; where there is no list, a guess.
Frames frames_of(const EvaluateOptions& options, const Trajectory& groundtruth,
                 const Trajectory& estimate) {
  const bool asked = !options.frames.empty();
  const std::filesystem::path list =
      asked ? options.frames : options.groundtruth.parent_path() / "rgb.txt";
  if (list.filename() == "rgb.txt" && std::filesystem::exists(list)) {
    try {
      return {TumSequence(list.parent_path().empty() ? "." : list.parent_path()).timestamps(),
              list.string()};
    } catch (const Error&) {
      // The lists without their images are no sequence, and tell the frames all the same.
    }
  }
  if (!asked && !std::filesystem::exists(list)) return {guess_frames(groundtruth, estimate), ""};
  Frames frames{{}, list.string()};
  for (const ListedFile& f : read_file_list(list)) frames.times.push_back(f.timestamp);
  return frames;
}

void evaluate(const EvaluateOptions& options) {
  const Trajectory groundtruth =
      camera_groundtruth(read_trajectory(options.groundtruth), options.groundtruth_of);
  const Trajectory estimate = read_trajectory(options.estimate);
  const Frames frames = frames_of(options, groundtruth, estimate);
  const Accuracy accuracy = measure_accuracy(
      groundtruth, estimate, frames.times,
      options.rpe_seconds > 0 ? RpeSettings::over_seconds(options.rpe_seconds) : RpeSettings());
  if (const auto problem = scale_problem(accuracy))
    std::fprintf(stderr, "stillpoint: warning: %s\n", problem->c_str());
  if (options.json) {
    auto json = to_json(accuracy);
    json["frames_from"] = frames.source.empty() ? "guess" : frames.source;
    json["groundtruth_of"] = options.groundtruth_of;
    std::printf("%s\n", json.dump(2).c_str());
    return;
  }
  const AteResult& ate = accuracy.ate;
  const Coverage& cover = accuracy.coverage;
  std::printf("coverage    %.1f %%  (%zu of %zu frames with ground truth have a pose%s)%s\n",
              100 * cover.share, cover.covered, cover.frames,
              frames.source.empty() ? "; frames are guessed, --frames rgb.txt knows them" : "",
              cover.share < kCoverageFloor ? "\n            FAILED: under 95 %, so the error below "
                                             "says little about the whole sequence"
                                           : "");
  std::printf("ATE [m]     RMSE %.4f  S.D. %.4f  mean %.4f  median %.4f  max %.4f  (%zu poses)\n",
              ate.rmse_m, ate.sd_m, ate.mean_m, ate.median_m, ate.max_m, ate.pairs);
  std::printf("            aligned in SE(3), pairs within %.2f s, ground truth of the %s\n",
              kMaxDifferenceS, options.groundtruth_of.c_str());
  std::printf("Sim(3)      RMSE %.4f with the scale aligned, too (by %.4f)\n",
              accuracy.ate_sim3.rmse_m, accuracy.ate_sim3.scale);
  const auto say_rpe = [](const RpeResult& rpe, const std::string& over) {
    std::printf("RPE         %s m, %s deg  (RMSE, %s)\n", fixed(rpe.translation_m.rmse, 4).c_str(),
                fixed(rpe.rotation_deg.rmse, 3).c_str(), over.c_str());
  };
  say_rpe(accuracy.rpe, options.rpe_seconds > 0 ? fixed(options.rpe_seconds, 2) + " s apart"
                                                : "from pose to pose");
  say_rpe(accuracy.rpe_1s, "over a second");
  if (options.groundtruth_of == "camera")
    std::printf("evo         %s\n", evo_command(options.groundtruth, options.estimate).c_str());
}

}  // namespace

void add_evaluate_command(CLI::App& app) {
  auto* command = app.add_subcommand("evaluate", "Compare a trajectory with the ground truth");
  auto options = std::make_shared<EvaluateOptions>();
  command->add_option("--groundtruth", options->groundtruth, "True trajectory, TUM format")
      ->required()
      ->type_name("FILE");
  command->add_option("--estimate", options->estimate, "Trajectory of any system, TUM format")
      ->required()
      ->type_name("FILE");
  command
      ->add_option("--frames", options->frames,
                   "rgb.txt of the sequence, for the coverage\n[beside the ground truth; "
                   "without one frames are guessed]")
      ->type_name("FILE");
  between(command->add_option("--rpe-seconds", options->rpe_seconds,
                              "Relative error over this time  [from pose to pose]"),
          1e-3, 1e6, "S");
  add_groundtruth_option(command, options->groundtruth_of);
  command->add_flag("--json", options->json, "One JSON object on stdout and nothing else");
  command->footer(R"(
Example:
  stillpoint evaluate --groundtruth walk/groundtruth.txt --estimate out/trajectory.txt

A trajectory is a text file with lines of `timestamp tx ty tz qx qy qz qw` (seconds, metres, camera
to world); `#` begins a comment. Poses are paired with the nearest ground truth within 0.02 s. ATE is
the absolute trajectory error after least-squares alignment in SE(3), without scale, as the TUM RGB-D
benchmark and evo define it; RPE the relative pose error (RMSE). Coverage is the share of the frames
with ground truth that have a pose; below 95 % an error says little.

Keys of --json: ate_rmse_m ate_sd_m ate_mean_m ate_median_m ate_max_m rpe_trans_m rpe_rot_deg
coverage (0 to 1) pairs rpe_1s_trans_m rpe_1s_rot_deg ate_sim3_rmse_m scale (the factor that Sim(3)
alignment gives the estimate) max_difference_s frames_from (a file, or guess) groundtruth_of)");
  command->callback([options] { evaluate(*options); });
}

}  // namespace stillpoint::cli
