// SPDX-License-Identifier: BSD-2-Clause
#include "arrays.hpp"
#include "bindings.hpp"
#include "calls.hpp"
#include "frames.hpp"
#include "settings.hpp"
#include "synthetic/sequence.hpp"

namespace stillpoint::python {
namespace {

SettingsTable table;

RgbdFrame rgbd_of(const SyntheticFrame& f) {
  RgbdFrame frame;
  frame.color = f.color, frame.depth = f.depth;
  frame.timestamp = f.timestamp;
  return frame;
}

SyntheticFrame frame_at(const SyntheticSequence& sequence, py::ssize_t i) {
  const auto n = static_cast<py::ssize_t>(sequence.frame_count());
  if (i < -n || i >= n)
    throw py::index_error("SyntheticSequence: expected an index below " + std::to_string(n) +
                          ", found " + std::to_string(i));
  return without_gil([&] { return sequence.frame(static_cast<int>(i < 0 ? i + n : i)); });
}

py::array failing_labels(const SyntheticSequence& sequence, py::ssize_t i) {
  const SyntheticFrame frame = frame_at(sequence, i);
  const auto n = static_cast<py::ssize_t>(sequence.frame_count());
  const cv::Mat labels = without_gil(
      [&] { return degraded_masks(sequence, frame, static_cast<int>(i < 0 ? i + n : i)); });
  return array_of(labels);
}

py::object groundtruth_of(const SyntheticSequence& sequence) {
  Trajectory poses;
  for (int i = 0; i < sequence.frame_count(); ++i)
    poses.push_back({sequence.timestamp(i), sequence.T_world_camera(sequence.seconds(i))});
  return trajectory_to_python(std::move(poses));
}

void bind_frame_class(py::module_& m) {
  py::class_<SyntheticFrame>(m, "SyntheticFrame", "A rendered frame with its truth.")
      .def_readonly("timestamp", &SyntheticFrame::timestamp, "Seconds.")
      .def_property_readonly(
          "T_world_camera", [](const SyntheticFrame& f) { return array_of(f.T_world_camera); },
          "4 x 4 float64, metres.")
      .def_property_readonly(
          "color", [](const SyntheticFrame& f) { return array_of(f.color); },
          "(H, W, 3) uint8, BGR.")
      .def_property_readonly(
          "depth", [](const SyntheticFrame& f) { return array_of(f.depth); },
          "(H, W) uint16, 5000 units per metre, as a Kinect measures it.")
      .def_property_readonly(
          "exact_depth", [](const SyntheticFrame& f) { return array_of(f.exact_depth); },
          "(H, W) float32, metres.")
      .def_property_readonly(
          "labels", [](const SyntheticFrame& f) { return array_of(f.labels); },
          "(H, W) uint8: 0 = static, 1.. = people, 101.. = movers.")
      .def("rgbd", &rgbd_of, "The RgbdFrame of it.")
      .def("__repr__", [](const SyntheticFrame& f) {
        return "<SyntheticFrame " + std::to_string(f.color.cols) + " x " +
               std::to_string(f.color.rows) + ", timestamp " + std::to_string(f.timestamp) + ">";
      });
}

}  // namespace

void bind_synthetic(py::module_& m) {
  bind_frame_class(m);
  using S = SyntheticSettings;
  SettingsClass<S>(m, table, "SyntheticSettings", "What is filmed, and how.")
      .add_choice("motion", &S::motion, synthetic_motion_names(), "How the camera moves.")
      .add("people", &S::people, "0 to 20.")
      .add("seated", &S::seated, "People sit or stand, and hardly move.")
      .add("carried_object", &S::carried_object, "Every second person carries a carton.")
      .add("movers", &S::movers, "0 = none, 1 = a pushed carton, 2 = also a swinging door.")
      .add("frames", &S::frames, "0 = 150, or the whole way of 'loop'.")
      .add("fps", &S::fps, "Frames per second.")
      .add("shutter_s", &S::shutter_s, "Exposure time, seconds; 0 = no motion blur.")
      .add("width", &S::width, "Pixels.")
      .add("height", &S::height, "Pixels.")
      .add("seed", &S::seed, "Another room, people and paths.")
      .add("start_s", &S::start_s, "Timestamp of the first frame, seconds.")
      .add("color_noise", &S::color_noise, "Noise at middle gray, in steps of 8 bits.");
  py::class_<SyntheticSequence>(
      m, "SyntheticSequence",
      "A rendered RGB-D sequence with people, known poses and labels. No file is needed.\n\n"
      "    for frame in stillpoint.SyntheticSequence(motion='rpy', frames=30): ...\n\n"
      "Keyword arguments change settings. About 0.1 s per frame of 640 x 480.")
      .def(py::init([](const py::object& settings, const py::kwargs& changes) {
             const S wanted = settings_of<S>(settings, changes, table, "SyntheticSequence");
             return without_gil([&] { return std::make_unique<SyntheticSequence>(wanted); });
           }),
           py::arg("settings") = py::none())
      .def_property_readonly("camera", &SyntheticSequence::camera, "Its Camera.")
      .def("__len__", &SyntheticSequence::frame_count)
      .def("__getitem__", &frame_at, py::arg("index"))
      .def("__iter__",
           [](const py::object& self) {
             return py::reinterpret_steal<py::object>(PySeqIter_New(self.ptr()));
           })
      .def("failing_labels", &failing_labels, py::arg("index"),
           "The label image of a frame as a network gives it that fails by blur, (H, W) uint8.")
      .def("groundtruth", &groundtruth_of, "The true Trajectory.")
      .def("__repr__", [](const SyntheticSequence& s) {
        S settings = s.settings(), defaults;
        return "<SyntheticSequence of " + std::to_string(s.frame_count()) +
               " frames: " + repr(table, &settings, &defaults) + ">";
      });
}

}  // namespace stillpoint::python
