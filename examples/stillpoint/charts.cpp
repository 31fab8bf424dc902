// SPDX-License-Identifier: BSD-2-Clause
#include "charts.hpp"

#include <cmath>
#include <cstdio>
#include <cstdlib>

namespace stillpoint::cli {
namespace {

using Json = nlohmann::ordered_json;

Json rounded(const std::vector<double>& values) {
  Json out = Json::array();
  for (double v : values) {
    char buffer[32];
    std::snprintf(buffer, sizeof buffer, "%.6g", v);
    out.push_back(std::isfinite(v) ? Json(std::strtod(buffer, nullptr)) : Json());
  }
  return out;
}

}  // namespace

Json to_json(const LineChart& chart) {
  Json out = {{"kind", "lines"},           {"title", chart.title},      {"x", chart.x_label},
              {"y", chart.y_label},        {"equal", chart.equal_axes}, {"log", chart.log_y},
              {"zero", chart.y_from_zero}, {"group", chart.group},      {"series", Json::array()}};
  for (const Series& s : chart.series) {
    Json line = {{"name", s.name},   {"color", s.color},  {"dashed", s.dashed}, {"dots", s.dots},
                 {"width", s.width}, {"x", rounded(s.x)}, {"y", rounded(s.y)}};
    if (!s.t_s.empty()) line["t"] = rounded(s.t_s);
    out["series"].push_back(std::move(line));
  }
  return out;
}

Json to_json(const BarChart& chart) {
  Json out = {{"kind", "bars"},         {"title", chart.title},     {"x", chart.x_label},
              {"log", chart.log_x},     {"stacked", chart.stacked}, {"labels", chart.labels},
              {"series", Json::array()}};
  for (const BarChart::Part& part : chart.parts)
    out["series"].push_back(
        {{"name", part.name}, {"color", part.color}, {"values", rounded(part.values)}});
  return out;
}

std::string palette(std::size_t n) {
  // Okabe and Ito's colors, the dark ones first.
  static const char* const colors[] = {"#0072b2", "#d55e00", "#009e73", "#cc79a7",
                                       "#e69f00", "#56b4e9", "#8c564b", "#7f7f7f"};
  return colors[n % (sizeof colors / sizeof colors[0])];
}

std::string variant_color(const std::string& variant) {
  if (variant == "off") return "#d55e00";
  if (variant == "paper") return "#cc79a7";
  if (variant == "network_only") return "#56b4e9";
  if (variant == "default") return "#0072b2";
  if (variant == "truth") return "#009e73";
  return "#7f7f7f";
}

}  // namespace stillpoint::cli
