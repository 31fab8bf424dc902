// SPDX-License-Identifier: BSD-2-Clause
#include "plot.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

namespace stillpoint::cli {
namespace {

std::string number(double v) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%.1f", v);
  return buffer;
}

/// A tick's text: no trailing zeros, no exponent for the values that occur here.
std::string tick_text(double v) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%.6g", std::abs(v) < 1e-12 ? 0.0 : v);
  return buffer;
}

struct Range {
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();
  void add(double v) { low = std::min(low, v), high = std::max(high, v); }
  double span() const { return high - low; }
};

std::vector<double> linear_ticks(const Range& range, int wanted) {
  const double raw = range.span() / wanted;
  const double power = std::pow(10.0, std::floor(std::log10(raw)));
  const double scaled = raw / power;
  const double step = power * (scaled <= 1 ? 1 : scaled <= 2 ? 2 : scaled <= 5 ? 5 : 10);
  std::vector<double> ticks;
  for (double i = std::ceil(range.low / step - 1e-9); i * step <= range.high + 1e-9 * step; ++i)
    ticks.push_back(i * step);
  return ticks;
}

std::string text(double x, double y, const std::string& content, const char* anchor,
                 const char* extra = "") {
  return "<text x=\"" + number(x) + "\" y=\"" + number(y) + "\" text-anchor=\"" + anchor + "\" " +
         extra + ">" + escape_html(content) + "</text>\n";
}

std::string line(double x0, double y0, double x1, double y1, const char* style) {
  return "<line x1=\"" + number(x0) + "\" y1=\"" + number(y0) + "\" x2=\"" + number(x1) +
         "\" y2=\"" + number(y1) + "\" " + style + "/>\n";
}

std::string open_svg(int width, int height, const std::string& title) {
  return "<svg xmlns=\"http://www.w3.org/2000/svg\" role=\"img\" viewBox=\"0 0 " +
         std::to_string(width) + " " + std::to_string(height) + "\" width=\"" +
         std::to_string(width) + "\" height=\"" + std::to_string(height) +
         "\" font-family=\"system-ui, sans-serif\" font-size=\"11\" fill=\"#333\">\n<title>" +
         escape_html(title) + "</title>\n<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n" +
         text(width / 2.0, 17, title, "middle", "font-size=\"13\" font-weight=\"600\"");
}

/// Width of a legend entry's text at font size 11, roughly.
double text_width(const std::string& s) { return 6.2 * static_cast<double>(s.size()); }

/// Where an axis over these (log10) begins: at the smallest, but a few tiny ones (2 %) must not
/// flatten the rest; they may lie below the decade that the others begin in.
double log_floor(std::vector<double> values) {
  const std::size_t rank = values.size() / 50;
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(rank),
                   values.end());
  return std::max(std::floor(values[rank]), *std::min_element(values.begin(), values.end()));
}

}  // namespace

std::string escape_html(const std::string& text) {
  std::string out;
  for (char c : text) {
    if (c == '&')
      out += "&amp;";
    else if (c == '<')
      out += "&lt;";
    else if (c == '>')
      out += "&gt;";
    else if (c == '"')
      out += "&quot;";
    else
      out += c;
  }
  return out;
}

std::string palette(std::size_t n) {
  // Okabe and Ito's colors, the dark ones first.
  static const char* const colors[] = {"#0072b2", "#d55e00", "#009e73", "#cc79a7",
                                       "#e69f00", "#56b4e9", "#8c564b", "#7f7f7f"};
  return colors[n % (sizeof colors / sizeof colors[0])];
}

std::string svg(const Plot& plot) {
  Range xr, yr;
  const auto usable = [&](double x, double y) {
    return std::isfinite(x) && std::isfinite(y) && (!plot.log_y || y > 0);
  };
  std::vector<double> heights;
  for (const Series& s : plot.series)
    for (std::size_t i = 0; i < std::min(s.x.size(), s.y.size()); ++i)
      if (usable(s.x[i], s.y[i])) {
        heights.push_back(plot.log_y ? std::log10(s.y[i]) : s.y[i]);
        xr.add(s.x[i]), yr.add(heights.back());
      }
  if (plot.log_y && !heights.empty()) yr.low = log_floor(heights);
  std::string out = open_svg(plot.width, plot.height, plot.title);
  if (xr.span() < 0)
    return out + text(plot.width / 2.0, plot.height / 2.0, "nothing to show", "middle") +
           "</svg>\n";
  if (plot.y_from_zero && !plot.log_y) yr.low = std::min(0.0, yr.low);
  const auto widen = [](Range& r, double share) {
    const double margin = r.span() > 0 ? share * r.span() : std::max(1e-3, 0.1 * std::abs(r.low));
    r.low -= margin, r.high += margin;
  };
  if (plot.equal_axes) widen(xr, 0.05);
  if (plot.y_from_zero && !plot.log_y && yr.low == 0)
    yr.high += yr.high > 0 ? 0.05 * yr.high : 1;
  else
    widen(yr, 0.05);
  if (!(xr.span() > 0)) widen(xr, 0.05);

  // The legend's lines, as many names in each as fit.
  std::vector<std::vector<const Series*>> legend;
  double filled_px = 0;
  const auto entry_px = [](const Series& s) { return 40 + text_width(s.name); };
  if (plot.legend)
    for (const Series& s : plot.series) {
      if (legend.empty() || filled_px + entry_px(s) > plot.width)
        legend.emplace_back(), filled_px = 0;
      legend.back().push_back(&s);
      filled_px += entry_px(s);
    }
  const double left = 72, right = plot.width - 14.0, top = 28,
               bottom = plot.height - 42.0 -
                        (legend.empty() ? 0.0 : 4.0 + 16.0 * static_cast<double>(legend.size()));
  if (plot.equal_axes) {
    const double scale = std::max(xr.span() / (right - left), yr.span() / (bottom - top));
    const auto grow = [](Range& r, double span) {
      const double extra = 0.5 * (span - r.span());
      r.low -= extra, r.high += extra;
    };
    grow(xr, scale * (right - left));
    grow(yr, scale * (bottom - top));
  }
  const auto px = [&](double x) { return left + (x - xr.low) / xr.span() * (right - left); };
  const auto py = [&](double y) {
    return bottom - ((plot.log_y ? std::max(yr.low, std::log10(y)) : y) - yr.low) / yr.span() *
                        (bottom - top);
  };

  const char* const grid = "stroke=\"#e3e3e3\" stroke-width=\"1\"";
  for (double t : linear_ticks(xr, plot.width / 90)) {
    out += line(px(t), top, px(t), bottom, grid);
    out += text(px(t), bottom + 14, tick_text(t), "middle");
  }
  if (plot.log_y) {
    for (int p = static_cast<int>(std::floor(yr.low)); p <= std::ceil(yr.high); ++p)
      for (int m = 1; m < 10; ++m) {
        // Within a decade all digits, else one line may be all there is.
        if (yr.span() > 0.8 && m != 1 && m != 2 && m != 5) continue;
        const double v = m * std::pow(10.0, p);
        if (std::log10(v) < yr.low || std::log10(v) > yr.high) continue;
        out += line(left, py(v), right, py(v), grid);
        if (m == 1 || yr.span() < 2.5) out += text(left - 6, py(v) + 4, tick_text(v), "end");
      }
  } else {
    for (double t : linear_ticks(yr, std::max(3, plot.height / 50))) {
      out += line(left, py(t), right, py(t), grid);
      out += text(left - 6, py(t) + 4, tick_text(t), "end");
    }
  }
  out += "<rect x=\"" + number(left) + "\" y=\"" + number(top) + "\" width=\"" +
         number(right - left) + "\" height=\"" + number(bottom - top) +
         "\" fill=\"none\" stroke=\"#999\"/>\n";
  out += text((left + right) / 2, bottom + 30, plot.x_label, "middle");
  out += "<text transform=\"translate(14 " + number((top + bottom) / 2) +
         ") rotate(-90)\" text-anchor=\"middle\">" + escape_html(plot.y_label) + "</text>\n";

  for (const Series& s : plot.series) {
    std::string path, fill, dots;
    double first_x = 0, last_x = 0;
    bool open = false;
    const auto close_area = [&] {
      if (open && s.filled)
        fill += "L" + number(last_x) + " " + number(bottom) + "L" + number(first_x) + " " +
                number(bottom) + "Z";
      open = false;
    };
    for (std::size_t i = 0; i < std::min(s.x.size(), s.y.size()); ++i) {
      if (!usable(s.x[i], s.y[i])) {
        close_area();
        continue;
      }
      const double x = px(s.x[i]), y = py(s.y[i]);
      const std::string point = (open ? "L" : "M") + number(x) + " " + number(y);
      path += point;
      if (s.filled) fill += point;
      if (s.dots)
        dots += "<circle cx=\"" + number(x) + "\" cy=\"" + number(y) + "\" r=\"2.4\" fill=\"" +
                s.color + "\"/>";
      if (!open) first_x = x;
      last_x = x;
      open = true;
    }
    close_area();
    if (s.filled)
      out += "<path d=\"" + fill + "\" fill=\"" + s.color + "\" fill-opacity=\"0.18\"/>\n";
    if (s.dots)
      out += dots + "\n";
    else
      out += "<path d=\"" + path + "\" fill=\"none\" stroke=\"" + s.color + "\" stroke-width=\"" +
             number(s.width) + "\" stroke-linejoin=\"round\"" +
             (s.dashed ? " stroke-dasharray=\"5 3\"" : "") + "><title>" + escape_html(s.name) +
             "</title></path>\n";
  }
  for (std::size_t row = 0; row < legend.size(); ++row) {
    double total = 0;
    for (const Series* s : legend[row]) total += entry_px(*s);
    double x = std::max(8.0, (plot.width - total) / 2);
    const double y = plot.height - 12 - 16.0 * static_cast<double>(legend.size() - 1 - row);
    for (const Series* s : legend[row]) {
      out += "<line x1=\"" + number(x) + "\" y1=\"" + number(y - 4) + "\" x2=\"" + number(x + 20) +
             "\" y2=\"" + number(y - 4) + "\" stroke=\"" + s->color + "\" stroke-width=\"3\"" +
             (s->dashed ? " stroke-dasharray=\"5 3\"" : "") + "/>\n";
      out += text(x + 25, y, s->name, "start");
      x += entry_px(*s);
    }
  }
  return out + "</svg>\n";
}

std::string svg_grid(const std::vector<Plot>& plots, int columns) {
  if (plots.empty()) return "";
  const int width = plots.front().width, height = plots.front().height;
  const int lines = (static_cast<int>(plots.size()) + columns - 1) / columns;
  std::string out = "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 " +
                    std::to_string(columns * width) + " " + std::to_string(lines * height) +
                    "\" width=\"" + std::to_string(columns * width) + "\" height=\"" +
                    std::to_string(lines * height) + "\">\n";
  for (std::size_t i = 0; i < plots.size(); ++i)
    out += "<g transform=\"translate(" + std::to_string(static_cast<int>(i) % columns * width) +
           " " + std::to_string(static_cast<int>(i) / columns * height) + ")\">" + svg(plots[i]) +
           "</g>\n";
  return out + "</svg>\n";
}

std::string svg(const StackedBars& bars) {
  double label_width = 0, longest = 0;
  for (const std::string& l : bars.labels) label_width = std::max(label_width, text_width(l));
  for (const auto& row : bars.values) {
    double sum = 0;
    for (double v : row) sum += std::isfinite(v) ? v : 0;
    longest = std::max(longest, sum);
  }
  const int height = 28 + 24 * static_cast<int>(bars.labels.size()) + 62;
  std::string out = open_svg(bars.width, height, bars.title);
  if (!(longest > 0)) return out + "</svg>\n";
  const double left = label_width + 20, right = bars.width - 60.0, bottom = height - 60.0;
  const auto px = [&](double v) { return left + v / longest * (right - left); };
  for (double t : linear_ticks({0, longest}, bars.width / 90)) {
    out += line(px(t), 28, px(t), bottom, "stroke=\"#e3e3e3\"");
    out += text(px(t), bottom + 14, tick_text(t), "middle");
  }
  out += text((left + right) / 2, bottom + 30, bars.x_label, "middle");
  for (std::size_t i = 0; i < bars.labels.size(); ++i) {
    const double y = 32 + 24.0 * static_cast<double>(i);
    out += text(left - 8, y + 12, bars.labels[i], "end");
    double at = 0;
    for (std::size_t p = 0; p < bars.parts.size(); ++p) {
      const double v = std::isfinite(bars.values[i][p]) ? bars.values[i][p] : 0;
      out += "<rect x=\"" + number(px(at)) + "\" y=\"" + number(y) + "\" width=\"" +
             number(px(at + v) - px(at)) + "\" height=\"17\" fill=\"" + palette(p) + "\"><title>" +
             escape_html(bars.parts[p] + ": " + tick_text(v)) + "</title></rect>\n";
      at += v;
    }
    char sum[32];
    std::snprintf(sum, sizeof sum, "%.2f", at);
    out += text(px(at) + 6, y + 12, sum, "start");
  }
  double x = left;
  for (std::size_t p = 0; p < bars.parts.size(); ++p) {
    out += "<rect x=\"" + number(x) + "\" y=\"" + number(height - 20) +
           "\" width=\"12\" height=\"10\" fill=\"" + palette(p) + "\"/>\n";
    out += text(x + 17, height - 11, bars.parts[p], "start");
    x += 40 + text_width(bars.parts[p]);
  }
  return out + "</svg>\n";
}

}  // namespace stillpoint::cli
