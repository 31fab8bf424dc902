// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/core/frame.hpp"

#include <pybind11/stl.h>

#include <limits>

#include "bindings.hpp"
#include "frames.hpp"
#include "stillpoint/io/depth_check.hpp"

namespace stillpoint::python {
namespace {

constexpr double kNotKnown = std::numeric_limits<double>::quiet_NaN();

double units_of(const py::object& value, double otherwise) {
  if (!value.is_none()) {
    const double units = number_of(value, "depth_units_per_m");
    if (!(units > 0))
      throw Error(
          "depth_units_per_m: expected a positive number (5000 for TUM, 1000 for "
          "millimetres), found " +
          std::to_string(units));
    return units;
  }
  if (otherwise > 0) return otherwise;
  throw Error(
      "depth_units_per_m: expected the units per metre of a uint16 depth (5000 for TUM, "
      "1000 for millimetres), found None and no camera that tells");
}

std::string frame_repr(const RgbdFrame& f) {
  const std::string size = std::to_string(f.color.cols) + " x " + std::to_string(f.color.rows);
  return "<RgbdFrame " + size + (f.color.channels() == 3 ? " BGR" : " gray") +
         (f.depth.empty()             ? ", no depth"
          : f.depth.depth() == CV_16U ? ", uint16 depth"
                                      : ", float32 depth") +
         ", timestamp " + std::to_string(f.timestamp) + ">";
}

}  // namespace

RgbdFrame frame_of(const py::object& color, const py::object& depth, const py::object& timestamp,
                   const py::object& depth_units_per_m, const py::object& depth_timestamp,
                   double otherwise) {
  if (py::isinstance<RgbdFrame>(color)) {
    if (!depth.is_none() || !timestamp.is_none() || !depth_units_per_m.is_none() ||
        !depth_timestamp.is_none())
      throw Error("frame: expected an RgbdFrame alone, found depth or times beside it");
    return color.cast<RgbdFrame>();
  }
  RgbdFrame frame;
  frame.color = color_of(color, "color");
  frame.depth = depth_of(depth, "depth");
  frame.timestamp = timestamp_of(timestamp, "timestamp");
  if (!depth_timestamp.is_none())
    frame.depth_timestamp = timestamp_of(depth_timestamp, "depth_timestamp");
  if (frame.depth.depth() == CV_32F && !frame.depth.empty() && !depth_units_per_m.is_none())
    throw Error(
        "depth_units_per_m: expected None with a float32 depth, which is in metres, found " +
        std::string(py::str(depth_units_per_m)) + "; divide the depth by it");
  if (!frame.depth.empty() && frame.depth.depth() == CV_16U)
    frame.depth_units_per_m = units_of(depth_units_per_m, otherwise);
  check_frame(frame);
  return frame;
}

RgbdFrame frame_of(const py::object& frame, const char* where) {
  if (!py::isinstance<RgbdFrame>(frame))
    throw Error(std::string(where) + ": expected a stillpoint.RgbdFrame, found " +
                found_text(frame));
  return frame.cast<RgbdFrame>();
}

namespace {

void bind_depth_check(py::module_& m) {
  py::class_<DepthScaleCheck>(
      m, "DepthScaleCheck",
      "Notices a wrong depth factor by the first second of a recording: by distances, the heights\n"
      "of people and above the floor, the sensor's steps, and a metric path. A factor wrong by "
      "two\n"
      "is noticed only by the steps of a Kinect v1 or by a metric path.\n\n"
      "camera: Camera, for the heights; None: without them.")
      .def(py::init([](const py::object& camera) {
             return DepthScaleCheck(
                 camera.is_none() ? Camera() : camera_of(camera, "DepthScaleCheck: camera"));
           }),
           py::arg("camera") = py::none())
      .def(
          "add",
          [](DepthScaleCheck& check, const py::object& frame, const py::object& instances) {
            const RgbdFrame given = frame_of(frame, "frame");
            std::vector<Instance> people;
            if (!instances.is_none()) people = instances_of_list(instances, "instances");
            check.add(given, people);
          },
          py::arg("frame"), py::arg("instances") = py::none(),
          "Looks at an RgbdFrame, and at the list of Instance in it. Frames after the first "
          "second,\n"
          "and those less than 0.1 s after the last one, are passed over.")
      .def(
          "add_motion",
          [](DepthScaleCheck& check, const py::object& tracked_m, const py::object& metric_m) {
            check.add_motion(number_of(tracked_m, "tracked_m"), number_of(metric_m, "metric_m"));
          },
          py::arg("tracked_m"), py::arg("metric_m"),
          "Tells how far the camera moved between two frames, metres: as tracked with this depth,\n"
          "and by a metric source, such as odometry. Five of over 0.1 m that agree decide.")
      .def(
          "is_over",
          [](const DepthScaleCheck& check, const py::object& timestamp) {
            return check.is_over(timestamp_of(timestamp, "timestamp"));
          },
          py::arg("timestamp"), "Whether the first second is over.")
      .def("problem", &DepthScaleCheck::problem,
           "What is wrong, with the factor that would fit; None: nothing, as far as can be told.");
  m.def(
      "check_depth_scale",
      [](const py::object& frame) { return check_depth_scale(frame_of(frame, "frame")); },
      py::arg("frame"),
      "Says when a frame's depth makes no sense (a wrong depth_units_per_m), else None.");
}

}  // namespace

void bind_frame(py::module_& m) {
  py::class_<RgbdFrame>(
      m, "RgbdFrame",
      "One image of an RGB-D camera. Shares the memory of its arrays.\n\n"
      "color: (H, W, 3) uint8, BGR as OpenCV loads it, or (H, W), gray.\n"
      "depth: (H, W) float32 in metres, or uint16 with depth_units_per_m, registered to color; 0\n"
      "  and NaN: no measurement. None: a camera without depth.\n"
      "timestamp: seconds. depth_timestamp: seconds; None: as color.")
      .def(
          py::init([](const py::object& color, const py::object& depth, const py::object& timestamp,
                      const py::object& units, const py::object& depth_timestamp) {
            return frame_of(color, depth, timestamp, units, depth_timestamp, 0);
          }),
          py::arg("color"), py::arg("depth") = py::none(), py::kw_only(), py::arg("timestamp"),
          py::arg("depth_units_per_m") = py::none(), py::arg("depth_timestamp") = py::none())
      .def_property_readonly("color", [](const RgbdFrame& f) { return array_of(f.color); })
      .def_property_readonly("depth",
                             [](const RgbdFrame& f) -> py::object {
                               if (f.depth.empty()) return py::none();
                               return array_of(f.depth);
                             })
      .def_readonly("timestamp", &RgbdFrame::timestamp, "Seconds.")
      .def_property_readonly("depth_timestamp", &RgbdFrame::depth_time, "Seconds.")
      .def_readonly("depth_units_per_m", &RgbdFrame::depth_units_per_m)
      .def_property_readonly(
          "shape", [](const RgbdFrame& f) { return py::make_tuple(f.color.rows, f.color.cols); },
          "(height, width).")
      .def(
          "depth_m",
          [](const RgbdFrame& f) -> py::object {
            if (f.depth.empty()) return py::none();
            cv::Mat metres(f.depth.size(), CV_32FC1);
            for (int y = 0; y < metres.rows; ++y)
              for (int x = 0; x < metres.cols; ++x) metres.at<float>(y, x) = depth_m_at(f, x, y);
            return array_of(metres);
          },
          "Depth in metres, (H, W) float32; 0: no measurement.")
      .def("__repr__", &frame_repr);
  bind_depth_check(m);
}

}  // namespace stillpoint::python
