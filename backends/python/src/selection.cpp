// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/core/selection.hpp"

#include <pybind11/stl.h>

#include "bindings.hpp"
#include "frames.hpp"
#include "selections.hpp"
#include "stillpoint/core/status.hpp"

namespace stillpoint::python {
namespace {

py::array reasons_of(const Selection& s) {
  std::vector<std::uint8_t> reasons(s.reason.size());
  for (std::size_t i = 0; i < reasons.size(); ++i)
    reasons[i] = static_cast<std::uint8_t>(s.reason[i]);
  return array_of(std::move(reasons));
}

py::array kept_mask_of(const Selection& s) {
  py::array_t<bool> kept(static_cast<py::ssize_t>(s.size()));
  for (std::size_t i = 0; i < s.size(); ++i) kept.mutable_data()[i] = s.is_kept(i);
  return kept;
}

py::object compact_of(const py::object& values, const py::object& selection) {
  const Selection& s = selection_of(selection, "selection");
  if (!PySequence_Check(values.ptr()) || static_cast<std::size_t>(py::len(values)) != s.size())
    throw Error(
        "compact: values: expected one for each of the selection's " + std::to_string(s.size()) +
        " keypoints, found " +
        (PySequence_Check(values.ptr()) ? std::to_string(py::len(values)) : found_text(values)));
  if (py::isinstance<py::array>(values)) return values[array_of(s.kept)];
  py::list kept;
  for (const int i : s.kept) kept.append(values[py::int_(i)]);
  return kept;
}

}  // namespace

const Selection& selection_of(const py::object& value, const char* where) {
  if (!py::isinstance<Selection>(value))
    throw Error(std::string(where) + ": expected a stillpoint.Selection, found " +
                found_text(value));
  return *value.cast<Selection*>();
}

void bind_selection(py::module_& m) {
  py::class_<Selection>(m, "Selection",
                        "What the front end says of each keypoint, by index.\n\nkeypoints[s.kept] "
                        "are the static ones; the rows of descriptors likewise.")
      .def_property_readonly(
          "kept", [](const Selection& s) { return array_of(s.kept); },
          "Indices of the kept keypoints, ascending, (K,) int32.")
      .def_property_readonly("is_kept", &kept_mask_of, "Whether each was kept, (N,) bool.")
      .def_property_readonly(
          "probability", [](const Selection& s) { return array_of(s.probability); },
          "Probability of being dynamic, (N,) float32, 0 to 1.")
      .def_property_readonly("reason", &reasons_of,
                             "Why each was kept or removed, (N,) uint8: KeypointReason.")
      .def("__len__", &Selection::size)
      .def("__repr__", [](const Selection& s) {
        return "<Selection: " + std::to_string(s.kept.size()) + " of " + std::to_string(s.size()) +
               " keypoints kept>";
      });
  m.def("compact", &compact_of, py::arg("values"), py::arg("selection"),
        "The values of the kept keypoints: a list, or an array of its rows.");
  m.def(
      "status_names",
      [](const py::object& status) {
        return status_names(static_cast<std::uint32_t>(whole_of(status, "status")));
      },
      py::arg("status"), "Names of the bits of a status.");
}

}  // namespace stillpoint::python
