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
  bool json = false;
};

void evaluate(const EvaluateOptions& options) {
  const Trajectory groundtruth = read_trajectory(options.groundtruth);
  const Trajectory estimate = read_trajectory(options.estimate);
  std::vector<double> frames;
  if (options.frames.empty())
    frames = guess_frames(groundtruth, estimate);
  else
    for (const ListedFile& f : read_file_list(options.frames)) frames.push_back(f.timestamp);
  const Accuracy accuracy = measure_accuracy(
      groundtruth, estimate, frames,
      options.rpe_seconds > 0 ? RpeSettings::over_seconds(options.rpe_seconds) : RpeSettings());
  if (options.json) {
    std::printf("%s\n", to_json(accuracy).dump(2).c_str());
    return;
  }
  const AteResult& ate = accuracy.ate;
  const Coverage& cover = accuracy.coverage;
  std::printf("coverage    %.1f %%  (%zu of %zu frames with ground truth have a pose)%s\n",
              100 * cover.share, cover.covered, cover.frames,
              cover.share < kCoverageFloor ? "\n            FAILED: under 95 %, so the error below "
                                             "says little about the whole sequence"
                                           : "");
  std::printf("ATE [m]     RMSE %.4f  S.D. %.4f  mean %.4f  median %.4f  max %.4f  (%zu poses)\n",
              ate.rmse_m, ate.sd_m, ate.mean_m, ate.median_m, ate.max_m, ate.pairs);
  std::printf("RPE         %s m, %s deg  (RMSE, %s)\n",
              fixed(accuracy.rpe.translation_m.rmse, 4).c_str(),
              fixed(accuracy.rpe.rotation_deg.rmse, 3).c_str(),
              options.rpe_seconds > 0 ? (fixed(options.rpe_seconds, 2) + " s apart").c_str()
                                      : "from pose to pose");
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
                   "rgb.txt of the sequence, for the coverage  [frames are guessed]")
      ->type_name("FILE");
  between(command->add_option("--rpe-seconds", options->rpe_seconds,
                              "Relative error over this time  [from pose to pose]"),
          1e-3, 1e6, "S");
  command->add_flag("--json", options->json, "One JSON object on stdout and nothing else");
  command->footer(R"(
Example:
  stillpoint evaluate --groundtruth walk/groundtruth.txt --estimate out/trajectory.txt

A trajectory is a text file with lines of `timestamp tx ty tz qx qy qz qw` (seconds, metres, camera
to world); `#` begins a comment. Poses are paired with the nearest ground truth within 0.02 s. ATE is
the absolute trajectory error after least-squares alignment in SE(3), without scale, as the TUM RGB-D
benchmark defines it; RPE the relative pose error (RMSE). Coverage is the share of the frames with
ground truth that have a pose; below 95 % an error says little.

Keys of --json: ate_rmse_m ate_sd_m ate_mean_m ate_median_m ate_max_m rpe_trans_m rpe_rot_deg
coverage (0 to 1) pairs)");
  command->callback([options] { evaluate(*options); });
}

}  // namespace stillpoint::cli
