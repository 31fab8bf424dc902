// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <pybind11/pybind11.h>

#include "stillpoint/core/selection.hpp"

namespace stillpoint::python {

/// The selection of an argument; throws Error.
const Selection& selection_of(const pybind11::object& value, const char* where);

}  // namespace stillpoint::python
