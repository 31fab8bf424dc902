// SPDX-License-Identifier: BSD-2-Clause
#include "accuracy.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "environment.hpp"
#include "stillpoint/evaluation/bonn_ground_truth.hpp"
#include "stillpoint/io/trajectory_file.hpp"
#include "stillpoint/io/tum_sequence.hpp"
#include "terminal.hpp"

namespace stillpoint::cli {
namespace {

namespace fs = std::filesystem;
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

double spread_m(const Trajectory& truth, const std::vector<TimestampPair>& matches) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double squares = 0;
  for (const TimestampPair& m : matches) {
    const Eigen::Vector3d p = truth[m.first].T_world_camera.translation() -
                              truth[matches[0].first].T_world_camera.translation();
    sum += p;
    squares += p.squaredNorm();
  }
  const auto n = static_cast<double>(matches.size());
  return std::sqrt(std::max(0.0, squares / n - (sum / n).squaredNorm()));
}

}  // namespace

Accuracy measure_accuracy(const Trajectory& groundtruth, const Trajectory& estimate,
                          const std::vector<double>& frames, const RpeSettings& rpe_settings) {
  const AteResult rigid = ate(groundtruth, estimate, kMaxDifferenceS);
  return {rigid,
          ate(groundtruth, estimate, kMaxDifferenceS, Alignment::kSim3),
          spread_m(groundtruth, rigid.matches),
          rpe(groundtruth, estimate, rpe_settings),
          rpe(groundtruth, estimate, RpeSettings::over_seconds(1)),
          coverage(groundtruth, estimate, frames, kMaxDifferenceS)};
}

std::optional<std::string> scale_problem(const Accuracy& a, std::optional<double> units_per_m) {
  constexpr double kLeastErrorM = 0.01, kLeastRatio = 1.3, kExplained = 0.3;
  const double scale = a.ate_sim3.scale;
  if (!(scale > 0) || std::abs(std::log(scale)) < std::log(kLeastRatio) ||
      a.ate.rmse_m < kLeastErrorM || a.ate_sim3.rmse_m > kExplained * a.ate.rmse_m ||
      a.ate_sim3.rmse_m > kExplained * a.spread_m)  // else a camera that stood explains anything
    return std::nullopt;
  return "the estimate is " + fixed(1 / scale, 2) +
         " times as large as the ground truth, and without that its error would be " +
         fixed(a.ate_sim3.rmse_m, 4) + " m: is the depth factor (units per metre) right? " +
         (units_per_m ? fixed(*units_per_m / scale, 0) + " in place of " + fixed(*units_per_m, 0)
                      : "One " + fixed(1 / scale, 2) + " times as large") +
         " would fit";
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

bool is_measurable(const Trajectory& groundtruth, const Trajectory& estimate) {
  return associate(detail::timestamps_of(groundtruth), detail::timestamps_of(estimate),
                   kMaxDifferenceS)
             .size() >= 3;
}

void add_accuracy(Json& stats, Json* series, const Trajectory& groundtruth,
                  const Trajectory& estimate, const std::vector<double>& frames,
                  std::optional<double> units_per_m,
                  const std::function<void(const std::string&)>& say) {
  const Coverage cover = coverage(groundtruth, estimate, frames);
  if (cover.frames == 0) {
    say("the ground truth has no pose within 0.02 s of any frame");
    return;
  }
  stats["coverage"] = cover.share;
  stats["coverage_of"] = "frames with ground truth";
  if (!is_measurable(groundtruth, estimate)) {
    say("there is a pose for " + std::to_string(cover.covered) +
        " frames with ground truth only, and there are fewer than three pairs of poses: no error "
        "to speak of");
    return;
  }
  const Accuracy accuracy = measure_accuracy(groundtruth, estimate, frames, RpeSettings());
  stats["evaluation"] = to_json(accuracy);
  if (const auto problem = scale_problem(accuracy, units_per_m)) say(*problem);
  if (series) add_paths(*series, groundtruth, estimate, accuracy.ate, frames);
}

Json judge_estimate(const RunSettings& settings, const fs::path& file) {
  const TumSequence sequence(settings.sequence);
  Trajectory estimate = read_trajectory(file);
  std::vector<double> times = sequence.timestamps();
  if (settings.frames > 0 && settings.frames < times.size()) {
    times.resize(settings.frames);
    // As far as the rows beside it.
    while (!estimate.empty() && estimate.back().timestamp > times.back() + kMaxDifferenceS)
      estimate.pop_back();
  }
  if (!sequence.has_groundtruth())
    throw Error("sequence " + settings.sequence.string() +
                ": has no groundtruth.txt to judge an estimate by");
  Json notes = Json::array(), series, stats;
  stats["frames"] = times.size();
  stats["tracked"] = associate(times, detail::timestamps_of(estimate)).size();
  stats["coverage"] = 0.0;
  for (double t : times) series["t_s"].push_back(std::round((t - times.front()) * 1e6) / 1e6);
  stats["groundtruth_of"] = settings.groundtruth_of;
  add_accuracy(stats, &series, camera_groundtruth(sequence.groundtruth(), settings.groundtruth_of),
               estimate, times, {}, [&](const std::string& text) { notes.push_back(text); });
  stats["estimate"] = file.string();
  stats["versions"] = versions_json();
  stats["machine"] = machine_json();
  stats["notes"] = notes;
  stats["series"] = series;
  return stats;
}

}  // namespace stillpoint::cli
