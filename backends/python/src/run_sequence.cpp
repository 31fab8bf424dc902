// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/io/run_sequence.hpp"

#include <pybind11/stl.h>

#include "bindings.hpp"
#include "calls.hpp"
#include "frames.hpp"
#include "front_end.hpp"
#include "segmenter.hpp"
#include "sequences.hpp"
#include "slam.hpp"
#include "stillpoint/core/rigid_motion.hpp"

namespace stillpoint::python {
namespace {

[[noreturn]] void not_defined(const char* method) {
  throw Error("Tracker." + std::string(method) +
              ": expected a subclass that defines it, found none");
}

using Pose = std::optional<Eigen::Isometry3d>;

py::object image_of(const DynamicMask& mask) {
  if (mask.image.empty()) return py::none();
  return array_of(mask.image);
}

py::object pose_to_python(const Pose& pose) {
  if (!pose) return py::none();
  return array_of(*pose);
}

/// A tracker written in Python. What it raises ends the run.
class PyTracker : public Tracker {
 public:
  const std::vector<cv::KeyPoint>& extract(const RgbdFrame& frame,
                                           const DynamicMask& mask) override {
    const py::gil_scoped_acquire gil;
    const Keypoints found(needed("extract")(frame, image_of(mask)), "Tracker.extract: result");
    keypoints_.clear();
    for (const cv::Point2f& p : found.points()) keypoints_.emplace_back(p, 1.0f);
    return keypoints_;
  }

  Pose track(const RgbdFrame& frame, const DynamicMask& mask, const Selection& selection) override {
    const py::gil_scoped_acquire gil;
    const Pose pose =
        pose_or_none(needed("track")(frame, image_of(mask), selection), "Tracker.track: result");
    if (!pose) return pose;
    if (!stillpoint::detail::is_rigid(*pose))
      throw Error(
          "Tracker.track: result: expected a rotation and a translation, found another matrix, or "
          "NaN; return None where the camera is lost");
    tracked_.push_back({frame.timestamp, *pose});
    return pose;
  }

  Pose predicted_motion() const override {
    const py::gil_scoped_acquire gil;
    const py::function own = override_of("predicted_motion");
    return own ? pose_or_none(own(), "Tracker.predicted_motion: result") : std::nullopt;
  }

  Trajectory trajectory() const override {
    const py::gil_scoped_acquire gil;
    const py::function own = override_of("trajectory");
    return own ? trajectory_of(own(), "Tracker.trajectory: result") : tracked_;
  }

  const Trajectory& tracked() const { return tracked_; }
  void begin() { tracked_.clear(); }

  void finish() override {
    const py::gil_scoped_acquire gil;
    if (const py::function own = override_of("finish")) own();
  }

 private:
  py::function override_of(const char* name) const {
    return py::get_override(static_cast<const Tracker*>(this), name);
  }
  py::function needed(const char* name) const {
    const py::function own = override_of(name);
    if (!own) not_defined(name);
    return own;
  }

  std::vector<cv::KeyPoint> keypoints_;
  Trajectory tracked_;
};

/// TrackedFrame with memory of its own.
struct PyTrackedFrame {
  std::size_t index;
  RgbdFrame frame;
  cv::Mat mask;
  std::vector<float> keypoints;
  Selection selection;
  Pose T_world_camera;

  explicit PyTrackedFrame(const TrackedFrame& t)
      : index(t.index),
        frame(t.frame),
        mask(t.mask.image.clone()),
        selection(t.selection),
        T_world_camera(t.T_world_camera) {
    for (const cv::KeyPoint& k : t.keypoints) keypoints.insert(keypoints.end(), {k.pt.x, k.pt.y});
  }
};

template <class AnyFrontEnd>
Trajectory run_with(const TumSequence& sequence, AnyFrontEnd& front_end, const py::object& tracker,
                    const SequenceRun& run) {
#ifdef STILLPOINT_WITH_RGBD_SLAM
  if (py::isinstance<PySlam>(tracker)) {
    auto& slam = *tracker.cast<PySlam*>();
    const PySlam::Use use(slam);
    return without_gil([&] { return run_sequence(sequence, front_end, slam.slam, run); });
  }
#endif
  if (!py::isinstance<Tracker>(tracker))
    throw Error("run_sequence: tracker: expected a stillpoint.SlamSystem or Tracker, found " +
                found_text(tracker));
  auto& own = *tracker.cast<Tracker*>();
  if (auto* python = dynamic_cast<PyTracker*>(&own)) python->begin();
  return without_gil([&] { return run_sequence(sequence, front_end, own, run); });
}

py::object run(const py::object& sequence, const py::object& front_end, const py::object& tracker,
               const py::object& frames, const py::object& trajectory, const py::object& tracked) {
  const TumSequence& images = sequence_of(sequence, "run_sequence: sequence");
  SequenceRun settings;
  const long long count = whole_of(frames, "run_sequence: frames");
  if (count < 0)
    throw Error("run_sequence: frames: expected a number, 0 for all, found " +
                std::to_string(count));
  settings.frames = static_cast<std::size_t>(count);
  if (!trajectory.is_none()) settings.trajectory = path_of(trajectory, "run_sequence: trajectory");
  std::optional<OneAtATime::Use> use;
  PyFrontEnd* own = nullptr;
  settings.tracked = [&](const TrackedFrame& frame) {
    const py::gil_scoped_acquire gil;
    raise_pending();
    if (tracked.is_none()) return;
    use.reset();  // the function may ask the front end
    tracked(PyTrackedFrame(frame));
    if (own) use.emplace(own->gate);
  };
  if (front_end.is_none()) {
    NoFrontEnd none;
    return trajectory_to_python(run_with(images, none, tracker, settings));
  }
  if (!py::isinstance<PyFrontEnd>(front_end))
    throw Error("run_sequence: front_end: expected a stillpoint.FrontEnd or None, found " +
                found_text(front_end));
  own = front_end.cast<PyFrontEnd*>();
  use.emplace(own->gate);
  return trajectory_to_python(run_with(images, own->front_end, tracker, settings));
}

void bind_tracker(py::module_& m) {
  py::class_<Tracker, PyTracker>(
      m, "Tracker",
      "A SLAM or odometry system of yours, for run_sequence(). Subclass it and define extract()\n"
      "and track():\n\n"
      "    class Mine(stillpoint.Tracker):\n"
      "        def extract(self, frame, mask):\n"
      "            return keypoints  # (N, 2), pixels, or a list of cv2.KeyPoint\n"
      "        def track(self, frame, mask, selection):\n"
      "            return pose  # T_world_camera, 4 x 4, or None: lost")
      .def(py::init<>())
      .def("__reduce_ex__", &refuse_copy, py::arg("protocol"))
      .def(
          "extract",
          [](Tracker&, const py::object&, const py::object&) -> py::object {
            not_defined("extract");
          },
          py::arg("frame"), py::arg("mask"),
          "Extracts keypoints of an RgbdFrame outside the mask, (H, W) uint8, 255 = dynamic; "
          "None:\n"
          "nothing is dynamic. Returns (N, 2) pixels, or a list of cv2.KeyPoint.")
      .def(
          "track",
          [](Tracker&, const py::object&, const py::object&, const py::object&) -> py::object {
            not_defined("track");
          },
          py::arg("frame"), py::arg("mask"), py::arg("selection"),
          "Tracks the frame on the selected keypoints of the last extract(). Returns\n"
          "T_world_camera, 4 x 4; None: lost.")
      .def(
          "predicted_motion", [](const Tracker&) { return py::none(); },
          "T_next_last, 4 x 4, maps points of the last camera into the next; None: not known.")
      .def(
          "trajectory",
          [](const Tracker& t) {
            return trajectory_to_python(dynamic_cast<const PyTracker&>(t).tracked());
          },
          "Poses of all tracked frames; as it is, those that track() returned.")
      .def(
          "finish", [](Tracker&) {}, "Called after the last frame.");
}

}  // namespace

void bind_run_sequence(py::module_& m) {
  bind_tracker(m);
  py::class_<PyTrackedFrame>(m, "TrackedFrame", "What became of a frame in run_sequence().")
      .def_readonly("index", &PyTrackedFrame::index, "In the sequence.")
      .def_readonly("frame", &PyTrackedFrame::frame, "RgbdFrame.")
      .def_property_readonly(
          "mask",
          [](const PyTrackedFrame& t) -> py::object {
            if (t.mask.empty()) return py::none();
            return array_of(t.mask);
          },
          "(H, W) uint8, 255 = dynamic; None: without front end.")
      .def_property_readonly(
          "keypoints", [](const PyTrackedFrame& t) { return array_of(t.keypoints, 2); },
          "(N, 2) float32, pixels.")
      .def_readonly("selection", &PyTrackedFrame::selection, "Selection of the keypoints.")
      .def_property_readonly(
          "T_world_camera",
          [](const PyTrackedFrame& t) { return pose_to_python(t.T_world_camera); },
          "4 x 4 float64, metres; None: lost.");
  m.def(
      "run_sequence", &run, py::arg("sequence"), py::arg("front_end"), py::arg("tracker"),
      py::kw_only(), py::arg("frames") = 0, py::arg("trajectory") = py::none(),
      py::arg("tracked") = py::none(),
      "Runs front end and tracker over a TumSequence: the loop of `stillpoint run`.\n\n"
      "front_end: FrontEnd with a segmenter, or without one (the motion check alone); None: every\n"
      "  keypoint goes to the tracker.\n"
      "tracker: SlamSystem, or a Tracker of yours.\n"
      "frames: only so many; 0: all.\n"
      "trajectory: file that is written at the end (TUM format). A run that breaks off writes\n"
      "  what was tracked to FILE.partial.\n"
      "tracked: function that is called with a TrackedFrame after each frame.\n\n"
      "Returns the Trajectory of all tracked frames. What tracker or function raise ends the run.");
}

}  // namespace stillpoint::python
