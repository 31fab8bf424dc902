// SPDX-License-Identifier: BSD-2-Clause
#include "bench_plan.hpp"

#include <algorithm>
#include <fstream>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <set>

#include "front_end_options.hpp"
#include "stillpoint/core/error.hpp"
#include "stillpoint/io/text_file.hpp"
#include "stillpoint/version.hpp"
#include "systems.hpp"

namespace stillpoint::cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

/// FNV-1a: short, the same everywhere, good enough to notice a change.
class Fingerprint {
 public:
  void add(const std::string& bytes) {
    for (char c : bytes) state_ = (state_ ^ static_cast<unsigned char>(c)) * 1099511628211ull;
    state_ = (state_ ^ 0xffu) * 1099511628211ull;
  }
  std::string text() const {
    char buffer[24];
    std::snprintf(buffer, sizeof buffer, "%016llx", static_cast<unsigned long long>(state_));
    return buffer;
  }

 private:
  std::uint64_t state_ = 14695981039346656037ull;
};

std::string bytes_of(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

/// Of the running program: results of two builds must not be mixed in one table.
const std::string& program_fingerprint() {
  static const std::string text = [] {
    Fingerprint f;
    f.add(bytes_of("/proc/self/exe"));
    return f.text();
  }();
  return text;
}

std::string input_fingerprint(const fs::path& sequence, const std::string& masks) {
  Fingerprint f;
  for (const char* name :
       {"rgb.txt", "depth.txt", "groundtruth.txt", "associations.txt", "camera.yaml"})
    f.add(bytes_of(sequence / name));
  for (const std::string& folder :
       {std::string("rgb"), std::string("depth"), masks, std::string("masks_gt")}) {
    if (folder.empty()) continue;
    std::vector<std::string> lines;
    std::error_code ignored;
    for (const auto& entry : fs::directory_iterator(sequence / folder, ignored))
      if (entry.is_regular_file(ignored))
        lines.push_back(entry.path().filename().string() + " " +
                        std::to_string(entry.file_size(ignored)));
    std::sort(lines.begin(), lines.end());
    for (const std::string& line : lines) f.add(line);
  }
  return f.text();
}

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
    change_setting(settings, name, *value);  // says what is wrong with the name
    all.push_back(v);
    at = comma;
  }
  if (all.empty())
    throw Error("--vary: expected NAME=NUMBER,NUMBER,..., e.g. dilation_px=0,5,10, found \"" +
                text + "\"");
  return all;
}

std::vector<BenchJob> make_jobs(const BenchPlan& plan, std::vector<std::string>& notes) {
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

  std::vector<BenchJob> jobs;
  std::set<std::string> names;
  for (const fs::path& sequence : plan.sequences) {
    if (!fs::is_regular_file(sequence / "rgb.txt"))
      throw Error(
          sequence.string() +
          ": expected a folder with rgb.txt, depth.txt and the pictures (TUM layout), found " +
          (fs::is_directory(sequence) ? "one without rgb.txt" : "no such folder"));
    std::string name = folder_name(sequence);
    for (int n = 2; !names.insert(name).second; ++n)
      name = folder_name(sequence) + "_" + std::to_string(n);
    const auto add = [&](const Variant& variant, const std::string& masks_folder) {
      for (int run = 0; run < plan.runs; ++run) {
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
        jobs.push_back(job);
      }
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
      jobs.push_back(job);
    }
    if (!has_truth)
      notes.push_back(name + ": no folder masks_gt: no mask IoU, no row with ground-truth masks");
  }
  return jobs;
}

namespace {

Json job_key(const BenchJob& job, const std::string& masks, const std::string& input) {
  const RunSettings& s = job.settings;
  if (!job.estimate.empty()) {
    Fingerprint bytes;
    bytes.add(bytes_of(job.estimate));
    return {{"sequence", job.sequence},
            {"variant", job.variant.name},
            {"label", job.label()},
            {"masks_folder", ""},
            {"run", job.run},
            {"estimate", job.estimate.string()},
            {"frames", s.frames},
            {"input", input},
            {"estimate_bytes", bytes.text()},
            {"program", program_fingerprint()},
            {"version", STILLPOINT_VERSION}};
  }
  return {{"sequence", job.sequence},
          {"variant", job.variant.name},
          {"label", job.label()},
          {"masks_folder", masks},
          {"run", job.run},
          {"front_end", s.front_end},
          {"preset", s.preset},
          {"without", s.without},
          {"varied", s.varied},
          {"varied_value", s.varied_value},
          {"sensor", s.sensor},
          {"changed", s.changed},
          {"segmenter", s.segmenter},
          {"tracker", s.tracker},
          {"features", s.features},
          {"camera", s.camera},
          {"frames", s.frames},
          {"seed", s.seed},
          {"input", input},
          {"program", program_fingerprint()},
          {"version", STILLPOINT_VERSION}};
}

/// What tells two plans apart, in words; empty: nothing.
std::string difference(const Json& a, const fs::path& folder_a, const Json& b,
                       const fs::path& folder_b) {
  std::map<std::string, const Json*> of_b;
  for (const Json& run : b["runs"]) of_b[run["file"]] = &run["job"];
  for (const Json& run : a["runs"]) {
    const std::string file = run["file"];
    const auto found = of_b.find(file);
    if (found == of_b.end())
      return folder_a.string() + " is of a bench with " + file + ", " + folder_b.string() +
             " of one without it";
    for (const auto& [key, value] : run["job"].items())
      if (const Json other = found->second->value(key, Json()); other != value)
        return key + " of " + file + " is " + value.dump() + " in " + folder_a.string() + " and " +
               other.dump() + " in " + folder_b.string();
    of_b.erase(found);
  }
  return of_b.empty() ? ""
                      : folder_b.string() + " is of a bench with " + of_b.begin()->first + ", " +
                            folder_a.string() + " of one without it";
}

}  // namespace

void add_keys(std::vector<BenchJob>& jobs) {
  std::map<std::pair<fs::path, std::string>, std::string> inputs;
  for (BenchJob& job : jobs) {
    const std::string masks =
        job.settings.masks.empty() ? "" : job.settings.masks.filename().string();
    std::string& input = inputs[{job.settings.sequence, masks}];
    if (input.empty()) input = input_fingerprint(job.settings.sequence, masks);
    job.key = job_key(job, masks, input);
  }
}

Json make_plan(const std::vector<BenchJob>& jobs, std::size_t shards) {
  Json plan = {{"shards", shards}, {"runs", Json::array()}};
  for (const BenchJob& job : jobs)
    plan["runs"].push_back({{"file", job.result_file().generic_string()}, {"job", job.key}});
  return plan;
}

Json common_plan(const std::vector<fs::path>& folders) {
  Json first;
  for (const fs::path& folder : folders) {
    const fs::path file = folder / "plan.json";
    Json plan = Json::parse(bytes_of(file), nullptr, false);
    if (!plan.is_object() || !plan.contains("runs"))
      throw Error("bench --merge: expected " + file.string() +
                  ", which every bench and shard writes, found " +
                  (fs::exists(file)           ? "something else in it"
                   : fs::is_directory(folder) ? "none; run this shard again"
                                              : "no such folder"));
    if (first.is_null()) {
      first = std::move(plan);
      continue;
    }
    if (const std::string what = difference(first, folders.front(), plan, folder); !what.empty())
      throw Error("bench --merge: expected shards of one bench, found two: " + what);
  }
  return first;
}

std::vector<std::string> frames_to_show(const BenchJob& job, const std::string& masks_folder) {
  // The stems come from rgb.txt, so that a sequence without masks is served as well.
  std::vector<std::string> stems;
  std::ifstream list(job.settings.sequence / "rgb.txt");
  for (std::string line; std::getline(list, line);) {
    if (line.empty() || line[0] == '#') continue;
    const std::size_t space = line.find_first_of(" \t");
    if (space != std::string::npos) {
      std::string name = line.substr(space + 1);
      name.erase(name.find_last_not_of(" \t\r") + 1);
      stems.push_back(fs::path(name).stem().string());
    }
  }
  if (job.settings.frames > 0 && job.settings.frames < stems.size())
    stems.resize(job.settings.frames);
  constexpr std::size_t kParts = 4;
  std::vector<std::string> shown;
  for (std::size_t part = 0; part < kParts; ++part) {
    const std::size_t begin = part * stems.size() / kParts;
    const std::size_t end = (part + 1) * stems.size() / kParts;
    if (begin == end) continue;
    std::size_t best = begin + (end - begin) / 2;
    int most_missed = 0;
    for (std::size_t i = begin; i < end; ++i) {
      const fs::path& sequence = job.settings.sequence;
      const cv::Mat truth =
          cv::imread((sequence / "masks_gt" / (stems[i] + ".png")).string(), cv::IMREAD_GRAYSCALE);
      const cv::Mat mask = cv::imread((sequence / masks_folder / (stems[i] + ".png")).string(),
                                      cv::IMREAD_GRAYSCALE);
      if (truth.empty() || mask.size() != truth.size()) continue;
      const int missed = cv::countNonZero((truth > 0) & (mask == 0));
      if (missed > most_missed) most_missed = missed, best = i;
    }
    shown.push_back(stems[best]);
  }
  return shown;
}

}  // namespace stillpoint::cli
