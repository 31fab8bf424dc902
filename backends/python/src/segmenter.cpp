// SPDX-License-Identifier: BSD-2-Clause
#include "segmenter.hpp"

#include <pybind11/stl.h>

#include <stdexcept>

#include "bindings.hpp"
#include "calls.hpp"
#include "frames.hpp"

namespace stillpoint::python {
namespace {

/// "ValueError: text", as Python's last line says it.
std::string message_of(const py::error_already_set& error) {
  const std::string type = py::str(error.type().attr("__name__"));
  const std::string text = py::str(error.value());
  return text.empty() ? type : type + ": " + text;
}

std::vector<std::string> names_of(const py::object& value) {
  if (!PySequence_Check(value.ptr()) || py::isinstance<py::str>(value))
    throw Error("Segmenter.classes: expected a list of names, found " + found_text(value));
  std::vector<std::string> names;
  for (const py::handle& item : value) names.push_back(text_of(item, "Segmenter.classes"));
  return names;
}

}  // namespace

Segmentation PySegmenter::segment(const RgbdFrame& frame) {
  const py::gil_scoped_acquire gil;
  try {
    const py::function function = py::get_override(static_cast<const Segmenter*>(this), "segment");
    if (!function)
      throw Error("Segmenter.segment: expected a subclass that defines it, found none");
    return segmentation_of(function(py::cast(frame)), frame, "Segmenter.segment: result");
  } catch (const py::error_already_set& error) {
    const std::string message = message_of(error);
    // Ctrl-C is no failure of the segmenter.
    if (!error.matches(PyExc_Exception)) pending_exception() = error;
    throw std::runtime_error(message);
  }
}

std::vector<std::string> PySegmenter::classes() const {
  const py::gil_scoped_acquire gil;
  const py::function function = py::get_override(static_cast<const Segmenter*>(this), "classes");
  return function ? names_of(function()) : std::vector<std::string>();
}

Segmenter* segmenter_of(const py::object& value, const char* where) {
  if (value.is_none()) return nullptr;
  if (!py::isinstance<Segmenter>(value))
    throw Error(std::string(where) + ": expected a stillpoint.Segmenter or None, found " +
                found_text(value));
  return value.cast<Segmenter*>();
}

py::object refuse_copy(const py::object& self, const py::object&) {
  throw Error(std::string(py::str(py::type::of(self).attr("__name__"))) +
              ": cannot be copied or pickled; make a new one");
}

void bind_segmenter(py::module_& m) {
  py::class_<Segmenter, PySegmenter>(
      m, "Segmenter",
      "Where masks come from. Subclass it and define segment():\n\n"
      "    class Mine(stillpoint.Segmenter):\n"
      "        def segment(self, frame):\n"
      "            return network(frame.color)  # (H, W) uint8: 0 = background, k = instance k\n\n"
      "What segment() raises counts as no result for the frame: the front end goes on with\n"
      "predicted masks and says so in stats.segmenter_error.")
      .def(py::init<>())
      .def("__reduce_ex__", &refuse_copy, py::arg("protocol"))
      .def(
          "segment",
          [](Segmenter& segmenter, const py::object& frame) {
            const RgbdFrame given = frame_of(frame, "frame");
            return without_gil([&] { return segmenter.segment(given); });
          },
          py::arg("frame"),
          "Segments an RgbdFrame. Returns a Segmentation, a label image (H, W) uint8 or bool, a\n"
          "list of Instance, or None: no result for this frame.")
      .def(
          "classes",
          [](const Segmenter& segmenter) {
            return without_gil([&] { return segmenter.classes(); });
          },
          "Names of the classes that it can report; [] = not known.");
}

}  // namespace stillpoint::python
