// SPDX-License-Identifier: BSD-2-Clause
#include "settings_file.hpp"

#include <yaml-cpp/yaml.h>

#include <set>

#include "stillpoint/io/setting_names.hpp"
#include "stillpoint/version.hpp"

namespace stillpoint::cli {
namespace {

/// Reads one settings file.
class Reader {
 public:
  explicit Reader(const std::filesystem::path& file)
      : name_("settings file " + file.string()), bytes_(read_file(file, "settings file")) {}

  SettingsFile read() {
    YAML::Node root;
    try {
      root = YAML::Load(bytes_);
    } catch (const YAML::Exception& e) {
      refuse(e.mark, "expected YAML, found a fault: " + e.msg);
    }
    if (!root.IsNull()) read_group(root, "");
    return found_;
  }

 private:
  [[noreturn]] void refuse(const YAML::Mark& mark, std::string problem) const {
    const std::string prefix = "stillpoint: ";  // of an Error, which adds it again
    if (problem.compare(0, prefix.size(), prefix) == 0) problem.erase(0, prefix.size());
    throw Error(name_ + (mark.line >= 0 ? ", line " + std::to_string(mark.line + 1) : "") + ": " +
                problem);
  }

  void read_group(const YAML::Node& group, const std::string& prefix) {
    if (!group.IsMap())
      refuse(group.Mark(),
             "expected lines of `name: value`, found " +
                 (prefix.empty() ? std::string("something else") : "none below " + prefix));
    for (const auto& item : group) {
      const YAML::Node &key = item.first, &value = item.second;
      const std::string name = prefix + key.as<std::string>();
      if (name == "dynamic_classes")
        read_classes(value);
      else if (value.IsMap())
        read_group(value, name + ".");
      else
        read_setting(key.Mark(), name, value);
    }
  }

  void read_setting(const YAML::Mark& mark, const std::string& name, const YAML::Node& value) {
    if (!value.IsScalar()) refuse(mark, "expected a value of " + name + ", found none");
    try {
      const std::string path = setting_path(name);
      set_setting(tried_, path, value.Scalar());
      if (!seen_.insert(path).second) throw Error("setting " + path + ": found twice");
      found_.changed.push_back(path + "=" + value.Scalar());
    } catch (const Error& e) {
      refuse(mark, e.what());
    }
  }

  void read_classes(const YAML::Node& classes) {
    const char* expected =
        "dynamic_classes: expected a list of names or [name, prior], e.g. [person, [chair, 0.5]]";
    if (!classes.IsSequence() || classes.size() == 0) refuse(classes.Mark(), expected);
    for (const YAML::Node& c : classes) {
      const bool pair = c.IsSequence() && c.size() == 2 && c[0].IsScalar() && c[1].IsScalar();
      if (!c.IsScalar() && !pair) refuse(c.Mark(), expected);
      const std::optional<double> prior = pair ? detail::parse_number(c[1].Scalar()) : 1.0;
      if (!prior) refuse(c.Mark(), expected);
      found_.dynamic.push_back((pair ? c[0] : c).Scalar() + "=" + detail::number_text(*prior));
    }
  }

  std::string name_, bytes_;
  FrontEndSettings tried_;
  std::set<std::string> seen_;
  SettingsFile found_;
};

/// Writes `path: value` as nested maps; settings of one group must follow each other.
class Writer {
 public:
  void add(const std::string& path, const std::string& value) {
    std::vector<std::string> groups;
    std::size_t begin = 0;
    for (std::size_t dot; (dot = path.find('.', begin)) != std::string::npos; begin = dot + 1)
      groups.push_back(path.substr(begin, dot - begin));
    std::size_t same = 0;
    while (same < groups.size() && same < open_.size() && groups[same] == open_[same]) ++same;
    for (; open_.size() > same; open_.pop_back()) out_ << YAML::EndMap;
    for (; same < groups.size(); open_.push_back(groups[same++]))
      out_ << YAML::Key << groups[same] << YAML::Value << YAML::BeginMap;
    out_ << YAML::Key << path.substr(begin) << YAML::Value << value;
  }
  void begin(const std::string& comment) {
    out_ << YAML::Comment(comment) << YAML::Newline << YAML::BeginMap;
  }
  YAML::Emitter& top() {
    for (; !open_.empty(); open_.pop_back()) out_ << YAML::EndMap;
    return out_;
  }

 private:
  YAML::Emitter out_;
  std::vector<std::string> open_;
};

}  // namespace

SettingsFile read_settings(const std::filesystem::path& file) { return Reader(file).read(); }

void write_settings(const std::filesystem::path& file, const FrontEndSettings& settings) {
  Writer writer;
  writer.begin(
      "Settings of the front end, by Stillpoint " STILLPOINT_VERSION
      ".\n`--settings` of run, mask and bench takes this file; docs/tuning.md explains it.");
  for (const auto& [path, value] : setting_values(settings)) writer.add(path, value);
  YAML::Emitter& out = writer.top();
  out << YAML::Key << "dynamic_classes" << YAML::Value << YAML::BeginSeq;
  for (const DynamicClass& c : settings.dynamic_classes)
    out << YAML::Flow << YAML::BeginSeq << c.name << detail::number_text(c.prior) << YAML::EndSeq;
  out << YAML::EndSeq << YAML::EndMap;
  write_file(file, std::string(out.c_str()) + "\n", "settings file");
}

}  // namespace stillpoint::cli
