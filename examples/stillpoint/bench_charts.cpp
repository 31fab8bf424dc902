// SPDX-License-Identifier: BSD-2-Clause
#include "bench_charts.hpp"

#include <algorithm>
#include <limits>

#include "bench_results.hpp"

namespace stillpoint::cli {
namespace {

using Json = nlohmann::ordered_json;
const char* const kTime = "time since the first frame [s]";
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

std::vector<double> numbers(const Json& array, double factor = 1) {
  std::vector<double> out;
  for (const Json& v : array) out.push_back(v.is_number() ? factor * v.get<double>() : kNaN);
  return out;
}

/// Column `axis` of an array of points, NaN for a missing point.
std::vector<double> column(const Json& points, std::size_t axis) {
  std::vector<double> out;
  for (const Json& p : points) out.push_back(p.is_array() ? p[axis].get<double>() : kNaN);
  return out;
}

bool is_estimate(const Json& result) {
  return result["job"]["variant"].get<std::string>().compare(0, 9, "estimate_") == 0;
}

std::string color_of(const Json& result, std::size_t position) {
  static const char* const others[] = {"#e69f00", "#8c564b", "#9467bd", "#7f7f7f"};
  return is_estimate(result) ? others[position % 4] : variant_color(result["job"]["variant"]);
}

LineChart path_chart(const std::vector<const Json*>& shown, const char* title, std::size_t second,
                     const char* y_label) {
  LineChart chart;
  chart.title = title;
  chart.x_label = "x [m]";
  chart.y_label = y_label;
  chart.equal_axes = true;
  for (std::size_t k = 0; k < shown.size(); ++k) {
    const Json& series = (*shown[k])["stats"]["series"];
    if (!series.contains("path")) continue;
    const auto add = [&](const std::string& name, const std::string& color, const char* points) {
      chart.series.push_back(
          {name, color, column(series[points], 0), column(series[points], second)});
      chart.series.back().t_s = numbers(series["t_s"]);
    };
    if (chart.series.empty()) {
      add("ground truth", "muted", "truth");
      chart.series.back().width = 5;
    }
    const std::string variant = (*shown[k])["job"]["variant"];
    if (variant != "truth") add(trimmed_label(*shown[k]), color_of(*shown[k], k), "path");
  }
  return chart;
}

}  // namespace

std::vector<const Json*> shown_runs(const std::vector<const Json*>& results,
                                    const std::string& on) {
  std::vector<const Json*> shown;
  for (const std::string& name :
       {std::string("off"), std::string("paper"), on, std::string("truth")})
    for (const Json* r : results)
      if ((*r)["job"]["variant"] == name && r->contains("stats") &&
          (*r)["stats"].contains("series")) {
        shown.push_back(r);
        break;
      }
  for (const Json* r : results)
    if (is_estimate(*r) && r->contains("stats")) shown.push_back(r);
  return shown;
}

std::vector<LineChart> path_charts(const std::vector<const Json*>& shown) {
  std::vector<LineChart> charts{path_chart(shown, "Path from above", 1, "y [m]"),
                                path_chart(shown, "Path from the side", 2, "z [m]")};
  charts.erase(std::remove_if(charts.begin(), charts.end(),
                              [](const LineChart& c) { return c.series.size() < 2; }),
               charts.end());
  return charts;
}

std::vector<LineChart> error_chart(const std::vector<const Json*>& shown) {
  LineChart error;
  error.title = "Position error (gaps: no pose)";
  error.x_label = kTime;
  error.y_label = "error [m], log scale";
  error.log_y = true;
  for (std::size_t k = 0; k < shown.size(); ++k) {
    const Json& series = (*shown[k])["stats"]["series"];
    if (series.contains("error_m"))
      error.series.push_back({trimmed_label(*shown[k]), color_of(*shown[k], k),
                              numbers(series["t_s"]), numbers(series["error_m"])});
  }
  if (error.series.empty()) return {};
  return {error};
}

std::vector<LineChart> time_charts(const std::vector<const Json*>& shown) {
  LineChart mask, blur, motion;
  mask.title = "Share of the image that is masked as dynamic";
  mask.y_label = "mask [%]";
  blur.title = "Sharpness of the edges (about 1: perfect steps; low: blurred)";
  blur.y_label = "sharpness";
  motion.title = "Motion of the image during the exposure";
  motion.y_label = "motion [px]";
  for (std::size_t k = 0; k < shown.size(); ++k) {
    const Json& series = (*shown[k])["stats"]["series"];
    const std::vector<double> t = numbers(series["t_s"]);
    const std::string label = trimmed_label(*shown[k]), color = color_of(*shown[k], k);
    const auto add = [&](LineChart& chart, const std::string& name, const std::string& ink,
                         const char* key, double factor = 1) -> Series* {
      if (!series.contains(key)) return nullptr;
      chart.series.push_back({name, ink, t, numbers(series[key], factor)});
      return &chart.series.back();
    };
    if (blur.series.empty())
      if (Series* s = add(blur, "sharpness", "muted", "sharpness")) s->dots = true;
    if (motion.series.empty() && add(motion, "predicted by the front end", "muted", "motion_px"))
      if (Series* s = add(motion, "true", "ink", "room_motion_px")) s->dashed = true;
    if (mask.series.empty())
      if (Series* s = add(mask, "people (masks_gt)", "ink", "true_mask_share", 100))
        s->dashed = true;
    add(mask, label + ", dilated", color, "mask_share", 100);
  }
  mask.y_from_zero = blur.y_from_zero = motion.y_from_zero = true;
  std::vector<LineChart> charts;
  for (LineChart* chart : {&mask, &blur, &motion}) {
    chart->x_label = kTime;
    if (!chart->series.empty()) charts.push_back(std::move(*chart));
  }
  return charts;
}

BarChart stage_chart(const std::vector<const Json*>& rows) {
  BarChart chart;
  chart.title = "Time per frame (medians of the stages)";
  chart.x_label = "milliseconds";
  static const char* const kStages[] = {"segmentation", "motion",     "compensation", "depth",
                                        "probability",  "extraction", "tracking"};
  for (const char* stage : kStages) chart.parts.push_back({stage, palette(chart.parts.size()), {}});
  for (const Json* row : rows) {
    if ((*row)["runs"].get<int>() == 0) continue;
    chart.labels.push_back(trimmed((*row)["label"]));
    for (BarChart::Part& part : chart.parts)
      part.values.push_back(number_at(*row, "ms_" + part.name + "_median"));
  }
  return chart;
}

}  // namespace stillpoint::cli
