// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/core/trajectory.hpp"

#include <cmath>

#include "bindings.hpp"
#include "frames.hpp"
#include "stillpoint/io/trajectory_file.hpp"

namespace stillpoint::python {
namespace {

/// A type of its own: a std::vector would become a list.
struct PyTrajectory {
  Trajectory poses;
};

PyTrajectory make_trajectory(const py::object& timestamps, const py::object& poses) {
  const std::vector<double> times = numbers_of(timestamps, "Trajectory.timestamps");
  py::array_t<double> all;
  if (!poses.is_none()) all = py::array_t<double>::ensure(poses);
  PyErr_Clear();
  const auto n = static_cast<py::ssize_t>(times.size());
  const bool none = all && all.size() == 0 && n == 0;
  if (!all ||
      (!none && (all.ndim() != 3 || all.shape(0) != n || all.shape(1) != 4 || all.shape(2) != 4)))
    throw Error("Trajectory.poses: expected an array of shape (" + std::to_string(n) +
                ", 4, 4), one pose per timestamp, found " + found_text(poses));
  PyTrajectory trajectory;
  for (py::ssize_t i = 0; i < n; ++i) {
    const std::string where = "Trajectory.poses[" + std::to_string(i) + "]";
    const auto index = static_cast<std::size_t>(i);
    if (!std::isfinite(times[index]))
      throw Error("Trajectory.timestamps[" + std::to_string(i) + "]: expected seconds, found " +
                  std::to_string(times[index]));
    trajectory.poses.push_back(
        {times[index], pose_of(py::object(all[py::int_(i)]), where.c_str())});
  }
  return trajectory;
}

py::array_t<double> poses_of(const Trajectory& trajectory) {
  std::vector<double> numbers;
  numbers.reserve(16 * trajectory.size());
  for (const StampedPose& pose : trajectory)
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4; ++j) numbers.push_back(pose.T_world_camera.matrix()(i, j));
  py::array_t<double> flat = array_of(std::move(numbers));
  const std::vector<py::ssize_t> shape{static_cast<py::ssize_t>(trajectory.size()), 4, 4};
  return flat.reshape(shape);
}

py::array_t<double> times_of(const Trajectory& trajectory) {
  std::vector<double> times;
  for (const StampedPose& pose : trajectory) times.push_back(pose.timestamp);
  return array_of(std::move(times));
}

}  // namespace

const Trajectory& trajectory_of(const py::object& value, const char* where) {
  if (!py::isinstance<PyTrajectory>(value))
    throw Error(std::string(where) + ": expected a stillpoint.Trajectory, found " +
                found_text(value));
  return value.cast<PyTrajectory*>()->poses;
}

py::object trajectory_to_python(Trajectory trajectory) {
  return py::cast(PyTrajectory{std::move(trajectory)});
}

void bind_trajectory(py::module_& m) {
  py::class_<PyTrajectory>(
      m, "Trajectory",
      "Poses of the tracked frames, in the order of time. A lost frame has no entry.\n\n"
      "timestamps: (N,) float64, seconds.\n"
      "poses: (N, 4, 4) float64, T_world_camera: camera to world, metres.")
      .def(py::init(&make_trajectory), py::arg("timestamps"), py::arg("poses"))
      .def_property_readonly(
          "timestamps", [](const PyTrajectory& t) { return times_of(t.poses); },
          "(N,) float64, seconds.")
      .def_property_readonly(
          "poses", [](const PyTrajectory& t) { return poses_of(t.poses); },
          "(N, 4, 4) float64, T_world_camera.")
      .def_static(
          "read",
          [](const py::object& path) {
            return PyTrajectory{read_trajectory(path_of(path, "Trajectory.read"))};
          },
          py::arg("path"), "Reads a file in TUM format: timestamp tx ty tz qx qy qz qw.")
      .def(
          "write",
          [](const PyTrajectory& t, const py::object& path) {
            write_trajectory(path_of(path, "Trajectory.write"), t.poses);
          },
          py::arg("path"), "Writes a file in TUM format: timestamp tx ty tz qx qy qz qw.")
      .def("__len__", [](const PyTrajectory& t) { return t.poses.size(); })
      .def("__repr__", [](const PyTrajectory& t) {
        if (t.poses.empty()) return std::string("<Trajectory of 0 poses>");
        return "<Trajectory of " + std::to_string(t.poses.size()) + " poses from " +
               std::to_string(t.poses.front().timestamp) + " to " +
               std::to_string(t.poses.back().timestamp) + " s>";
      });
}

}  // namespace stillpoint::python
