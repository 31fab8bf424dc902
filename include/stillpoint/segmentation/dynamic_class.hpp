// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "stillpoint/core/error.hpp"
#include "stillpoint/core/instance.hpp"

namespace stillpoint {

/// A class of objects that may move, by its name.
struct DynamicClass {
  // Not explicit: {"person", {"chair", 0.4f}} is a list of them.
  DynamicClass(const char* class_name, float probability = 1)
      : name(class_name), prior(probability) {}
  DynamicClass(std::string class_name, float probability = 1)
      : name(std::move(class_name)), prior(probability) {}

  std::string name;
  /// How probable it is that such an object moves, 0 to 1. With 1 every instance of the class is
  /// dynamic; with less those whose score times prior is at least 0.25. (What stands still may stay
  /// in the map; if it does move, the motion check finds it.)
  float prior;
};

/// True if the instance is of one of the classes and probable enough, or has no class (found by its
/// motion).
inline bool is_dynamic(const Instance& instance, const std::vector<DynamicClass>& classes) {
  if (instance.class_name.empty()) return true;
  for (const DynamicClass& c : classes)
    if (c.name == instance.class_name) return c.prior >= 1 || instance.score * c.prior >= 0.25f;
  return false;
}

/// Throws Error if a prior makes no sense or a class is not among `known`; an empty `known` knows
/// all.
inline void check_dynamic_classes(const std::vector<DynamicClass>& classes,
                                  const std::vector<std::string>& known) {
  for (const DynamicClass& c : classes) {
    detail::check(c.prior >= 0 && c.prior <= 1, [&] {
      return "dynamic class \"" + c.name + "\": expected a prior of 0 to 1, found " +
             std::to_string(c.prior);
    });
    detail::check(known.empty() || std::find(known.begin(), known.end(), c.name) != known.end(),
                  [&] {
                    std::string list;
                    for (const std::string& name : known) list += (list.empty() ? "" : ", ") + name;
                    return "dynamic class \"" + c.name +
                           "\": the segmenter knows no such class, only " + list;
                  });
  }
}

}  // namespace stillpoint
