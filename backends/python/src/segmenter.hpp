// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <pybind11/pybind11.h>

#include <string>
#include <vector>

#include "stillpoint/segmentation/segmenter.hpp"

namespace stillpoint::python {

/// A segmenter written in Python, called from C++ in any thread.
class PySegmenter : public Segmenter {
 public:
  Segmentation segment(const RgbdFrame& frame) override;
  std::vector<std::string> classes() const override;
};

/// The segmenter of an argument; nullptr for None.
Segmenter* segmenter_of(const pybind11::object& value, const char* where);

/// As __reduce_ex__ of a class with subclasses in Python: a copy would have no C++ object. Throws
/// Error.
pybind11::object refuse_copy(const pybind11::object& self, const pybind11::object& protocol);

}  // namespace stillpoint::python
