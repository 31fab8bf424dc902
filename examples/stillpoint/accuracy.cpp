// SPDX-License-Identifier: BSD-2-Clause
#include "accuracy.hpp"

#include <cmath>
#include <utility>

#include "stillpoint/evaluation/bonn_ground_truth.hpp"
#include "terminal.hpp"

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
  return {ate(groundtruth, estimate, kMaxDifferenceS),
          ate(groundtruth, estimate, kMaxDifferenceS, Alignment::kSim3),
          rpe(groundtruth, estimate, rpe_settings),
          rpe(groundtruth, estimate, RpeSettings::over_seconds(1)),
          coverage(groundtruth, estimate, frames, kMaxDifferenceS)};
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
          {"pairs", a.ate.pairs},
          {"rpe_1s_trans_m", a.rpe_1s.translation_m.rmse},
          {"rpe_1s_rot_deg", a.rpe_1s.rotation_deg.rmse},
          {"ate_sim3_rmse_m", a.ate_sim3.rmse_m},
          {"scale", a.ate_sim3.scale},
          {"max_difference_s", kMaxDifferenceS}};
}

std::string evo_command(const std::filesystem::path& groundtruth,
                        const std::filesystem::path& estimate) {
  const auto quoted = [](const std::string& word) {
    const bool plain = word.find_first_not_of(
                           "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz"
                           "0123456789_-./=+,") == std::string::npos;
    return plain ? word : "'" + word + "'";
  };
  return "evo_ape tum " + quoted(groundtruth.string()) + " " + quoted(estimate.string()) +
         " --align --t_max_diff " + fixed(kMaxDifferenceS, 2);
}

Trajectory camera_groundtruth(Trajectory groundtruth, const std::string& of) {
  return of == "body" ? camera_of_bonn_body(std::move(groundtruth)) : groundtruth;
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
