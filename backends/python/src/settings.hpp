// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <pybind11/pybind11.h>

#include <functional>
#include <string>
#include <type_traits>
#include <vector>

#include "arrays.hpp"
#include "stillpoint/segmentation/dynamic_class.hpp"

namespace stillpoint::python {

struct SettingsTable;

/// A member of a settings struct, as Python sees it.
struct SettingsField {
  std::string name, doc;
  /// `self` is the Python object around `settings`; nested settings keep it alive.
  std::function<py::object(py::handle self, void* settings)> get;
  std::function<void(void* settings, const py::handle& value, const std::string& where)> set;
  const SettingsTable* nested = nullptr;
  std::function<void*(void* settings)> address;  // of nested settings
};

/// The members of a settings struct.
struct SettingsTable {
  std::string name;
  std::vector<SettingsField> fields;
};

/// Sets what keyword arguments name: a member, by its last name a member of nested settings, or by
/// a dict all members of nested settings.
void apply(const SettingsTable& table, void* settings, const py::dict& changes);
/// All members that are not nested settings, by their path.
py::dict all_settings(const SettingsTable& table, void* settings);
/// The call that makes these settings from the defaults.
std::string repr(const SettingsTable& table, void* settings, void* defaults);

// A value from Python into a member; throws Error.
void assign(bool& member, const py::handle& value, const std::string& where);
void assign(int& member, const py::handle& value, const std::string& where);
void assign(std::uint64_t& member, const py::handle& value, const std::string& where);
void assign(float& member, const py::handle& value, const std::string& where);
void assign(double& member, const py::handle& value, const std::string& where);
void assign(std::vector<DynamicClass>& member, const py::handle& value, const std::string& where);
py::object to_python(float value);
py::object to_python(const std::vector<DynamicClass>& classes);
template <class T>
py::object to_python(const T& value) {
  return py::cast(value);
}
/// The index of a word among the choices.
int choice_of(const py::handle& value, const std::vector<std::string>& words,
              const std::string& where);

/// Builds the table of S and its Python class together.
template <class S>
class SettingsClass {
 public:
  SettingsClass(py::module_& m, SettingsTable& table, const char* name, const char* doc)
      : table_(table), class_(m, name, doc) {
    table_.name = name;
    class_.def(py::init([&table](const py::kwargs& changes) {
                 S settings;
                 apply(table, &settings, changes);
                 return settings;
               }),
               "Takes members as keyword arguments; the rest has its default.");
    class_.def(
        "to_dict", [&table](S& s) { return all_settings(table, &s); },
        "All values by their path, e.g. 'depth.dilation_px'.");
    class_.def("__repr__", [&table](S& s) {
      S defaults;
      return repr(table, &s, &defaults);
    });
    class_.def("__eq__", [&table](S& s, const py::object& other) -> py::object {
      if (!py::isinstance<S>(other)) return py::reinterpret_borrow<py::object>(Py_NotImplemented);
      return py::bool_(all_settings(table, &s).equal(all_settings(table, other.cast<S*>())));
    });
    class_.attr("__hash__") = py::none();
    class_.def("__copy__", [](const S& s) { return S(s); });
    class_.def(
        "__deepcopy__", [](const S& s, const py::object&) { return S(s); }, py::arg("memo"));
  }

  template <class T>
  SettingsClass& add(const char* name, T S::*member, const char* doc) {
    SettingsField field;
    field.get = [member](py::handle, void* s) { return to_python(static_cast<S*>(s)->*member); };
    field.set = [member](void* s, const py::handle& value, const std::string& where) {
      assign(static_cast<S*>(s)->*member, value, where);
    };
    return publish(name, doc, std::move(field));
  }

  template <class T>
  SettingsClass& add_choice(const char* name, T S::*member, std::vector<std::string> words,
                            const char* doc) {
    SettingsField field;
    field.get = [member, words](py::handle, void* s) {
      return py::str(words[static_cast<std::size_t>(static_cast<S*>(s)->*member)]);
    };
    field.set = [member, words](void* s, const py::handle& value, const std::string& where) {
      static_cast<S*>(s)->*member = static_cast<T>(choice_of(value, words, where));
    };
    return publish(name, doc, std::move(field));
  }

  template <class T>
  SettingsClass& add_nested(const char* name, T S::*member, const SettingsTable& nested,
                            const char* doc) {
    SettingsField field;
    field.nested = &nested;
    field.address = [member](void* s) -> void* { return &(static_cast<S*>(s)->*member); };
    field.get = [member](py::handle self, void* s) {
      return py::cast(&(static_cast<S*>(s)->*member), py::return_value_policy::reference_internal,
                      self);
    };
    field.set = [member, &nested](void* s, const py::handle& value, const std::string& where) {
      T& target = static_cast<S*>(s)->*member;
      if (py::isinstance<T>(value))
        target = value.cast<T>();
      else if (py::isinstance<py::dict>(value))
        apply(nested, &target, py::reinterpret_borrow<py::dict>(value));
      else
        throw Error(where + ": expected " + nested.name + " or a dict, found " + found_text(value));
    };
    return publish(name, doc, std::move(field));
  }

  /// A named preset, changed by keyword arguments.
  SettingsClass& add_preset(const char* name, S (*make)(), const char* doc) {
    class_.def_static(
        name,
        [make, &table = table_](const py::kwargs& changes) {
          S settings = make();
          apply(table, &settings, changes);
          return settings;
        },
        doc);
    return *this;
  }

  py::class_<S>& python() { return class_; }

 private:
  SettingsClass& publish(const char* name, const char* doc, SettingsField field) {
    field.name = name, field.doc = doc;
    const std::string where = table_.name + "." + name;
    class_.def_property(
        name, [get = field.get](const py::object& self) { return get(self, self.cast<S*>()); },
        [set = field.set, where](S& s, const py::object& value) { set(&s, value, where); }, doc);
    table_.fields.push_back(std::move(field));
    return *this;
  }

  SettingsTable& table_;
  py::class_<S> class_;
};

// Filled by bind_settings().
SettingsTable& front_end_table();
SettingsTable& compensation_table();
SettingsTable& depth_table();
SettingsTable& probability_table();

/// Settings of an argument, None = the defaults, changed by keyword arguments.
template <class S>
S settings_of(const py::object& settings, const py::dict& changes, const SettingsTable& table,
              const char* where) {
  S wanted;
  if (!settings.is_none()) {
    if (!py::isinstance<S>(settings))
      throw Error(std::string(where) + ": settings: expected stillpoint." + table.name +
                  " or None, found " + found_text(settings));
    wanted = settings.cast<S>();
  }
  apply(table, &wanted, changes);
  return wanted;
}

}  // namespace stillpoint::python
