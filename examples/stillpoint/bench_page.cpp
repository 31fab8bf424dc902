// SPDX-License-Identifier: BSD-2-Clause
//
// What the page shows, as data; how it shows it stands in page/page.mustache, page.css and page.js.
#include <algorithm>
#include <kainjow/mustache.hpp>
#include <set>

#include "bench_charts.hpp"
#include "bench_paper.hpp"
#include "bench_results.hpp"
#include "bench_studies.hpp"
#include "bench_summary.hpp"
#include "overlay.hpp"
#include "page_files.hpp"
#include "page_tables.hpp"
#include "stillpoint/core/error.hpp"
#include "terminal.hpp"

namespace stillpoint::cli {
namespace {

namespace fs = std::filesystem;
namespace mustache = kainjow::mustache;
using Json = nlohmann::ordered_json;

/// The charts of the page, in order; an element of the page knows its chart by the number.
class Charts {
 public:
  template <class Chart>
  Json add(const Chart& chart) {
    all_.push_back(to_json(chart));
    return {{"number", std::to_string(all_.size() - 1)}, {"title", chart.title}};
  }
  /// `group`: the charts are zoomed together; empty: each alone.
  Json add(std::vector<LineChart> charts, const std::string& group = "") {
    Json out = Json::array();
    for (LineChart& chart : charts) {
      chart.group = group;
      out.push_back(add(chart));
    }
    return out;
  }
  /// For a <script> element, which no "<" may end.
  std::string text() const {
    std::string json = all_.dump();
    for (std::size_t at = 0; (at = json.find('<', at)) != std::string::npos; at += 6)
      json.replace(at, 1, "\\u003c");
    return json;
  }

 private:
  Json all_ = Json::array();
};

/// The table of the first screen, its first column linked to the sequences' sections.
Json summary_view(const std::vector<SummaryRow>& summary) {
  Json view = to_view(summary_table(summary));
  for (std::size_t i = 0; i < summary.size(); ++i) {
    Json& cells = view["rows"][i]["cells"];
    cells[0]["link"] = summary[i].sequence;
    const Json* of[] = {nullptr, summary[i].off, summary[i].on, nullptr, summary[i].limit};
    for (std::size_t c = 1; c < 5; ++c)
      if (of[c] && (*of[c])["failed"] != "") cells[c]["kind"] = "failed";
    const double off = summary[i].off ? number_at(*summary[i].off, "ate_rmse_m") : NAN;
    const double on = summary[i].on ? number_at(*summary[i].on, "ate_rmse_m") : NAN;
    if (cells[2]["kind"] == "" && !(on > off)) cells[2]["kind"] = "best";
  }
  return view;
}

BarChart summary_chart(const std::vector<SummaryRow>& summary) {
  BarChart chart;
  chart.title = "Absolute trajectory error";
  chart.x_label = "ATE RMSE [m], log scale";
  chart.stacked = false;
  chart.log_x = true;
  chart.parts = {{"front end off", variant_color("off"), {}},
                 {"front end on", variant_color("default"), {}},
                 {"limit: exact masks", variant_color("truth"), {}}};
  for (const SummaryRow& s : summary) {
    chart.labels.push_back(s.name());
    const Json* of[] = {s.off, s.on, s.limit};
    for (std::size_t p = 0; p < 3; ++p)
      chart.parts[p].values.push_back(of[p] ? number_at(*of[p], "ate_rmse_m") : NAN);
  }
  return chart;
}

/// What a section says first: what the front end brought. Null where one of the two is missing.
Json verdict(const SummaryRow& s) {
  if (!s.off || !s.on) return {};
  const auto error = [](const Json& row) { return fixed(number_at(row, "ate_rmse_m"), 4) + " m"; };
  const auto cover = [](const Json& row) {
    return fixed(100 * number_at(row, "coverage_min"), 1) + " %";
  };
  return {{"off", error(*s.off)},
          {"off_coverage", cover(*s.off)},
          {"on", error(*s.on)},
          {"on_coverage", cover(*s.on)},
          {"on_name", (*s.on)["label"]}};
}

/// The images that a result lists under `key`, for the front end off and on: off on the left, on to
/// its right, the same frame, the same view.
Json images(const std::vector<const Json*>& results, const char* key, const std::string& variant) {
  const Json *off = nullptr, *on = nullptr;
  for (const Json* r : results) {
    if (!r->contains(key) || (*r)[key].empty()) continue;
    if (!off && (*r)["job"]["variant"] == "off") off = r;
    if (!on && (*r)["job"]["variant"] == variant) on = r;
  }
  Json out = Json::array();
  std::size_t count = 0;
  for (const Json* r : {off, on})
    if (r) count = std::max(count, (*r)[key].size());
  for (std::size_t i = 0; i < count; ++i)
    for (const Json* r : {off, on}) {
      if (!r || i >= (*r)[key].size()) continue;
      const fs::path path =
          fs::path((*r)["folder"].get<std::string>()) / (*r)[key][i].get<std::string>();
      if (fs::exists(path))
        out.push_back({{"source", data_uri(path.string())},
                       {"caption", std::string(r == off ? "front end off, " : "front end on, ") +
                                       path.stem().string()}});
    }
  return out;
}

Json sequence_view(const std::string& name, const std::vector<SummaryRow>& summary,
                   const Json& rows, const std::vector<Json>& results, const std::string& on,
                   Charts& charts) {
  std::vector<const Json*> own_rows, own_results;
  for (const Json& row : rows)
    if (row["sequence"] == name) own_rows.push_back(&row);
  for (const Json& r : results)
    if (r["job"]["sequence"] == name) own_results.push_back(&r);
  Json view = {{"name", name}};
  for (const SummaryRow& s : summary)
    if (s.sequence == name && !view.contains("verdict"))
      if (Json said = verdict(s); !said.is_null()) view["verdict"] = said;
  const std::vector<const Json*> shown = shown_runs(own_results, on);
  view["paths"] = charts.add(path_charts(shown));
  view["error"] = charts.add(error_chart(shown), name);
  view["curves"] = charts.add(time_charts(shown), name);
  view["any_curves"] = !view["curves"].empty();
  view["frames"] = images(own_results, "overlays", on);
  view["maps"] = images(own_results, "map_views", on);
  view["any_frames"] = !view["frames"].empty();
  view["any_maps"] = !view["maps"].empty();
  view["accuracy"] = accuracy_table(own_rows);
  view["masks"] = masks_table(own_rows);
  view["stages"] = charts.add(stage_chart(own_rows));
  view["times"] = time_table(own_rows);
  view["evo"] = Json::array();
  for (const Json* row : own_rows)
    if (const std::string command = (*row)["evo"]; !command.empty())
      view["evo"].push_back({{"label", trimmed((*row)["label"])}, {"command", command}});
  view["any_evo"] = !view["evo"].empty();
  return view;
}

/// How the numbers were made: the builds, versions and machine.
void add_origin(Json& view, const std::vector<Json>& results) {
  std::set<std::string> programs;
  for (const Json& r : results) programs.insert(r["job"].value("program", ""));
  if (programs.size() > 1) view["builds"] = std::to_string(programs.size());
  view["origin"] = Json::array();
  for (const Json& r : results) {
    if (!r.contains("stats")) continue;
    for (const char* part : {"versions", "machine"})
      for (const auto& [key, value] : r["stats"][part].items())
        view["origin"].push_back(
            {{"key", key}, {"value", value.is_string() ? value.get<std::string>() : value.dump()}});
    break;
  }
}

/// Strings, true and false, lists and objects as mustache takes them; null is false.
mustache::data to_mustache(const Json& json) {
  if (json.is_object()) {
    mustache::data object;
    for (const auto& [key, value] : json.items()) object.set(key, to_mustache(value));
    return object;
  }
  if (json.is_array()) {
    mustache::data list(mustache::data::type::list);
    for (const Json& value : json) list.push_back(to_mustache(value));
    return list;
  }
  if (json.is_string() && !json.get_ref<const std::string&>().empty())
    return mustache::data(json.get<std::string>());
  return mustache::data(json.is_boolean() && json.get<bool>());
}

}  // namespace

std::string make_page(const Json& rows, const std::vector<Json>& results,
                      const std::string& command) {
  Charts charts;
  const std::string on = variant_on(rows);
  const std::vector<SummaryRow> summary = summarize(rows);
  Json view = {{"command", command}, {"style", page_style()}, {"script", page_script()}};
  view["library"] = chart_library();
  view["summary"] = summary_view(summary);
  view["any_summary"] = !summary.empty();
  view["summary_legend"] = summary_legend();
  view["overview"] = charts.add(summary_chart(summary));
  view["published"] = Json::array();
  for (const Table& table : paper_tables(rows)) view["published"].push_back(to_view(table));
  view["any_published"] = !view["published"].empty();
  view["published_legend"] = paper_legend();
  view["sequences"] = Json::array();
  std::string last;
  for (const Json& row : rows) {
    if (row["sequence"] == last) continue;
    last = row["sequence"];
    view["sequences"].push_back(sequence_view(last, summary, rows, results, on, charts));
  }
  view["settings"] = charts.add(setting_charts(rows), "settings");
  view["any_settings"] = !view["settings"].empty();
  view["blur"] = charts.add(blur_charts(rows, results), "blur");
  view["any_blur"] = !view["blur"].empty();
  add_origin(view, results);
  view["charts"] = charts.text();

  mustache::data data = to_mustache(view);
  data.set("table", mustache::data(mustache::partial(page_table_template)));
  data.set("chart", mustache::data(mustache::partial(page_chart_template)));
  mustache::mustache page{page_template()};
  std::string html = page.render(data);
  if (!page.is_valid()) throw Error("bench: page.mustache: " + page.error_message());
  return html;
}

}  // namespace stillpoint::cli
