// SPDX-License-Identifier: BSD-2-Clause
#include <cmath>
#include <string>

#include "accuracy.hpp"
#include "bench_results.hpp"
#include "run_job.hpp"
#include "statistics.hpp"
#include "terminal.hpp"

namespace stillpoint::cli {
namespace {

using Json = nlohmann::ordered_json;

/// Lines of a name and a text.
class Lines {
 public:
  void add(const std::string& name, const std::string& text) {
    text_ += name + std::string(name.size() < 12 ? 12 - name.size() : 1, ' ') + text + "\n";
  }
  const std::string& text() const { return text_; }

 private:
  std::string text_;
};

void add_accuracy(Lines& lines, const Json& stats) {
  const double covered = number_at(stats, "coverage");
  lines.add("frames", std::to_string(stats["frames"].get<std::size_t>()) + ", tracked " +
                          std::to_string(stats["tracked"].get<std::size_t>()) + ", coverage " +
                          fixed(100 * covered, 1) + " % of the " +
                          stats["coverage_of"].get<std::string>());
  if (stats.contains("evaluation")) {
    const Json& e = stats["evaluation"];
    lines.add("ATE [m]", "RMSE " + fixed(number_at(e, "ate_rmse_m"), 4) + "  S.D. " +
                             fixed(number_at(e, "ate_sd_m"), 4) + "  max " +
                             fixed(number_at(e, "ate_max_m"), 4) +
                             "  aligned in SE(3), ground truth of the " +
                             stats.value("groundtruth_of", "camera"));
    if (stats.contains("evaluation_online"))
      lines.add("  online", "RMSE " +
                                fixed(number_at(stats["evaluation_online"], "ate_rmse_m"), 4) +
                                " of the poses as each frame had them at its time");
    lines.add("  Sim(3)", "RMSE " + fixed(number_at(e, "ate_sim3_rmse_m"), 4) +
                              " with the scale aligned, too (by " +
                              fixed(number_at(e, "scale"), 4) + ")");
    lines.add("RPE", fixed(number_at(e, "rpe_trans_m"), 4) + " m, " +
                         fixed(number_at(e, "rpe_rot_deg"), 3) + " deg from frame to frame; " +
                         fixed(number_at(e, "rpe_1s_trans_m"), 4) + " m, " +
                         fixed(number_at(e, "rpe_1s_rot_deg"), 3) + " deg over a second");
  }
  if (covered < kCoverageFloor)
    lines.add("", "FAILED: under 95 % coverage; an error over the rest says little");
}

void add_masks(Lines& lines, const Json& m) {
  const auto change = [&](const std::string& name) {
    return fixed(number_at(m, name + "_before"), 3) + " -> " +
           fixed(number_at(m, name + "_after"), 3);
  };
  lines.add("masks", "IoU " + change("iou") + ", recall " + change("recall") + ", precision " +
                         change("precision") + "  (masks_gt, before dilation)");
}

void add_lost(Lines& lines, const Json& stretches) {
  std::string lost;
  for (const Json& l : stretches) {
    if (lost.size() > 200) {
      lost += ", ...";
      break;
    }
    lost += (lost.empty() ? "" : ", ") + std::to_string(l["frames"].get<std::size_t>()) +
            " frames from " + fixed(number_at(l, "from_s"), 2) + " to " +
            fixed(number_at(l, "to_s"), 2) + " s, " +
            (l["found_again"].get<bool>() ? "then found again" : "not found again");
  }
  if (!lost.empty()) lines.add("lost", lost);
}

void add_keypoints(Lines& lines, const Json& k) {
  std::string keypoints = fixed(number_at(k, "extracted"), 0) + " extracted, " +
                          fixed(number_at(k, "kept"), 0) + " kept per frame";
  if (std::isfinite(number_at(k, "kept_on_people")))
    keypoints += "; " + fixed(100 * number_at(k, "kept_on_people"), 2) + " % of the kept on people";
  lines.add("keypoints", keypoints);
}

void add_times(Lines& lines, const Json& times_ms) {
  std::string times;
  for (const auto& [stage, t] : times_ms.items())
    times += (times.empty() ? "" : ", ") + stage + " " + fixed(number_at(t, "median"), 2);
  const Json& total = times_ms["total"];
  lines.add("ms/frame", times + " (medians); total p95 " + fixed(number_at(total, "p95"), 1) +
                            ", longest " + fixed(number_at(total, "max"), 1));
}

}  // namespace

std::string summary_text(const Json& stats) {
  Lines lines;
  add_accuracy(lines, stats);
  if (stats.contains("masks")) add_masks(lines, stats["masks"]);
  if (stats.contains("real_time")) {
    const Json& r = stats["real_time"];
    lines.add("real time", std::to_string(r["dropped_frames"].get<std::size_t>()) +
                               " frames came too late and were dropped, " +
                               fixed(100 * number_at(r, "dropped_share"), 1) + " %");
  }
  add_lost(lines, stats["lost"]);
  if (stats.contains("tracker")) {
    const Json& t = stats["tracker"];
    lines.add("tracker", fixed(number_at(t, "loops_closed"), 0) + " loops closed, " +
                             fixed(number_at(t, "keyframes"), 0) + " keyframes, " +
                             fixed(number_at(t, "map_points"), 0) + " points");
  }
  if (stats.contains("map") && stats["map"].contains("ghosts"))
    lines.add("map", fixed(number_at(stats["map"], "voxels"), 0) + " voxels, " +
                         fixed(100 * number_at(stats["map"], "ghost_share"), 2) +
                         " % ghosts of people");
  add_keypoints(lines, stats["keypoints"]);
  add_times(lines, stats["times_ms"]);
  if (stats.contains("depth_delay_s")) {
    const double delay_ms = 1000 * number_at(stats, "depth_delay_s");
    lines.add("depth", "taken " + fixed(std::abs(delay_ms), 0) + " ms " +
                           (delay_ms < 0 ? "before" : "after") + " its stamp, as color sees it");
  }
  if (stats.contains("depth_readout_s")) {
    const double readout_ms = 1000 * number_at(stats, "depth_readout_s");
    lines.add("depth", "read out in " + fixed(std::abs(readout_ms), 0) + " ms, " +
                           (readout_ms < 0 ? "from the last to the first row"
                                           : "from the first to the last row"));
  }
  std::string status;
  for (const auto& [name, n] : stats["status"].items())
    status += (status.empty() ? "" : ", ") + name + " " + n.dump();
  if (!status.empty()) lines.add("status", status + "  (frames)");
  return lines.text();
}

}  // namespace stillpoint::cli
