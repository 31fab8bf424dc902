// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace stillpoint::cli {

/// One line of a chart. A value that is not finite breaks the line (a lost frame).
struct Series {
  std::string name;
  /// "#rrggbb", or "ink" and "muted" for the page's own text colors, which are those of its theme.
  std::string color;
  std::vector<double> x, y;
  bool dashed = false;
  /// Draws dots instead of a line.
  bool dots = false;
  double width = 1.5;
  /// Seconds since the first frame, for each point of a path; empty: not said.
  std::vector<double> t_s = {};
};

/// Two axes and lines between them, drawn in the page by Chart.js (page/page.js).
struct LineChart {
  std::string title, x_label, y_label;
  std::vector<Series> series;
  /// Same length of a unit on both axes (a trajectory seen from above).
  bool equal_axes = false;
  bool log_y = false;
  bool y_from_zero = false;
  /// Charts of one group are zoomed together along x; empty: alone.
  std::string group = {};
};

/// One horizontal bar per label: of parts in a row, or several beside each other.
struct BarChart {
  std::string title, x_label;
  std::vector<std::string> labels;
  struct Part {
    std::string name, color;
    /// One per label; NaN: none.
    std::vector<double> values;
  };
  std::vector<Part> parts;
  bool stacked = true;
  bool log_x = false;
};

// What page.js reads. Numbers are rounded to six digits, NaN is null.
nlohmann::ordered_json to_json(const LineChart& chart);
nlohmann::ordered_json to_json(const BarChart& chart);

/// The n-th of a row of colors that color-blind readers can tell apart.
std::string palette(std::size_t n);

/// The color of a variant in all charts.
std::string variant_color(const std::string& variant);

}  // namespace stillpoint::cli
