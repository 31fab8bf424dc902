// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <nlohmann/json.hpp>

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
inline Accuracy measure_accuracy(const Trajectory& groundtruth, const Trajectory& estimate,
                                 const std::vector<double>& frames,
                                 const RpeSettings& rpe_settings) {
  return {ate(groundtruth, estimate), rpe(groundtruth, estimate, rpe_settings),
          coverage(groundtruth, estimate, frames)};
}

inline nlohmann::ordered_json to_json(const Accuracy& a) {
  return {{"ate_rmse_m", a.ate.rmse_m},
          {"ate_sd_m", a.ate.sd_m},
          {"ate_mean_m", a.ate.mean_m},
          {"ate_median_m", a.ate.median_m},
          {"ate_max_m", a.ate.max_m},
          {"rpe_trans_m", a.rpe.translation_m.rmse},
          {"rpe_rot_deg", a.rpe.rotation_deg.rmse},
          {"coverage", a.coverage.share},
          {"pairs", a.ate.pairs}};
}

}  // namespace stillpoint::cli
