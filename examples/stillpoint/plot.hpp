// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <string>
#include <vector>

namespace stillpoint::cli {

/// One line of a plot. A value that is not finite breaks the line (a lost frame).
struct Series {
  std::string name;
  std::string color;
  std::vector<double> x, y;
  double width = 1.5;
  bool dashed = false;
  /// Fills the area between the line and the lower edge.
  bool filled = false;
  /// Draws dots instead of a line.
  bool dots = false;
};

/// One pair of axes.
struct Plot {
  std::string title, x_label, y_label;
  std::vector<Series> series;
  /// Same length of a unit on both axes (a trajectory seen from above).
  bool equal_axes = false;
  bool log_y = false;
  bool y_from_zero = false;
  bool legend = true;
  int width = 520, height = 340;
};

/// The plot as an <svg> element with its own text, needing nothing else.
std::string svg(const Plot& plot);

/// Plots of one size beside and below each other, as one <svg> element.
std::string svg_grid(const std::vector<Plot>& plots, int columns);

/// One horizontal bar per label, stacked from parts.
struct StackedBars {
  std::string title, x_label;
  std::vector<std::string> labels;
  std::vector<std::string> parts;
  /// values[label][part]
  std::vector<std::vector<double>> values;
  int width = 1060;
};

std::string svg(const StackedBars& bars);

/// The n-th of a row of colors that color-blind readers can tell apart.
std::string palette(std::size_t n);

/// `text` with the characters escaped that mean something in HTML.
std::string escape_html(const std::string& text);

}  // namespace stillpoint::cli
