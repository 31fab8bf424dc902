// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <pybind11/pybind11.h>

#include "stillpoint/io/tum_sequence.hpp"

namespace stillpoint::python {

/// The sequence of an argument; throws Error.
const TumSequence& sequence_of(const pybind11::object& value, const char* where);

}  // namespace stillpoint::python
