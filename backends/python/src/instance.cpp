// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/core/instance.hpp"

#include <pybind11/stl.h>

#include <cmath>
#include <limits>

#include "bindings.hpp"
#include "frames.hpp"
#include "stillpoint/io/mask_folder.hpp"

namespace stillpoint::python {
namespace {

int pixel_of(double value, const std::string& where) {
  if (!(std::isfinite(value) && std::abs(value) < 1e6))
    throw Error(where + ": expected pixels, found " + std::to_string(value));
  return static_cast<int>(value);
}

/// x, y, width, height; broken pixels belong to the box.
cv::Rect box_of(double x, double y, double width, double height, const std::string& where) {
  const int left = pixel_of(std::floor(x), where), top = pixel_of(std::floor(y), where);
  return {left, top, pixel_of(std::ceil(x + width), where) - left,
          pixel_of(std::ceil(y + height), where) - top};
}

Instance make_instance(const py::object& box, const py::object& mask, const py::object& class_name,
                       const py::object& score) {
  Instance instance;
  const std::vector<double> b = numbers_of(box, "Instance.box");
  if (b.size() != 4)
    throw Error("Instance.box: expected (x, y, width, height) in pixels, found " +
                std::to_string(b.size()) + " numbers");
  instance.box = box_of(b[0], b[1], b[2], b[3], "Instance.box");
  // Of its own memory, and of 0 and 255.
  if (!mask.is_none()) instance.mask = mask_of(mask, "Instance.mask") > 0;
  instance.class_name = text_of(class_name, "Instance.class_name");
  instance.score = static_cast<float>(number_of(score, "Instance.score"));
  if (!(instance.score >= 0 && instance.score <= 1))
    throw Error("Instance.score: expected 0 to 1, found " + std::to_string(instance.score));
  if (!instance.mask.empty() && instance.mask.size() != instance.box.size())
    throw Error("Instance.mask: expected the box's size " + std::to_string(instance.box.width) +
                "x" + std::to_string(instance.box.height) + ", found " +
                stillpoint::detail::size_text(instance.mask) +
                "; a mask of the whole image makes one by Instance.from_mask(mask)");
  return instance;
}

std::string instance_repr(const Instance& s) {
  const auto text = [](int n) { return std::to_string(n); };
  return "<Instance '" + s.class_name + "' score " + std::to_string(s.score) + ", box (" +
         text(s.box.x) + ", " + text(s.box.y) + ", " + text(s.box.width) + ", " +
         text(s.box.height) + (s.mask.empty() ? "), no mask" : "), mask") +
         (s.predicted ? ", predicted>" : ">");
}

Segmentation make_segmentation(const py::object& instances, const py::object& available,
                               const py::object& timestamp) {
  Segmentation segmentation;
  segmentation.instances = instances_of_list(instances, "Segmentation.instances");
  segmentation.available = truth_of(available, "Segmentation.available");
  if (!timestamp.is_none())
    segmentation.timestamp = timestamp_of(timestamp, "Segmentation.timestamp");
  return segmentation;
}

void bind_instance_class(py::module_& m) {
  py::class_<Instance>(
      m, "Instance",
      "A segmented, or only detected, object of a frame.\n\n"
      "box: (x, y, width, height) in pixels, inside the image.\n"
      "mask: (height, width) of the box, uint8 or bool, not 0 = object; None: only the box.\n"
      "class_name: '' for an object that was found by its motion. score: 0 to 1.")
      .def(py::init(&make_instance), py::arg("box"), py::arg("mask") = py::none(),
           py::arg("class_name") = "person", py::arg("score") = 1.0)
      .def_static(
          "from_mask",
          [](const py::object& mask, const py::object& class_name, const py::object& score) {
            return instance_from_mask(mask_of(mask, "mask"), text_of(class_name, "class_name"),
                                      static_cast<float>(number_of(score, "score")));
          },
          py::arg("mask"), py::arg("class_name") = "person", py::arg("score") = 1.0,
          "From a mask of the whole image, (H, W) uint8 or bool, not 0 = object.")
      .def_readonly("class_name", &Instance::class_name)
      .def_readonly("score", &Instance::score)
      .def_property_readonly(
          "box",
          [](const Instance& s) {
            return py::make_tuple(s.box.x, s.box.y, s.box.width, s.box.height);
          },
          "(x, y, width, height) in pixels.")
      .def_property_readonly(
          "mask",
          [](const Instance& s) -> py::object {
            if (s.mask.empty()) return py::none();
            return array_of(s.mask);
          },
          "(height, width) of the box, uint8, 255 = object; None: only the box is known.")
      .def_readonly("depth_m", &Instance::depth_m, "Expected distance, metres; 0: not known.")
      .def_readonly("predicted", &Instance::predicted, "The mask was carried here.")
      .def_property_readonly(
          "blur_px", [](const Instance& s) { return s.blur.motion_px; },
          "Predicted motion during the exposure, pixels; NaN: not known.")
      .def_property_readonly(
          "sharpness", [](const Instance& s) { return s.blur.sharpness; },
          "How sharp the edges are, 0 to 1; NaN: not known.")
      .def("__repr__", &instance_repr);
}

void bind_functions(py::module_& m) {
  m.def(
      "instances_from_labels",
      [](const py::object& labels, const py::object& class_name, const py::object& min_area_px) {
        return instances_from_labels(mask_of(labels, "labels"), text_of(class_name, "class_name"),
                                     int_of(min_area_px, "min_area_px"));
      },
      py::arg("labels"), py::arg("class_name") = "person", py::arg("min_area_px") = 50,
      "Splits a label image, (H, W) uint8, 0 = background, k = instance k, into instances.\n\nOne "
      "with only 0 and 255, or of bool, is split into connected parts of at least min_area_px.");
  m.def(
      "labels_from_instances",
      [](const py::object& instances, const py::object& shape) {
        return array_of(labels_from_instances(instances_of_list(instances, "instances"),
                                              size_of_shape(shape, "shape")));
      },
      py::arg("instances"), py::arg("shape"),
      "Paints instances into a label image, (H, W) uint8; shape: (H, W).");
  m.def(
      "mask_from_instances",
      [](const py::object& list, const py::object& shape) {
        Segmentation segmentation;
        segmentation.instances = instances_of_list(list, "instances");
        const cv::Size size = size_of_shape(shape, "shape");
        check_segmentation(segmentation, size);
        return array_of(mask_from_instances(segmentation.instances, size));
      },
      py::arg("instances"), py::arg("shape"),
      "The union of instances, (H, W) uint8, 255 = dynamic; shape: (H, W).");
}

}  // namespace

std::vector<Instance> instances_of_labels(const py::object& labels, const cv::Size& size,
                                          const char* where) {
  const cv::Mat image = mask_of(labels, where);
  if (image.size() != size)
    throw Error(std::string(where) + ": expected the color image's size " +
                std::to_string(size.width) + "x" + std::to_string(size.height) + ", found " +
                stillpoint::detail::size_text(image) + " (width x height)");
  return instances_from_labels(image);
}

std::vector<Instance> instances_of_list(const py::object& value, const char* where) {
  if (!PySequence_Check(value.ptr()) || py::isinstance<py::str>(value) ||
      py::isinstance<py::array>(value))
    throw Error(std::string(where) + ": expected a list of stillpoint.Instance, found " +
                found_text(value));
  std::vector<Instance> instances;
  for (const py::handle& item : value) {
    if (!py::isinstance<Instance>(item))
      throw Error(std::string(where) + "[" + std::to_string(instances.size()) +
                  "]: expected a stillpoint.Instance, found " + found_text(item));
    instances.push_back(item.cast<Instance>());
  }
  return instances;
}

std::vector<Instance> instances_of_boxes(const py::object& value, const cv::Size& size) {
  const py::array_t<double> table = table_of(value, 4, "boxes");
  const auto b = table.unchecked<2>();
  std::vector<Instance> instances;
  for (py::ssize_t i = 0; i < table.shape(0); ++i) {
    Instance instance;
    instance.box = box_of(b(i, 0), b(i, 1), b(i, 2), b(i, 3), "boxes[" + std::to_string(i) + "]");
    // Detectors round beyond the image's border. What reaches farther, as corners taken for sizes
    // do, is refused by the front end.
    const cv::Rect image(cv::Point(), size), border(-2, -2, size.width + 4, size.height + 4);
    if (instance.box.width >= 0 && (instance.box & border) == instance.box) {
      instance.box &= image;
      if (instance.box.empty()) continue;
    }
    instances.push_back(std::move(instance));
  }
  return instances;
}

Segmentation segmentation_of(const py::object& value, const RgbdFrame& frame, const char* where) {
  if (py::isinstance<Segmentation>(value)) return value.cast<Segmentation>();
  Segmentation segmentation;
  segmentation.available = !value.is_none();
  if (py::isinstance<py::array>(value))
    segmentation.instances = instances_of_labels(value, frame.color.size(), where);
  else if (!value.is_none())
    segmentation.instances = instances_of_list(value, where);
  return segmentation;
}

void bind_instance(py::module_& m) {
  bind_instance_class(m);
  py::class_<Segmentation>(
      m, "Segmentation",
      "What a segmenter says of one frame.\n\n"
      "available: False = no result for this frame, masks are predicted; True with no instances =\n"
      "  nobody is in view.\n"
      "timestamp: of the frame that was segmented, seconds; None: of the one it is given with. An\n"
      "  earlier frame's masks are predicted forward.")
      .def(py::init(&make_segmentation), py::arg("instances") = py::list(),
           py::arg("available") = true, py::arg("timestamp") = py::none())
      .def_readonly("available", &Segmentation::available)
      .def_property_readonly("timestamp",
                             [](const Segmentation& s) -> py::object {
                               if (std::isnan(s.timestamp)) return py::none();
                               return py::float_(s.timestamp);
                             })
      .def_property_readonly("instances",
                             [](const Segmentation& s) {
                               py::list list;
                               for (const Instance& i : s.instances) list.append(py::cast(i));
                               return list;
                             })
      .def("__repr__", [](const Segmentation& s) {
        return s.available
                   ? "<Segmentation of " + std::to_string(s.instances.size()) + " instances>"
                   : std::string("<Segmentation: no result>");
      });
  bind_functions(m);
}

}  // namespace stillpoint::python
