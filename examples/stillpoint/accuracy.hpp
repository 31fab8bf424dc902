// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "stillpoint/evaluation/coverage.hpp"
#include "stillpoint/evaluation/trajectory_error.hpp"

namespace stillpoint::cli {

/// How good a trajectory is, by the keys that `evaluate --json`, stats.json and bench share.
struct Accuracy {
  AteResult ate;
  RpeResult rpe;
  Coverage coverage;
};

/// Throws Error if fewer than three poses match.
Accuracy measure_accuracy(const Trajectory& groundtruth, const Trajectory& estimate,
                          const std::vector<double>& frames, const RpeSettings& rpe_settings);

nlohmann::ordered_json to_json(const Accuracy& accuracy);

/// Puts coverage, "coverage_of" and, unless too little was tracked, "evaluation" into `stats`, by
/// one rule for our own runs and for other systems' trajectories. `frames`: timestamps of all
/// frames. `series` (may be null) gets error_m, path and truth per frame, for plots. What the user
/// should know goes to `say`.
void add_accuracy(nlohmann::ordered_json& stats, nlohmann::ordered_json* series,
                  const Trajectory& groundtruth, const Trajectory& estimate,
                  const std::vector<double>& frames,
                  const std::function<void(const std::string&)>& say);

}  // namespace stillpoint::cli
