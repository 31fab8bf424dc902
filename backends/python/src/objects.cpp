// SPDX-License-Identifier: BSD-2-Clause
#include <pybind11/stl.h>

#include <Eigen/Core>
#include <optional>

#include "bindings.hpp"
#include "frames.hpp"
#include "stillpoint/core/mask_functions.hpp"
#include "stillpoint/core/object.hpp"

namespace stillpoint::python {
namespace {

py::array_t<double> vector_of(const Eigen::Vector3d& v) {
  return array_of(std::vector<double>(v.data(), v.data() + 3));
}

py::object state_of(const std::optional<ObjectState>& state) {
  return state ? py::cast(*state) : py::none();
}

std::string object_repr(const DynamicObject& o) {
  std::string text = "<DynamicObject " + std::to_string(o.id) + " '" + o.class_name + "'";
  if (o.depth_m > 0) text += ", at " + std::to_string(o.depth_m).substr(0, 4) + " m";
  if (o.in_camera)
    text += ", " + std::to_string(o.in_camera->velocity_m_s.norm()).substr(0, 4) + " m/s";
  return text + (o.predicted ? ", predicted>" : ">");
}

void bind_object(py::module_& m) {
  py::class_<ObjectState>(m, "ObjectState",
                          "Where an object is and how it moves, along the axes of one frame.")
      .def_property_readonly(
          "centroid_m", [](const ObjectState& s) { return vector_of(s.centroid_m); },
          "Centroid of the visible surface, (3,) float64.")
      .def_property_readonly(
          "velocity_m_s", [](const ObjectState& s) { return vector_of(s.velocity_m_s); },
          "Velocity against the static world, (3,) float64.")
      .def_property_readonly(
          "covariance",
          [](const ObjectState& s) {
            const double* data = s.covariance.data();  // symmetric: rows or columns first
            return array_of(std::vector<double>(data, data + 36), 6);
          },
          "Of centroid and velocity, (6, 6) float64.")
      .def("__repr__", [](const ObjectState& s) {
        const auto text = [](const Eigen::Vector3d& v) {
          return "(" + std::to_string(v.x()) + ", " + std::to_string(v.y()) + ", " +
                 std::to_string(v.z()) + ")";
        };
        return "<ObjectState at " + text(s.centroid_m) + " m, " + text(s.velocity_m_s) + " m/s>";
      });
  py::class_<DynamicObject>(m, "DynamicObject",
                            "A dynamic object of a frame, and what is known of it from the frames "
                            "before.")
      .def_readonly("id", &DynamicObject::id, "Stays with the object.")
      .def_readonly("class_name", &DynamicObject::class_name,
                    "'' for an object that was found by its motion alone.")
      .def_readonly("score", &DynamicObject::score, "The segmenter's confidence, 0 to 1.")
      .def_property_readonly(
          "box",
          [](const DynamicObject& o) {
            return py::make_tuple(o.box.x, o.box.y, o.box.width, o.box.height);
          },
          "(x, y, width, height) in pixels.")
      .def_property_readonly(
          "mask",
          [](const DynamicObject& o) -> py::object {
            if (o.mask.empty()) return py::none();
            return array_of(o.mask);
          },
          "(height, width) of the box, uint8, 255 = object, before dilation; None: only the box.")
      .def_readonly("predicted", &DynamicObject::predicted,
                    "Missed in this frame, or its result is late: the mask was carried here.")
      .def_readonly("depth_m", &DynamicObject::depth_m, "Median depth; 0: not measured.")
      .def_property_readonly(
          "shift_px",
          [](const DynamicObject& o) { return py::make_tuple(o.shift_px.x, o.shift_px.y); },
          "How far its centre moved in the image since the frame before.")
      .def_readonly("tracked_s", &DynamicObject::tracked_s, "Seconds since it was first seen.")
      .def_readonly("unseen_s", &DynamicObject::unseen_s, "Seconds since it was last seen.")
      .def_property_readonly(
          "in_camera", [](const DynamicObject& o) { return state_of(o.in_camera); },
          "ObjectState along the camera's axes; None without depth.")
      .def_property_readonly(
          "in_world", [](const DynamicObject& o) { return state_of(o.in_world); },
          "ObjectState in the world of the poses of correct_pose(); None without any.")
      .def("__repr__", &object_repr);
}

void bind_mask_functions(py::module_& m) {
  m.def(
      "static_image",
      [](const py::object& mask) { return array_of(static_image(mask_of(mask, "mask"))); },
      py::arg("mask"), "The mask the other way round: (H, W) uint8, 255 = static.");
  m.def(
      "feature_mask",
      [](const py::object& mask, const py::object& margin_px) {
        return array_of(feature_mask(mask_of(mask, "mask"), int_of(margin_px, "margin_px")));
      },
      py::arg("mask"), py::arg("margin_px") = 0,
      "Where a detector may look, as OpenCV's take it: (H, W) uint8, 255 = yes.\n\nmargin_px "
      "pixels around what is dynamic are left out, too.");
  m.def(
      "masked_depth",
      [](const py::object& depth, const py::object& mask) {
        return array_of(masked_depth(depth_of(depth, "depth"), mask_of(mask, "mask")));
      },
      py::arg("depth"), py::arg("mask"),
      "A copy of the depth, uint16 or float32, with 0 (not measured) where the mask is not 0.");
  m.def(
      "dynamic_probability",
      [](const py::object& mask, const py::object& rim_px) {
        return array_of(dynamic_probability(mask_of(mask, "mask"),
                                            static_cast<float>(number_of(rim_px, "rim_px"))));
      },
      py::arg("mask"), py::arg("rim_px") = 10.0,
      "How probably each pixel is dynamic: (H, W) float32, 1 in the mask, 0 from rim_px "
      "on.\n\nGive "
      "it the mask before dilation, FrontEnd.undilated_mask(). A weight is 1 minus this.");
  m.def(
      "dynamic_probability_at",
      [](const py::object& keypoints, const py::object& mask, const py::object& rim_px) {
        const Keypoints points(keypoints, "keypoints");
        return array_of(dynamic_probability_at(points, mask_of(mask, "mask"),
                                               static_cast<float>(number_of(rim_px, "rim_px"))));
      },
      py::arg("keypoints"), py::arg("mask"), py::arg("rim_px") = 10.0,
      "The same at keypoints: (N,) float32; 1 for NaN and outside the image.");
}

}  // namespace

void bind_objects(py::module_& m) {
  bind_object(m);
  bind_mask_functions(m);
}

}  // namespace stillpoint::python
