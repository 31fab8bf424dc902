// SPDX-License-Identifier: BSD-2-Clause
#include "bindings.hpp"
#include "stillpoint/core/error.hpp"
#include "stillpoint/version.hpp"

PYBIND11_MODULE(_stillpoint, m) {
  namespace py = stillpoint::python::py;
  using namespace stillpoint::python;
  m.doc() = "The compiled part of stillpoint.";
  m.attr("__version__") = STILLPOINT_VERSION;
  m.attr("__module__") = "stillpoint";  // where its classes are found
  static py::exception<stillpoint::Error> error(m, "Error", PyExc_ValueError);
  error.attr("__module__") = "stillpoint";
  error.attr("__doc__") = "Wrong input: what, where, what was expected and what was found.";
  py::register_exception_translator([](std::exception_ptr raised) {
    try {
      if (raised) std::rethrow_exception(raised);
    } catch (const stillpoint::Error& e) {
      error(e.what());
    }
  });
  py::options options;
  options.disable_enum_members_docstring();
  for (const auto bind :
       {bind_settings, bind_camera, bind_frame, bind_instance, bind_trajectory, bind_segmenter,
        bind_segmenters, bind_selection, bind_objects, bind_front_end, bind_components, bind_slam,
        bind_dense_map, bind_io, bind_run_sequence, bind_evaluation, bind_synthetic})
    bind(m);
}
