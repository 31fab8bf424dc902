// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "run_job.hpp"
#include "stillpoint/evaluation/coverage.hpp"
#include "stillpoint/evaluation/trajectory_error.hpp"

namespace stillpoint::cli {

/// How good a trajectory is, by the keys that `evaluate --json`, stats.json and bench share.
struct Accuracy {
  /// Aligned without scale, and with it.
  AteResult ate, ate_sim3;
  /// RMS distance of the true positions from their mean: how far the camera went, metres.
  double spread_m = 0;
  /// From frame to frame (or what was asked for), and over a second.
  RpeResult rpe, rpe_1s;
  Coverage coverage;
};

/// Poses are paired when less than this apart, as the TUM benchmark does.
constexpr double kMaxDifferenceS = 0.02;

/// Throws Error if fewer than three poses match.
Accuracy measure_accuracy(const Trajectory& groundtruth, const Trajectory& estimate,
                          const std::vector<double>& frames, const RpeSettings& rpe_settings);

/// Says when most of the error is one of scale: a wrong depth factor, or a camera without depth.
/// `units_per_m`: the factor that was used, if it is known.
std::optional<std::string> scale_problem(const Accuracy& accuracy,
                                         std::optional<double> units_per_m = {});

nlohmann::ordered_json to_json(const Accuracy& accuracy);

/// The command of evo (github.com/MichaelGrupp/evo) that gives the same ATE.
std::string evo_command(const std::filesystem::path& groundtruth,
                        const std::filesystem::path& estimate);

/// The camera's ground truth. `of`: what the file's poses are of, "camera", or "body" for Bonn's
/// body of markers.
Trajectory camera_groundtruth(Trajectory groundtruth, const std::string& of);

/// Whether there are the three pairs of poses that an alignment needs.
bool is_measurable(const Trajectory& groundtruth, const Trajectory& estimate);

/// Puts coverage, "coverage_of" and, unless too little was tracked, "evaluation" into `stats`, by
/// one rule for our own runs and for other systems' trajectories. `frames`: timestamps of all
/// frames. `units_per_m`: the depth factor that was used, if it is known. `series` (may be null)
/// gets error_m, path and truth per frame, for plots. What the user should know goes to `say`.
void add_accuracy(nlohmann::ordered_json& stats, nlohmann::ordered_json* series,
                  const Trajectory& groundtruth, const Trajectory& estimate,
                  const std::vector<double>& frames, std::optional<double> units_per_m,
                  const std::function<void(const std::string&)>& say);

/// Judges another system's trajectory (TUM format) of a sequence by the same rules, as far as they
/// apply. Of `settings` it takes sequence, frames and groundtruth_of. Throws Error for bad input
/// and without ground truth.
nlohmann::ordered_json judge_estimate(const RunSettings& settings,
                                      const std::filesystem::path& file);

}  // namespace stillpoint::cli
