// SPDX-License-Identifier: BSD-2-Clause
#include "settings.hpp"

#include <algorithm>
#include <cstdio>
#include <limits>

#include "stillpoint/core/error.hpp"
#include "stillpoint/io/setting_names.hpp"

namespace stillpoint::python {
namespace {

/// A member somewhere in nested settings.
struct Place {
  const SettingsField* field;
  void* settings;
  std::string path;
};

void collect(const SettingsTable& table, void* settings, const std::string& prefix,
             std::vector<Place>& places) {
  for (const SettingsField& f : table.fields) {
    places.push_back({&f, settings, prefix + f.name});
    if (f.nested) collect(*f.nested, f.address(settings), prefix + f.name + ".", places);
  }
}

const Place& place_of(const std::string& table, const std::vector<Place>& places,
                      const std::string& name) {
  std::vector<const Place*> same;
  const Place* nearest = &places.front();
  std::size_t least = std::numeric_limits<std::size_t>::max();
  for (const Place& p : places) {
    if (p.path == name) return p;
    if (p.field->name == name) same.push_back(&p);
    const std::size_t d = std::min(detail::letters_between(p.path, name),
                                   detail::letters_between(p.field->name, name));
    if (d < least) nearest = &p, least = d;
  }
  if (same.empty())
    throw Error(table + "." + name + ": expected the name of a setting, found no such one; the " +
                "nearest is " + nearest->path);
  if (same.size() > 1)
    throw Error(table + "." + name + ": expected one of " + same[0]->path + " and " +
                same[1]->path + ", found what both are called; give a dict: " +
                same[0]->path.substr(0, same[0]->path.find('.')) + "={\"" + name + "\": ...}");
  return *same[0];
}

}  // namespace

void apply(const SettingsTable& table, void* settings, const py::dict& changes) {
  std::vector<Place> places;
  collect(table, settings, "", places);
  // Whole groups first, so that use_motion=..., depth=... and dilation_px=... may stand in any
  // order.
  for (const bool groups : {true, false})
    for (const auto& [key, value] : changes) {
      const Place& place = place_of(table.name, places, text_of(key, table.name.c_str()));
      if ((place.field->nested != nullptr) == groups)
        place.field->set(place.settings, value, table.name + "." + place.path);
    }
}

py::dict all_settings(const SettingsTable& table, void* settings) {
  std::vector<Place> places;
  collect(table, settings, "", places);
  py::dict all;
  for (const Place& p : places)
    if (!p.field->nested) all[py::str(p.path)] = p.field->get(py::none(), p.settings);
  return all;
}

std::string repr(const SettingsTable& table, void* settings, void* defaults) {
  std::string changed;
  for (const SettingsField& f : table.fields) {
    std::string text;
    if (f.nested) {
      text = repr(*f.nested, f.address(settings), f.address(defaults));
      if (text == f.nested->name + "()") continue;
    } else {
      const py::object value = f.get(py::none(), settings);
      if (value.equal(f.get(py::none(), defaults))) continue;
      text = py::repr(value);
    }
    changed += (changed.empty() ? "" : ", ") + f.name + "=" + text;
  }
  return table.name + "(" + changed + ")";
}

void assign(bool& member, const py::handle& value, const std::string& where) {
  member = truth_of(value, where.c_str());
}

void assign(int& member, const py::handle& value, const std::string& where) {
  member = int_of(value, where.c_str());
}

void assign(std::uint64_t& member, const py::handle& value, const std::string& where) {
  const long long number = whole_of(value, where.c_str());
  if (number < 0)
    throw Error(where + ": expected a whole number of at least 0, found " + std::to_string(number));
  member = static_cast<std::uint64_t>(number);
}

void assign(float& member, const py::handle& value, const std::string& where) {
  member = static_cast<float>(number_of(value, where.c_str()));
}

void assign(double& member, const py::handle& value, const std::string& where) {
  member = number_of(value, where.c_str());
}

void assign(std::vector<DynamicClass>& member, const py::handle& value, const std::string& where) {
  const char* expected = ": expected a list of names or (name, prior), found ";
  if (!PySequence_Check(value.ptr()) || py::isinstance<py::str>(value))
    throw Error(where + expected + found_text(value));
  std::vector<DynamicClass> classes;
  for (const py::handle& item : py::reinterpret_borrow<py::object>(value)) {
    if (py::isinstance<py::str>(item)) {
      classes.emplace_back(item.cast<std::string>());
      continue;
    }
    if (!PySequence_Check(item.ptr()) || py::len(item) != 2)
      throw Error(where + expected + found_text(item) + " in it");
    const auto pair = py::reinterpret_borrow<py::object>(item);
    classes.emplace_back(
        text_of(py::object(pair[py::int_(0)]), where.c_str()),
        static_cast<float>(number_of(py::object(pair[py::int_(1)]), where.c_str())));
  }
  check_dynamic_classes(classes, {});
  member = std::move(classes);
}

py::object to_python(float value) {
  // 0.05f is 0.05 to its user.
  char text[32];
  for (const int digits : {7, 9}) {
    std::snprintf(text, sizeof text, "%.*g", digits, static_cast<double>(value));
    if (std::strtof(text, nullptr) == value) break;
  }
  return py::float_(std::strtod(text, nullptr));
}

py::object to_python(const std::vector<DynamicClass>& classes) {
  py::tuple out(classes.size());
  for (std::size_t i = 0; i < classes.size(); ++i)
    out[i] = py::make_tuple(classes[i].name, to_python(classes[i].prior));
  return out;
}

int choice_of(const py::handle& value, const std::vector<std::string>& words,
              const std::string& where) {
  const auto found = py::isinstance<py::str>(value)
                         ? std::find(words.begin(), words.end(), value.cast<std::string>())
                         : words.end();
  if (found != words.end()) return static_cast<int>(found - words.begin());
  std::string list;
  for (const std::string& word : words) list += (list.empty() ? "\"" : ", \"") + word + "\"";
  throw Error(where + ": expected one of " + list + ", found " + found_text(value));
}

}  // namespace stillpoint::python
