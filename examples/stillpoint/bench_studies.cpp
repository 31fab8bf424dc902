// SPDX-License-Identifier: BSD-2-Clause
#include "bench_studies.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "bench_results.hpp"
#include "statistics.hpp"

namespace stillpoint::cli {
namespace {

using Json = nlohmann::ordered_json;
constexpr double kMissing = std::numeric_limits<double>::quiet_NaN();

struct Curve {
  const char* variant;
  const char* name;
};
const Curve kCurves[] = {{"off", "front end off"},
                         {"paper", "paper preset"},
                         {"network_only", "network_only"},
                         {"default", "default preset"}};

/// One value of all frames against another.
struct Cloud {
  std::vector<std::pair<double, double>> points;
  void add(const Json& series, const std::string& x, const std::string& y, double factor) {
    if (!series.contains(x) || !series.contains(y)) return;
    const Json &xs = series[x], &ys = series[y];
    for (std::size_t i = 0; i < std::min(xs.size(), ys.size()); ++i)
      if (xs[i].is_number() && ys[i].is_number())
        points.emplace_back(xs[i].get<double>(), factor * ys[i].get<double>());
  }
  /// Mean (or median) of y over eight groups of equally many frames, ordered by x.
  Series binned(const Curve& curve, bool use_median) {
    constexpr std::size_t kBins = 8;
    Series line{curve.name, variant_color(curve.variant), {}, {}};
    std::sort(points.begin(), points.end());
    for (std::size_t begin = 0, bin = 1; begin < points.size(); ++bin) {
      std::size_t end = std::max(begin + 1, bin * points.size() / kBins);
      // The same blur never stands in two groups.
      while (end < points.size() && points[end].first == points[end - 1].first) ++end;
      std::vector<double> x, y;
      for (std::size_t i = begin; i < std::min(end, points.size()); ++i)
        x.push_back(points[i].first), y.push_back(points[i].second);
      line.x.push_back(mean(x));
      line.y.push_back(use_median ? median(y) : mean(y));
      begin = end;
    }
    return line;
  }
};

LineChart axes(const std::string& title, const std::string& x, const std::string& y) {
  LineChart plot;
  plot.title = title;
  plot.x_label = x;
  plot.y_label = y;
  return plot;
}

/// A plot of all frames: `y` of the given masks (before) and of each variant (after), or, for the
/// error, of each variant alone.
LineChart against_blur(const std::vector<Json>& results, const std::string& x,
                       const std::string& x_label, const std::string& y, const std::string& title,
                       const std::string& y_label) {
  constexpr std::size_t kLeastFrames = 40;
  const bool error = y == "error_m";
  LineChart plot = axes(title, x_label, y_label);
  const auto gather = [&](const Curve& curve, const std::string& key) {
    Cloud cloud;
    for (const Json& r : results)
      if (r["job"]["variant"] == curve.variant && r.contains("stats") &&
          r["stats"].contains("series"))
        cloud.add(r["stats"]["series"], x, key, error ? 1000 : y == "missed" ? 100 : 1);
    if (cloud.points.size() >= kLeastFrames) plot.series.push_back(cloud.binned(curve, error));
  };
  if (!error) {
    gather({"default", "given masks"}, y + "_before");
    if (!plot.series.empty()) plot.series.back().color = "muted";
  }
  for (const Curve& curve : kCurves)
    if (!error || curve.variant != std::string("off"))
      gather(curve, error ? y : y + "_after");
    else
      gather(curve, y);
  plot.y_from_zero = y == "missed";
  plot.log_y = error;
  return plot;
}

/// "xyz_20ms" is {"xyz", 20}; false for other names.
bool split_shutter(const std::string& name, std::string& rest, double& shutter_ms) {
  const std::size_t line = name.rfind('_');
  if (line == std::string::npos || name.size() < line + 4 ||
      name.compare(name.size() - 2, 2, "ms") != 0)
    return false;
  const std::string digits = name.substr(line + 1, name.size() - line - 3);
  if (digits.find_first_not_of("0123456789") != std::string::npos || digits.size() > 6)
    return false;
  rest = name.substr(0, line);
  shutter_ms = std::stod(digits);
  return true;
}

/// For each group of sequences that differ in their shutter: error against the shutter.
std::vector<LineChart> shutter_plots(const Json& rows) {
  std::map<std::string, std::set<double>> groups;
  std::string rest;
  double shutter = 0;
  for (const Json& row : rows)
    if (split_shutter(row["sequence"], rest, shutter)) groups[rest].insert(shutter);
  std::vector<LineChart> plots;
  for (const auto& [group, shutters] : groups) {
    if (shutters.size() < 2) continue;
    LineChart plot = axes("ATE against the shutter, motion " + group + " (gaps: failed)",
                          "exposure time [ms]", "ATE RMSE [mm], log scale");
    plot.log_y = true;
    for (const Curve& curve : kCurves) {
      Series line{curve.name, variant_color(curve.variant), {}, {}};
      for (double s : shutters)
        for (const Json& row : rows)
          if (row["variant"] == curve.variant && split_shutter(row["sequence"], rest, shutter) &&
              rest == group && shutter == s && line.x.size() < shutters.size()) {
            line.x.push_back(s);
            line.y.push_back(row["failed"] == "" ? 1000 * number_at(row, "ate_rmse_m") : kMissing);
          }
      if (!line.x.empty()) plot.series.push_back(line);
    }
    plots.push_back(plot);
  }
  return plots;
}

std::vector<LineChart> frame_plots(const std::vector<Json>& results) {
  const std::string people = "motion of the people during the exposure [px]",
                    room = "motion of the room during the exposure [px]",
                    sharp = "sharpness of the edges (low: blurred)";
  std::vector<LineChart> plots{
      against_blur(results, "people_motion_px", people, "iou", "Mask IoU against true motion",
                   "IoU before dilation"),
      against_blur(results, "sharpness", sharp, "iou", "Mask IoU against sharpness",
                   "IoU before dilation"),
      against_blur(results, "people_motion_px", people, "missed", "Misses against true motion",
                   "missed of the people [%]"),
      against_blur(results, "sharpness", sharp, "missed", "Misses against sharpness",
                   "missed of the people [%]")};
  if (plots[1].series.empty()) return {};
  plots.push_back(against_blur(results, "room_motion_px", room, "error_m",
                               "Position error against true motion",
                               "median error [mm], log scale"));
  plots.push_back(against_blur(results, "sharpness", sharp, "error_m",
                               "Position error against sharpness", "median error [mm], log scale"));
  plots.erase(std::remove_if(plots.begin(), plots.end(),
                             [](const LineChart& p) { return p.series.empty(); }),
              plots.end());
  return plots;
}

/// Three plots per setting: error, keypoints of the whole image, mask IoU.
std::vector<LineChart> plots_of_settings(const std::vector<const Json*>& rows) {
  std::map<std::string, std::set<double>> settings;
  std::vector<std::string> sequences;
  for (const Json* row : rows) {
    const std::string name = row->value("varied", "");
    if (name.empty()) continue;
    settings[name].insert(number_at(*row, "varied_value"));
    if (std::find(sequences.begin(), sequences.end(), (*row)["sequence"]) == sequences.end())
      sequences.push_back((*row)["sequence"]);
  }
  std::vector<LineChart> plots;
  for (const auto& [name, values] : settings) {
    if (values.size() < 2) continue;
    LineChart error =
        axes("Error against " + name + " (gaps: failed)", name, "ATE RMSE [mm], median");
    LineChart points = axes("Keypoints of the whole image against " + name, name, "share [%]");
    LineChart iou = axes("Mask IoU against " + name, name, "IoU before dilation");
    for (std::size_t s = 0; s < sequences.size(); ++s) {
      const std::string who = sequences.size() > 1 ? sequences[s] : "";
      Series e{who.empty() ? "error" : who, palette(s), {}, {}};
      Series i = e;
      Series kept{(who.empty() ? "" : who + ", ") + "static, kept", palette(s), {}, {}};
      Series removed{(who.empty() ? "" : who + ", ") + "on people, removed", palette(s), {}, {}};
      removed.dashed = true;
      for (double value : values)
        for (const Json* row : rows) {
          if (row->value("varied", "") != name || number_at(*row, "varied_value") != value ||
              (*row)["sequence"] != sequences[s])
            continue;
          for (Series* line : {&e, &i, &kept, &removed}) line->x.push_back(value);
          e.y.push_back((*row)["failed"] == "" ? 1000 * number_at(*row, "ate_rmse_m") : kMissing);
          i.y.push_back(number_at(*row, "mask_iou_after"));
          kept.y.push_back(100 * number_at(*row, "keypoints_static_kept"));
          removed.y.push_back(100 * number_at(*row, "keypoints_recall"));
          break;
        }
      error.series.push_back(e);
      iou.series.push_back(i);
      points.series.push_back(kept);
      points.series.push_back(removed);
    }
    for (LineChart* plot : {&error, &points, &iou}) {
      plot->y_from_zero = true;
      plots.push_back(*plot);
    }
  }
  return plots;
}

}  // namespace

std::vector<LineChart> setting_charts(const Json& rows) {
  std::vector<const Json*> all;
  for (const Json& row : rows) all.push_back(&row);
  return plots_of_settings(all);
}

std::vector<LineChart> blur_charts(const Json& rows, const std::vector<Json>& results) {
  std::vector<LineChart> charts = shutter_plots(rows);
  for (LineChart& chart : frame_plots(results)) charts.push_back(std::move(chart));
  return charts;
}

}  // namespace stillpoint::cli
