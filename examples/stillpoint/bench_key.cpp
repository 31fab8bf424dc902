// SPDX-License-Identifier: BSD-2-Clause
//
// What tells two runs apart, so that old results are taken again only where they are the same.
#include <algorithm>
#include <fstream>
#include <map>

#include "bench_plan.hpp"
#include "stillpoint/core/error.hpp"
#include "stillpoint/version.hpp"

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

/// Empty: there is no such file.
std::string fingerprint_of(const fs::path& file) {
  if (!fs::is_regular_file(file)) return "";
  Fingerprint f;
  f.add(bytes_of(file));
  return f.text();
}

/// Of the running program: results of two builds must not be mixed in one table.
const std::string& program_fingerprint() {
  static const std::string text = fingerprint_of("/proc/self/exe");
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

Json job_key(const BenchJob& job, const std::string& masks, const std::string& input) {
  const RunSettings& s = job.settings;
  if (!job.estimate.empty())
    return {{"sequence", job.sequence},
            {"variant", job.variant.name},
            {"label", job.label()},
            {"masks_folder", ""},
            {"run", job.run},
            {"estimate", job.estimate.string()},
            {"frames", s.frames},
            {"groundtruth_of", s.groundtruth_of},
            {"input", input},
            {"estimate_bytes", fingerprint_of(job.estimate)},
            {"program", program_fingerprint()},
            {"version", STILLPOINT_VERSION}};
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
          {"settings_file", s.from_file.changed},
          {"dynamic", s.from_file.dynamic},
          {"changed", s.changed},
          {"segmenter", s.segmenter},
          {"tracker", s.tracker},
          {"features", s.features},
          {"camera", s.camera},
          {"camera_file", fingerprint_of(s.camera)},
          {"frames", s.frames},
          {"seed", s.seed},
          {"groundtruth_of", s.groundtruth_of},
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
        job.settings.masks.empty()
            ? ""
            : job.settings.masks.lexically_relative(job.settings.sequence).generic_string();
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

}  // namespace stillpoint::cli
