// SPDX-License-Identifier: BSD-2-Clause
#include <cmath>
#include <sstream>

#include "bindings.hpp"
#include "frames.hpp"
#include "stillpoint/io/camera_file.hpp"

namespace stillpoint::python {
namespace {

template <class T>
using Member = T Camera::*;

const std::pair<const char*, Member<double>> kNumbers[] = {
    {"fx", &Camera::fx},   {"fy", &Camera::fy},
    {"cx", &Camera::cx},   {"cy", &Camera::cy},
    {"k1", &Camera::k1},   {"k2", &Camera::k2},
    {"p1", &Camera::p1},   {"p2", &Camera::p2},
    {"k3", &Camera::k3},   {"depth_units_per_m", &Camera::depth_units_per_m},
    {"fps", &Camera::fps}, {"exposure_s", &Camera::exposure_s}};

void set_number(Camera& camera, const std::string& name, Member<double> member,
                const py::object& value) {
  const std::string where = "Camera." + name;
  const double number = number_of(value, where.c_str());
  const bool positive = name == "fx" || name == "fy" || name == "depth_units_per_m";
  if (!std::isfinite(number) || (positive && !(number > 0)))
    throw Error(where + ": expected a " + (positive ? "positive" : "finite") + " number, found " +
                std::to_string(number));
  camera.*member = number;
}

Camera make_camera(double fx, double fy, double cx, double cy, const py::kwargs& rest) {
  Camera camera;
  set_number(camera, "fx", &Camera::fx, py::float_(fx));
  set_number(camera, "fy", &Camera::fy, py::float_(fy));
  set_number(camera, "cx", &Camera::cx, py::float_(cx));
  set_number(camera, "cy", &Camera::cy, py::float_(cy));
  const py::object self = py::cast(&camera, py::return_value_policy::reference);
  for (const auto& [key, value] : rest) {
    if (!py::hasattr(self, key))
      throw Error("Camera." + std::string(py::str(key)) +
                  ": expected k1, k2, p1, p2, k3, width, height, fps, depth_units_per_m or "
                  "exposure_s, found this name");
    self.attr(key) = value;
  }
  return camera;
}

std::string camera_repr(const Camera& c) {
  std::ostringstream out;
  out.precision(9);
  out << "Camera(fx=" << c.fx << ", fy=" << c.fy << ", cx=" << c.cx << ", cy=" << c.cy;
  const Camera usual;
  for (const auto& [name, member] : kNumbers) {
    const std::string text = name;
    if (text.size() > 2 || text[0] == 'k' || text[0] == 'p')
      if (c.*member != usual.*member) out << ", " << name << "=" << c.*member;
  }
  if (c.width > 0 || c.height > 0) out << ", width=" << c.width << ", height=" << c.height;
  out << ")";
  return out.str();
}

void bind_numbers(py::class_<Camera>& camera) {
  for (const auto& [name, member] : kNumbers)
    camera.def_property(
        name, [member = member](const Camera& c) { return c.*member; },
        [member = member, name = std::string(name)](Camera& c, const py::object& value) {
          set_number(c, name, member, value);
        });
  for (const auto& [name, member] :
       {std::make_pair("width", &Camera::width), std::make_pair("height", &Camera::height)})
    camera.def_property(
        name, [member = member](const Camera& c) { return c.*member; },
        [member = member, name = name](Camera& c, const py::object& value) {
          const long long pixels = whole_of(value, (std::string("Camera.") + name).c_str());
          if (pixels < 0 || pixels > 65535)
            throw Error(std::string("Camera.") + name + ": expected 0 to 65535 pixels, found " +
                        std::to_string(pixels));
          c.*member = static_cast<int>(pixels);
        });
}

}  // namespace

Camera camera_of(const py::object& camera, const char* where) {
  if (camera.is_none()) return {};
  if (!py::isinstance<Camera>(camera))
    throw Error(std::string(where) + ": expected a stillpoint.Camera or None, found " +
                found_text(camera));
  return camera.cast<Camera>();
}

void bind_camera(py::module_& m) {
  py::class_<Camera> camera(
      m, "Camera",
      "Pinhole camera with OpenCV's distortion k1, k2, p1, p2, k3.\n\n"
      "fx, fy, cx, cy: pixels; the centre of the upper left pixel is (0, 0).\n"
      "width, height: pixels, 0 = not known. fps: frames per second, 30.\n"
      "depth_units_per_m: units of uint16 depth per metre, 5000 (TUM, Bonn); 1000: millimetres.\n"
      "exposure_s: seconds, 0 = not known.");
  camera.def(py::init([](const py::object& fx, const py::object& fy, const py::object& cx,
                         const py::object& cy, const py::kwargs& rest) {
               return make_camera(number_of(fx, "Camera.fx"), number_of(fy, "Camera.fy"),
                                  number_of(cx, "Camera.cx"), number_of(cy, "Camera.cy"), rest);
             }),
             py::arg("fx"), py::arg("fy"), py::arg("cx"), py::arg("cy"));
  bind_numbers(camera);
  camera.def_static("tum_fr1", &Camera::tum_fr1, "TUM RGB-D freiburg1.")
      .def_static("tum_fr2", &Camera::tum_fr2, "TUM RGB-D freiburg2.")
      .def_static("tum_fr3", &Camera::tum_fr3, "TUM RGB-D freiburg3.")
      .def_static("bonn", &Camera::bonn, "Bonn RGB-D Dynamic.")
      .def_static(
          "load", [](const py::object& file) { return load_camera(path_of(file, "Camera.load")); },
          py::arg("path"), "Reads an ORB-SLAM style YAML file (camera.yaml).")
      .def(
          "resized",
          [](const Camera& c, const py::object& width, const py::object& height) {
            return c.resized(int_of(width, "Camera.resized: width"),
                             int_of(height, "Camera.resized: height"));
          },
          py::arg("width"), py::arg("height"),
          "The camera of images that are resized to so many pixels.")
      .def(
          "matrix",
          [](const Camera& c) {
            py::array_t<double> k({3, 3});
            const cv::Matx33d matrix = c.matrix();
            for (int i = 0; i < 9; ++i) k.mutable_data()[i] = matrix.val[i];
            return k;
          },
          "The 3 x 3 float64 intrinsic matrix.")
      .def(
          "distortion",
          [](const Camera& c) {
            return array_of(std::vector<double>{c.k1, c.k2, c.p1, c.p2, c.k3});
          },
          "k1, k2, p1, p2, k3 as (5,) float64, as OpenCV takes them.")
      .def("__repr__", &camera_repr)
      .def("__eq__",
           [](const Camera& a, const py::object& b) {
             return py::isinstance<Camera>(b) && camera_repr(a) == camera_repr(b.cast<Camera>());
           })
      .def("__copy__", [](const Camera& c) { return Camera(c); })
      .def(
          "__deepcopy__", [](const Camera& c, const py::object&) { return Camera(c); },
          py::arg("memo"));
  camera.attr("__hash__") = py::none();
}

}  // namespace stillpoint::python
