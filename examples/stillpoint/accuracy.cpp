// SPDX-License-Identifier: BSD-2-Clause
#include "accuracy.hpp"

#include <cmath>

namespace stillpoint::cli {
namespace {

using Json = nlohmann::ordered_json;

/// Aligned estimate and ground truth at the frames' times.
void add_paths(Json& series, const Trajectory& truth, const Trajectory& estimate,
               const AteResult& ate, const std::vector<double>& frames) {
  const auto point = [](const Eigen::Vector3d& p) {
    const auto rounded = [](double v) { return std::round(v * 1e4) / 1e4; };
    return Json::array({rounded(p.x()), rounded(p.y()), rounded(p.z())});
  };
  std::vector<double> error(estimate.size(), -1);
  for (std::size_t i = 0; i < ate.matches.size(); ++i)
    error[ate.matches[i].second] = ate.errors_m[i];
  Json path(frames.size(), Json()), errors = path, true_path = path;
  for (const TimestampPair& pair : associate(frames, detail::timestamps_of(estimate))) {
    path[pair.first] =
        point(ate.T_groundtruth_estimate * estimate[pair.second].T_world_camera.translation());
    if (error[pair.second] >= 0) errors[pair.first] = std::round(error[pair.second] * 1e6) / 1e6;
  }
  const std::vector<double> truth_times = detail::timestamps_of(truth);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const std::size_t n = detail::nearest(truth_times, frames[i]);
    if (std::abs(truth_times[n] - frames[i]) < 0.02)
      true_path[i] = point(truth[n].T_world_camera.translation());
  }
  series["error_m"] = errors;
  series["path"] = path;
  series["truth"] = true_path;
}

}  // namespace

Accuracy measure_accuracy(const Trajectory& groundtruth, const Trajectory& estimate,
                          const std::vector<double>& frames, const RpeSettings& rpe_settings) {
  return {ate(groundtruth, estimate), rpe(groundtruth, estimate, rpe_settings),
          coverage(groundtruth, estimate, frames)};
}

Json to_json(const Accuracy& a) {
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

void add_accuracy(Json& stats, Json* series, const Trajectory& groundtruth,
                  const Trajectory& estimate, const std::vector<double>& frames,
                  const std::function<void(const std::string&)>& say) {
  const Coverage cover = coverage(groundtruth, estimate, frames);
  if (cover.frames == 0) {
    say("the ground truth has no pose within 0.02 s of any frame");
    return;
  }
  stats["coverage"] = cover.share;
  stats["coverage_of"] = "frames with ground truth";
  if (cover.covered < 3) {
    say("there is a pose for " + std::to_string(cover.covered) +
        " frames with ground truth only: no error to speak of");
    return;
  }
  const Accuracy accuracy = measure_accuracy(groundtruth, estimate, frames, RpeSettings());
  stats["evaluation"] = to_json(accuracy);
  if (series) add_paths(*series, groundtruth, estimate, accuracy.ate, frames);
}

}  // namespace stillpoint::cli
