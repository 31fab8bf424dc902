// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "arrays.hpp"
#include "stillpoint/core/camera.hpp"
#include "stillpoint/core/frame.hpp"

namespace stillpoint::python {

/// A frame from arrays; `color` may be an RgbdFrame, and the rest is None then. 16-bit depth is in
/// `depth_units_per_m`, else in `otherwise` units per metre (0: not known, an Error).
RgbdFrame frame_of(const py::object& color, const py::object& depth, const py::object& timestamp,
                   const py::object& depth_units_per_m, const py::object& depth_timestamp,
                   double otherwise);
/// An RgbdFrame of Python's.
RgbdFrame frame_of(const py::object& frame, const char* where);
Camera camera_of(const py::object& camera, const char* where);

/// Instances from a label image of that size, a list of Instance, or boxes (N, 4).
std::vector<Instance> instances_of_labels(const py::object& labels, const cv::Size& size,
                                          const char* where);
std::vector<Instance> instances_of_list(const py::object& instances, const char* where);
std::vector<Instance> instances_of_boxes(const py::object& boxes, const cv::Size& size);
/// What a segmenter written in Python may return for a frame: a Segmentation, a label image of its
/// size, a list of instances, or None.
Segmentation segmentation_of(const py::object& value, const RgbdFrame& frame, const char* where);

/// Poses from a Trajectory of Python's.
const Trajectory& trajectory_of(const py::object& value, const char* where);
py::object trajectory_to_python(Trajectory trajectory);

}  // namespace stillpoint::python
