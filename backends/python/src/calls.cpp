// SPDX-License-Identifier: BSD-2-Clause
#include "calls.hpp"

namespace stillpoint::python {

std::optional<pybind11::error_already_set>& pending_exception() {
  static thread_local std::optional<pybind11::error_already_set> pending;
  return pending;
}

void raise_pending() {
  if (std::optional<pybind11::error_already_set>& pending = pending_exception()) {
    pybind11::error_already_set error = *pending;
    pending.reset();
    throw error;
  }
  if (PyErr_CheckSignals() != 0) throw pybind11::error_already_set();
}

}  // namespace stillpoint::python
