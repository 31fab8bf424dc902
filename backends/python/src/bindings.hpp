// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <pybind11/pybind11.h>

// One function per source file; module.cpp calls them in this order.
namespace stillpoint::python {

namespace py = pybind11;

void bind_settings(py::module_& m);
void bind_camera(py::module_& m);
void bind_frame(py::module_& m);
void bind_instance(py::module_& m);
void bind_trajectory(py::module_& m);
void bind_segmenter(py::module_& m);
void bind_segmenters(py::module_& m);
void bind_selection(py::module_& m);
void bind_objects(py::module_& m);
void bind_front_end(py::module_& m);
void bind_components(py::module_& m);
void bind_slam(py::module_& m);
void bind_dense_map(py::module_& m);
void bind_io(py::module_& m);
void bind_run_sequence(py::module_& m);
void bind_evaluation(py::module_& m);
void bind_synthetic(py::module_& m);

}  // namespace stillpoint::python
