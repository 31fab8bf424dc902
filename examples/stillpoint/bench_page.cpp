// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "bench_paper.hpp"
#include "bench_results.hpp"
#include "bench_studies.hpp"
#include "overlay.hpp"
#include "plot.hpp"
#include "terminal.hpp"

namespace stillpoint::cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

const char* const kStyle = R"(
body { font: 15px/1.5 system-ui, sans-serif; color: #222; background: #fff; margin: 0 auto;
       max-width: 1120px; padding: 24px; }
h1 { font-size: 26px; margin: 0 0 4px; } h2 { font-size: 20px; margin: 40px 0 8px;
       border-top: 2px solid #ddd; padding-top: 20px; } h3 { font-size: 16px; margin: 24px 0 6px; }
h4 { font-size: 14px; margin: 12px 0 4px; color: #444; }
p, li { max-width: 860px; } .note { color: #555; font-size: 13px; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-size: 13px; font-variant-numeric: tabular-nums; }
th, td { padding: 3px 7px; text-align: right; white-space: nowrap; border-bottom: 1px solid #e5e5e5; }
th { background: #f4f5f7; font-weight: 600; vertical-align: bottom; }
th.group { text-align: center; border-left: 1px solid #ddd; }
td:first-child, th:first-child { text-align: left; white-space: pre; }
tr.failed td, td.failed { color: #a33; background: #fdf1f0; } td.best { font-weight: 700; }
table.wide { font-size: 12px; } .wide th, .wide td { padding: 3px 5px; }
.figures { display: flex; flex-wrap: wrap; gap: 12px; } svg { max-width: 100%; height: auto; }
figure { margin: 0; max-width: 100%; } figure img { max-width: 100%; display: block; }
figcaption { font-size: 13px; color: #555; padding: 2px 0 10px; }
code { background: #f4f5f7; padding: 1px 4px; border-radius: 3px; }
pre { background: #f4f5f7; padding: 10px; overflow-x: auto; }
)";

std::vector<double> numbers(const Json& array) {
  std::vector<double> out;
  for (const Json& v : array)
    out.push_back(v.is_number() ? v.get<double>() : std::numeric_limits<double>::quiet_NaN());
  return out;
}

/// Column `axis` of an array of points, NaN for a missing point.
std::vector<double> column(const Json& points, std::size_t axis) {
  std::vector<double> out;
  for (const Json& p : points)
    out.push_back(p.is_array() ? p[axis].get<double>() : std::numeric_limits<double>::quiet_NaN());
  return out;
}

std::string cell(const std::string& text, const char* attribute = "") {
  return std::string("<td") + attribute + ">" + escape_html(text) + "</td>";
}

std::string head(const char* groups, std::initializer_list<const char*> names) {
  std::string out = "<div class=\"scroll\"><table><thead><tr>";
  out += groups;
  out += "</tr><tr>";
  for (const char* name : names) out += std::string("<th>") + name + "</th>";
  return out + "</tr></thead><tbody>\n";
}

std::string html(const Table& table) {
  std::string out = "<div class=\"scroll\"><table><thead><tr>";
  for (const std::string& name : table.header) out += "<th>" + escape_html(name) + "</th>";
  out += "</tr></thead><tbody>\n";
  for (const std::vector<std::string>& row : table.rows) {
    out += "<tr>";
    for (const std::string& text : row)
      out += cell(text, text.compare(0, 6, "failed") == 0 ? " class=\"failed\"" : "");
    out += "</tr>\n";
  }
  return out + "</tbody></table></div>\n";
}

std::string begin_row(const Json& row) {
  const std::string failed = row["failed"];
  return (failed.empty() ? "<tr>" : "<tr class=\"failed\">") +
         cell(row["label"].get<std::string>() + runs_lacking(row) +
              (failed == "coverage"                       ? "  (failed: coverage)"
               : failed.empty() || failed == "incomplete" ? ""
                                                          : "  (failed)"));
}

std::string at(const Json& row, const std::string& key, int digits, double factor = 1) {
  return cell(fixed(factor * number_at(row, key), digits));
}

std::string accuracy_table(const std::vector<const Json*>& rows) {
  std::string out = head(
      "<th rowspan=\"2\">variant</th><th rowspan=\"2\">runs</th><th "
      "rowspan=\"2\">coverage<br>%</th>"
      "<th class=\"group\" colspan=\"5\">ATE [m]</th><th class=\"group\" colspan=\"2\">RPE</th>"
      "<th class=\"group\" colspan=\"2\">mask IoU</th>"
      "<th class=\"group\" colspan=\"2\">keypoints</th><th class=\"group\">ghosts</th>",
      {"RMSE", "worst", "mean", "spread", "S.D.", "m", "deg", "before", "after", "kept",
       "on people %", "of the map %"});
  for (const Json* row : rows)
    out += begin_row(*row) + cell(std::to_string((*row)["runs"].get<int>())) +
           at(*row, "coverage_min", 1, 100) +
           cell(fixed(number_at(*row, "ate_rmse_m"), 4),
                (*row)["best"].get<bool>() ? " class=\"best\"" : "") +
           at(*row, "ate_rmse_worst_m", 4) + at(*row, "ate_rmse_mean_m", 4) +
           at(*row, "ate_rmse_spread_m", 4) + at(*row, "ate_sd_m", 4) + at(*row, "rpe_trans_m", 4) +
           at(*row, "rpe_rot_deg", 3) + at(*row, "mask_iou_before", 3) +
           at(*row, "mask_iou_after", 3) + at(*row, "keypoints_kept", 0) +
           at(*row, "keypoints_kept_on_people", 2, 100) + at(*row, "map_ghost_share", 2, 100) +
           "</tr>\n";
  return out + "</tbody></table></div>\n";
}

std::string detail_table(const std::vector<const Json*>& rows) {
  std::string out = head(
      "<th rowspan=\"2\">variant</th><th class=\"group\" colspan=\"3\">given masks</th>"
      "<th class=\"group\" colspan=\"3\">final masks</th>"
      "<th class=\"group\" colspan=\"2\">IoU on blurred</th>"
      "<th class=\"group\" colspan=\"4\">removed keypoints</th>",
      {"IoU", "recall", "precision", "IoU", "recall", "precision", "before", "after", "precision",
       "recall", "F1", "static kept %"});
  for (const Json* row : rows) {
    out += begin_row(*row);
    for (const char* key :
         {"mask_iou_before", "mask_recall_before", "mask_precision_before", "mask_iou_after",
          "mask_recall_after", "mask_precision_after", "mask_iou_before_blurred",
          "mask_iou_after_blurred", "keypoints_precision", "keypoints_recall", "keypoints_f1"})
      out += at(*row, key, 3);
    out += at(*row, "keypoints_static_kept", 1, 100) + "</tr>\n";
  }
  return out + "</tbody></table></div>\n";
}

const char* const kStages[] = {"segmentation", "motion",     "compensation", "depth",
                               "probability",  "extraction", "tracking"};

std::string times(const std::vector<const Json*>& rows) {
  StackedBars bars;
  bars.title = "Time per frame (medians of the stages)";
  bars.x_label = "milliseconds";
  bars.parts.assign(std::begin(kStages), std::end(kStages));
  std::string out =
      "<div class=\"scroll\"><table class=\"wide\"><thead><tr><th>ms per frame,<br>median "
      "(p95)</th>";
  for (const char* stage : kStages) out += std::string("<th>") + stage + "</th>";
  out += "<th>total</th><th>memory<br>MB</th></tr></thead><tbody>\n";
  for (const Json* row : rows) {
    if ((*row)["runs"].get<int>() == 0) continue;
    bars.labels.push_back((*row)["label"]);
    bars.labels.back().erase(0, bars.labels.back().find_first_not_of(' '));
    bars.values.emplace_back();
    out += "<tr>" + cell((*row)["label"]);
    for (const char* stage : {"segmentation", "motion", "compensation", "depth", "probability",
                              "extraction", "tracking", "total"}) {
      const std::string key = std::string("ms_") + stage;
      const double value = number_at(*row, key + "_median");
      if (bars.values.back().size() < bars.parts.size()) bars.values.back().push_back(value);
      out += cell(fixed(value, 2) + " (" + fixed(number_at(*row, key + "_p95"), 2) + ")");
    }
    out += at(*row, "peak_memory_mb", 0) + "</tr>\n";
  }
  return "<div class=\"figures\">" + svg(bars) + "</div>\n" + out + "</tbody></table></div>\n";
}

bool is_estimate(const Json& result) {
  return result["job"]["variant"].get<std::string>().compare(0, 9, "estimate_") == 0;
}

/// The variant that stands for "front end on": what `stillpoint run` takes, if it is here.
std::string variant_on(const std::vector<const Json*>& results) {
  for (const Json* r : results)
    if ((*r)["job"]["variant"] == "default" && r->contains("stats")) return "default";
  return "network_only";
}

/// The runs whose curves are drawn: the first run of these variants, and other systems' estimates.
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

std::string color_of(const Json& result, std::size_t position) {
  const std::string variant = result["job"]["variant"];
  if (variant == "off") return "#d55e00";
  if (variant == "paper") return "#cc79a7";
  if (variant == "truth") return "#009e73";
  if (variant == "default" || variant == "network_only") return "#0072b2";
  static const char* const others[] = {"#e69f00", "#56b4e9", "#8c564b", "#7f7f7f"};
  return others[position % 4];
}

std::string trimmed_label(const Json& result) {
  std::string label = result["job"]["label"];
  label.erase(0, label.find_first_not_of(' '));
  return label;
}

/// What the runs drawn in a view have in common.
std::string view_title(const std::string& view, bool off, bool on) {
  if (off && on) return view + ", with the front end off and on";
  return off ? view + ", front end off" : on ? view + ", front end on" : view;
}

std::string trajectory_plots(const std::vector<const Json*>& shown) {
  std::string out;
  const auto add_view = [&](const char* view, std::size_t second, const char* y_label,
                            bool with_off) {
    Plot plot;
    plot.x_label = "x [m]";
    plot.y_label = y_label;
    plot.equal_axes = true;
    plot.width = 530, plot.height = 400;
    bool truth_drawn = false, off = false, on = false;
    for (std::size_t k = 0; k < shown.size(); ++k) {
      const Json* r = shown[k];
      const Json& series = (*r)["stats"]["series"];
      if (!series.contains("path")) continue;
      if (!truth_drawn)
        plot.series.push_back({"ground truth", "#b0b0b0", column(series["truth"], 0),
                               column(series["truth"], second), 5.0, false, false, false});
      truth_drawn = true;
      const std::string variant = (*r)["job"]["variant"];
      if (variant == "truth" || variant == "paper" || (variant == "off" && !with_off)) continue;
      off = off || variant == "off";
      on = on || variant == "default" || variant == "network_only";
      plot.series.push_back({trimmed_label(*r), color_of(*r, k), column(series["path"], 0),
                             column(series["path"], second), 1.5, false, false, false});
    }
    plot.title = view_title(view, off, on);
    if (plot.series.size() > 1) out += svg(plot);
  };
  const auto add_pair = [&](bool with_off) {
    add_view("From above", 1, "y [m]", with_off);
    add_view("From the side", 2, "z [m]", with_off);
  };
  add_pair(true);
  // Again without what is off: beside a lost estimate the others would be a dot.
  if (std::any_of(shown.begin(), shown.end(),
                  [](const Json* r) { return (*r)["job"]["variant"] == "off"; }))
    add_pair(false);
  return out;
}

std::string time_plots(const std::vector<const Json*>& shown) {
  Plot error, mask, blur, motion;
  error.title = "Position error over time (gaps: no pose)";
  error.y_label = "error [m], log scale";
  error.log_y = true;
  mask.title = "Share of the picture that is masked as dynamic";
  mask.y_label = "mask [%]";
  blur.title = "Sharpness of the edges (about 1: perfect steps; low: blurred)";
  blur.y_label = "sharpness";
  motion.title = "Motion of the picture during the exposure";
  motion.y_label = "motion [px]";
  for (std::size_t k = 0; k < shown.size(); ++k) {
    const Json* r = shown[k];
    const Json& series = (*r)["stats"]["series"];
    const std::vector<double> t = numbers(series["t_s"]);
    const auto share = [&](const char* key) {
      std::vector<double> values = numbers(series[key]);
      for (double& v : values) v *= 100;
      return values;
    };
    if (series.contains("error_m"))
      error.series.push_back({trimmed_label(*r), color_of(*r, k), t, numbers(series["error_m"]),
                              1.5, false, false, false});
    if (blur.series.empty() && series.contains("sharpness"))
      blur.series.push_back(
          {"sharpness", "#7f7f7f", t, numbers(series["sharpness"]), 1.5, false, true, false});
    if (motion.series.empty() && series.contains("motion_px")) {
      motion.series.push_back({"predicted by the front end", "#7f7f7f", t,
                               numbers(series["motion_px"]), 1.5, false, false, false});
      if (series.contains("room_motion_px"))
        motion.series.push_back(
            {"true", "#333333", t, numbers(series["room_motion_px"]), 1.5, true, false, false});
    }
    if (mask.series.empty() && series.contains("true_mask_share"))
      mask.series.push_back(
          {"people (masks_gt)", "#333333", t, share("true_mask_share"), 1.5, true, false, false});
    if (series.contains("mask_share"))
      mask.series.push_back({trimmed_label(*r) + ", dilated", color_of(*r, k), t,
                             share("mask_share"), 1.5, false, false, false});
  }
  std::string out;
  mask.y_from_zero = blur.y_from_zero = motion.y_from_zero = true;
  blur.legend = false;
  for (Plot* plot : {&error, &mask, &blur, &motion}) {
    plot->width = 1070;
    plot->height = plot == &error ? 320 : 220;
    plot->x_label = "time since the first frame [s]";
    if (!plot->series.empty()) out += svg(*plot);
  }
  return out;
}

/// The pictures that a result lists under `key`, for the front end off and on.
std::string pictures(const std::vector<const Json*>& results, const char* key,
                     const std::string& variant) {
  const Json *off = nullptr, *on = nullptr;
  for (const Json* r : results) {
    if (!r->contains(key) || (*r)[key].empty()) continue;
    if (!off && (*r)["job"]["variant"] == "off") off = r;
    if (!on && (*r)["job"]["variant"] == variant) on = r;
  }
  // Off on the left, on to its right: the same frame, the same view.
  std::string out = "<div class=\"figures\">\n";
  std::size_t count = 0;
  for (const Json* r : {off, on})
    if (r) count = std::max(count, (*r)[key].size());
  for (std::size_t i = 0; i < count; ++i)
    for (const Json* r : {off, on}) {
      if (!r || i >= (*r)[key].size()) continue;
      const fs::path path =
          fs::path((*r)["folder"].get<std::string>()) / (*r)[key][i].get<std::string>();
      if (!fs::exists(path)) continue;
      const std::string caption =
          (r == off ? "front end off, " : "front end on, ") + path.stem().string();
      out += "<figure><img width=\"524\" src=\"" + data_uri(path.string()) + "\" alt=\"" +
             escape_html(caption) + "\"><figcaption>" + escape_html(caption) +
             "</figcaption></figure>\n";
    }
  return off || on ? out + "</div>\n" : "";
}

/// All sequences at a glance: ATE by variant and sequence, coverage beside it.
std::string overview(const Json& rows, const std::vector<std::string>& sequences) {
  std::vector<std::string> labels;
  for (const Json& row : rows)
    if (std::find(labels.begin(), labels.end(), row["label"]) == labels.end())
      labels.push_back(row["label"]);
  std::string out =
      "<h2>All sequences</h2>\n<p class=\"note\">ATE RMSE in metres, coverage in brackets; bold: "
      "smallest "
      "of the sequence, failed rows and exact masks aside; red: failed.</p><div "
      "class=\"scroll\"><table><thead><tr><th>variant</th>";
  for (const std::string& s : sequences)
    out += "<th><a href=\"#" + escape_html(s) + "\">" + escape_html(s) + "</a></th>";
  out += "</tr></thead><tbody>\n";
  for (const std::string& label : labels) {
    out += "<tr>" + cell(label);
    for (const std::string& s : sequences) {
      std::string text, attribute;
      for (const Json& row : rows)
        if (row["sequence"] == s && row["label"] == label) {
          text = fixed(number_at(row, "ate_rmse_m"), 4) + " (" +
                 fixed(100 * number_at(row, "coverage_min"), 0) + " %)";
          text += runs_lacking(row);
          if (!row["failed"].get<std::string>().empty()) attribute = " class=\"failed\"";
          if (row["best"].get<bool>()) attribute = " class=\"best\"";
        }
      out += "<td" + attribute + ">" + escape_html(text) + "</td>";
    }
    out += "</tr>\n";
  }
  return out + "</tbody></table></div>\n";
}

/// The first sentence of a section: what the front end brought.
std::string verdict(const std::vector<const Json*>& rows, const std::string& variant) {
  const Json *off = nullptr, *on = nullptr;
  for (const Json* row : rows) {
    if (!off && (*row)["variant"] == "off") off = row;
    if (!on && (*row)["variant"] == variant) on = row;
  }
  if (!off || !on) return "";
  const auto say = [](const Json& row) {
    return "<b>" + fixed(number_at(row, "ate_rmse_m"), 4) + " m</b> at " +
           fixed(100 * number_at(row, "coverage_min"), 1) + " % coverage";
  };
  return "<p>Absolute trajectory error with the front end off: " + say(*off) + "; with the " +
         escape_html((*on)["label"].get<std::string>()) + ": " + say(*on) + ".</p>\n";
}

}  // namespace

std::string make_page(const Json& rows, const std::vector<Json>& results,
                      const std::string& command) {
  std::string out =
      "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">"
      "<title>Stillpoint bench</title>\n<style>" +
      std::string(kStyle) + "</style></head><body>\n<h1>Stillpoint bench</h1>\n";
  std::vector<std::string> sequences;
  for (const Json& row : rows)
    if (sequences.empty() || sequences.back() != row["sequence"])
      sequences.push_back(row["sequence"]);
  out +=
      "<p>Each row is one way to run the same tracker on the same pictures. Coverage is the share "
      "of "
      "the frames with ground truth that have a pose; an error counts only beside it, so rows "
      "under "
      "95&nbsp;% are marked as failed. ATE is the absolute trajectory error after SE(3) alignment "
      "(no scale); with more than one run its median, with worst, mean and spread (standard "
      "deviation) beside it.</p>\n";

  if (sequences.size() > 1) out += overview(rows, sequences);
  const std::vector<Table> published = paper_tables(rows);
  if (!published.empty()) {
    out += "<h2>Beside the published numbers</h2>\n";
    for (const Table& table : published) out += "<h3>" + table.title + "</h3>\n" + html(table);
    out += "<p class=\"note\">" + escape_html(paper_legend()) + "</p>\n";
  }
  for (const std::string& sequence : sequences) {
    std::vector<const Json*> own_rows, own_results;
    for (const Json& row : rows)
      if (row["sequence"] == sequence) own_rows.push_back(&row);
    for (const Json& r : results)
      if (r["job"]["sequence"] == sequence) own_results.push_back(&r);
    out += "<h2 id=\"" + escape_html(sequence) + "\">" + escape_html(sequence) + "</h2>\n";
    const std::string on = variant_on(own_results);
    out += verdict(own_rows, on) + accuracy_table(own_rows);
    const std::vector<const Json*> shown = shown_runs(own_results, on);
    out += "<h3>Trajectory</h3><div class=\"figures\">" + trajectory_plots(shown) + "</div>\n";
    out += "<h3>Error, masks and blur over time</h3><div class=\"figures\">" + time_plots(shown) +
           "</div>\n";
    const std::string frames = pictures(own_results, "overlays", on);
    if (!frames.empty())
      out +=
          "<h3>Frames</h3><p class=\"note\">Green: keypoints that reach the tracker. Red: those "
          "that "
          "the front end spares it, by mask or by probability. Yellow: the final (dilated) mask. "
          "From each quarter of the sequence the frame where the given masks miss most of the "
          "people.</p>\n" +
          frames;
    const std::string maps = pictures(own_results, "map_views", on);
    if (!maps.empty())
      out +=
          "<h3>Dense map</h3><p class=\"note\">The static pixels of every fifth frame, from behind "
          "the first camera and from above. People who were not masked stay as ghosts; a lost "
          "trajectory doubles the room.</p>\n" +
          maps;
    const std::string settings = setting_plots(own_rows);
    if (!settings.empty())
      out += "<h3>Settings</h3><div class=\"figures\">" + settings + "</div>\n";
    out += "<h3>Masks and keypoints</h3>\n" + detail_table(own_rows);
    out += "<h3>Time</h3>\n" + times(own_rows);
  }
  const std::string blur = blur_plots(rows, results);
  if (!blur.empty())
    out +=
        "<h2>Blur</h2>\n<p class=\"note\">All frames of all sequences and runs on this page, in "
        "groups of equally many. <i>Missed</i>: share of the people's pixels that a mask lacks "
        "before dilation; the given masks are what the segmenter found.</p><div "
        "class=\"figures\">" +
        blur + "</div>\n";

  std::set<std::string> programs;
  for (const Json& r : results) programs.insert(r["job"].value("program", ""));
  if (programs.size() > 1)
    out += "<p class=\"note\"><b>These results were made by " + std::to_string(programs.size()) +
           " different builds of the program.</b></p>\n";
  out += "<h2>How these numbers were made</h2>\n<pre>" + escape_html(command) + "</pre>\n<ul>";
  for (const Json& r : results)
    if (r.contains("stats")) {
      for (const char* part : {"versions", "machine"})
        for (const auto& [key, value] : r["stats"][part].items())
          out += "<li>" + escape_html(key) + ": " +
                 escape_html(value.is_string() ? value.get<std::string>() : value.dump()) +
                 "</li>\n";
      break;
    }
  out +=
      "</ul>\n<p class=\"note\">Mask IoU: dynamic masks against masks_gt before dilation; "
      "<i>before</i> is the segmenter's own mask, <i>after</i> what the front end made of it; mean "
      "over the frames; <i>on blurred</i>: over the least sharp third. Keypoints: <i>kept</i> per "
      "frame by the tracker; <i>on people</i>: share of these that lie on masks_gt; precision, "
      "recall "
      "and F1 judge the front end's decision (removed = positive) on 1000 ORB keypoints over the "
      "whole "
      "picture. Ghosts: percentage of the dense map's voxels where people were and nothing static "
      "is. "
      "Times: wall clock, without reading pictures. All numbers: "
      "<code>results.csv</code>, "
      "<code>results.json</code>; settings and per-frame values: <code>runs/</code>.</p>\n";
  return out + "</body></html>\n";
}

}  // namespace stillpoint::cli
