// SPDX-License-Identifier: BSD-2-Clause
#include "bench_plan.hpp"

#include <algorithm>
#include <map>
#include <set>

#include "front_end_options.hpp"
#include "stillpoint/core/error.hpp"
#include "stillpoint/io/setting_names.hpp"
#include "stillpoint/io/text_file.hpp"
#include "systems.hpp"

namespace stillpoint::cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

bool needs_masks(const Variant& v) { return v.front_end && v.segmenter && !v.truth; }

/// "a/b/" and "a/b" are both "b".
std::string folder_name(const fs::path& path) {
  fs::path clean = fs::absolute(path).lexically_normal();
  if (!clean.has_filename()) clean = clean.parent_path();
  return clean.filename().string();
}

}  // namespace

const std::vector<Variant>& variants() {
  static const std::vector<Variant> all{
      {"off", "front end off", false, "default", {}, false},
      {"paper", "paper preset", true, "paper", {}, false},
      {"network_only", "network_only preset", true, "network_only", {}, false},
      {"default", "default preset", true, "default", {}, false},
      {"no_compensation", "  without compensation", true, "default", {"compensation"}, false},
      {"no_depth", "  without depth fusion", true, "default", {"depth"}, false},
      {"no_probability", "  without probability", true, "default", {"probability"}, false},
      {"no_masks", "  without any masks", true, "default", {}, false, false},
      // Nothing to repair: the exact masks go to dilation and the probability filter as they are.
      {"truth", "ground-truth masks", true, "network_only", {"compensation", "depth"}, true}};
  return all;
}

fs::path BenchJob::result_file() const {
  const std::string masks =
      masks_folder.empty() || masks_folder == "masks" ? "" : "+" + masks_folder;
  return fs::path("runs") / sequence / (variant.name + masks + "." + std::to_string(run) + ".json");
}

std::string BenchJob::label() const {
  return masks_folder.empty() || masks_folder == "masks"
             ? variant.label
             : variant.label + " [" + masks_folder + "]";
}

namespace {

/// "NAME=FILE" with {} replaced by the sequence's name.
BenchJob estimate_job(const std::string& text, const std::string& sequence) {
  const std::size_t equals = text.find('=');
  if (equals == 0 || equals == std::string::npos || equals + 1 == text.size())
    throw Error("--estimate: expected NAME=FILE, e.g. orb_slam3=results/{}.txt, found \"" + text +
                "\"");
  BenchJob job;
  job.sequence = sequence;
  job.variant.label = text.substr(0, equals);
  job.variant.name = "estimate_" + job.variant.label;
  for (char& c : job.variant.name)
    if (c == '/' || c == ' ') c = '_';
  std::string file = text.substr(equals + 1);
  for (std::size_t at = 0; (at = file.find("{}", at)) != std::string::npos; at += sequence.size())
    file.replace(at, 2, sequence);
  job.estimate = file;
  return job;
}

/// The variants of "NAME=VALUE,VALUE,...".
std::vector<Variant> varied(const std::string& text) {
  const std::size_t equals = text.find('=');
  const std::string name = text.substr(0, equals);
  std::vector<Variant> all;
  for (std::size_t at = equals; at != std::string::npos;) {
    const std::size_t comma = text.find(',', at + 1);
    const std::string word =
        text.substr(at + 1, comma == std::string::npos ? comma : comma - at - 1);
    const auto value = detail::parse_number(word);
    if (!value)
      throw Error("--vary: expected NAME=NUMBER,NUMBER,..., e.g. dilation_px=0,5,10, found \"" +
                  text + "\"");
    Variant v;
    v.name = name + "=" + word;
    v.label = "  " + name + " = " + word;
    v.varied = name;
    v.varied_value = *value;
    FrontEndSettings settings;
    set_setting(settings, name, word);  // says what is wrong with the name
    all.push_back(v);
    at = comma;
  }
  if (all.empty())
    throw Error("--vary: expected NAME=NUMBER,NUMBER,..., e.g. dilation_px=0,5,10, found \"" +
                text + "\"");
  return all;
}

/// The variants that a plan asks for, by name or by --vary.
std::vector<Variant> chosen_variants(const BenchPlan& plan) {
  std::vector<Variant> chosen;
  for (const std::string& name : plan.variant_names) {
    const auto found = std::find_if(variants().begin(), variants().end(),
                                    [&](const Variant& v) { return v.name == name; });
    if (found == variants().end()) {
      std::string names;
      for (const Variant& v : variants()) names += (names.empty() ? "" : ", ") + v.name;
      throw Error("--variants: expected some of " + names + "; found \"" + name + "\"");
    }
    chosen.push_back(*found);
  }
  if (chosen.empty()) chosen = variants();
  for (const std::string& text : plan.vary)
    for (Variant& v : varied(text)) chosen.push_back(std::move(v));
  return chosen;
}

BenchJob variant_job(const BenchPlan& plan, const fs::path& sequence, const std::string& name,
                     const Variant& variant, const std::string& masks_folder, int run) {
  BenchJob job;
  job.sequence = name;
  job.variant = variant;
  job.masks_folder = masks_folder;
  job.run = run;
  job.settings = plan.common;
  job.settings.sequence = sequence;
  job.settings.preset = variant.preset;
  job.settings.front_end = variant.front_end;
  job.settings.without = variant.without;
  job.settings.varied = variant.varied;
  job.settings.varied_value = variant.varied_value;
  job.settings.seed = static_cast<std::uint64_t>(run);
  job.settings.segmenter = variant.front_end && variant.segmenter ? "mask_files" : "none";
  if (variant.front_end && variant.segmenter)
    job.settings.masks = sequence / (variant.truth ? "masks_gt" : masks_folder);
  return job;
}

/// The jobs of one sequence: each variant with each folder of masks, or once where it needs none.
void add_jobs(const BenchPlan& plan, const fs::path& sequence, const std::string& name,
              const std::vector<Variant>& chosen, std::vector<BenchJob>& jobs,
              std::vector<std::string>& notes) {
  const auto add = [&](const Variant& variant, const std::string& masks_folder) {
    for (int run = 0; run < plan.runs; ++run)
      jobs.push_back(variant_job(plan, sequence, name, variant, masks_folder, run));
  };
  const bool has_truth = fs::is_directory(sequence / "masks_gt");
  for (std::size_t m = 0; m < plan.masks_folders.size(); ++m) {
    const std::string& folder = plan.masks_folders[m];
    const bool there = fs::is_directory(sequence / folder);
    if (!there) notes.push_back(name + ": no folder " + folder + ": left out what needs it");
    for (const Variant& variant : chosen) {
      if (needs_masks(variant)) {
        if (there) add(variant, folder);
      } else if (m == 0 && (!variant.truth || has_truth)) {
        add(variant, "");
      }
    }
  }
  for (const std::string& text : plan.estimates) {
    BenchJob job = estimate_job(text, name);
    job.settings.sequence = sequence;
    job.settings.frames = plan.common.frames;
    job.settings.groundtruth_of = plan.common.groundtruth_of;
    jobs.push_back(job);
  }
  if (!has_truth)
    notes.push_back(name + ": no folder masks_gt: no mask IoU, no row with ground-truth masks");
}

}  // namespace

std::vector<BenchJob> make_jobs(const BenchPlan& plan, std::vector<std::string>& notes) {
  const std::vector<Variant> chosen = chosen_variants(plan);
  std::vector<BenchJob> jobs;
  std::set<std::string> names;
  for (const fs::path& sequence : plan.sequences) {
    if (!fs::is_regular_file(sequence / "rgb.txt"))
      throw Error(
          sequence.string() +
          ": expected a folder with rgb.txt, depth.txt and the images (TUM layout), found " +
          (fs::is_directory(sequence) ? "one without rgb.txt" : "no such folder"));
    std::string name = folder_name(sequence);
    for (int n = 2; !names.insert(name).second; ++n)
      name = folder_name(sequence) + "_" + std::to_string(n);
    add_jobs(plan, sequence, name, chosen, jobs, notes);
  }
  return jobs;
}

void check_masks_folders(const BenchPlan& plan) {
  for (const std::string& folder : plan.masks_folders)
    if (folder != "masks" &&
        std::none_of(plan.sequences.begin(), plan.sequences.end(),
                     [&](const fs::path& s) { return fs::is_directory(s / folder); }))
      throw Error("--masks-folder: expected a folder inside a sequence, found no \"" + folder +
                  "\" in any of them");
}

void check_each_once(const std::vector<BenchJob>& jobs) {
  std::set<fs::path> files;
  for (const BenchJob& job : jobs)
    if (!files.insert(job.result_file()).second)
      throw Error("bench: \"" + job.label() + "\" of " + job.sequence +
                  " is asked for twice; its runs would count twice");
}

void check_presets_differ(const std::vector<BenchJob>& jobs) {
  std::map<std::string, std::string> presets;  // by all their settings
  for (const BenchJob& job : jobs) {
    if (!job.estimate.empty() || !job.settings.front_end || !job.settings.varied.empty()) continue;
    RunSettings settings = job.settings;
    settings.without.clear(), settings.seed = 0;
    const std::string& preset =
        presets.emplace(all_settings(front_end_settings(settings)).dump(), settings.preset)
            .first->second;
    if (preset != settings.preset)
      throw Error("--settings, --set: expected settings that leave the presets " + preset +
                  " and " + settings.preset +
                  " different, found none that differs; take one of them by --variants");
  }
}

}  // namespace stillpoint::cli
