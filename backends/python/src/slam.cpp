// SPDX-License-Identifier: BSD-2-Clause
#include "bindings.hpp"

#ifdef STILLPOINT_WITH_RGBD_SLAM

#include <chrono>

#include "arrays.hpp"
#include "calls.hpp"
#include "frames.hpp"
#include "front_end.hpp"
#include "selections.hpp"
#include "slam.hpp"

namespace stillpoint::python {
namespace {

using Pose = std::optional<Eigen::Isometry3d>;

/// Ends the work in another thread, so that Ctrl-C need not wait for it.
void finish(PySlam& s) {
  const PySlam::Use use(s);
  s.finishing = std::async(std::launch::async, [&slam = s.slam] { slam.finish(); });
  const auto done = [&] {
    return s.finishing.wait_for(std::chrono::milliseconds(20)) == std::future_status::ready;
  };
  while (!without_gil(done)) {
  }
  s.finishing.get();
}

std::unique_ptr<PySlam> make_slam(const py::object& camera, const py::object& features,
                                  const py::object& threaded, const py::object& loop_closing,
                                  const py::object& sensor) {
  rgbd_slam::SlamSystem::Settings settings;
  settings.features.features = int_of(features, "features");
  settings.threaded = truth_of(threaded, "threaded");
  settings.loops.enabled = truth_of(loop_closing, "loop_closing");
  if (!sensor.is_none()) {
    if (!py::isinstance<SensorModel>(sensor))
      throw Error("SlamSystem: sensor: expected a stillpoint.SensorModel or None, found " +
                  found_text(sensor));
    settings.noise.sensor = sensor.cast<SensorModel>();
    settings.noise.sensor.check();
  }
  return std::make_unique<PySlam>(camera_of(camera, "SlamSystem: camera"), settings);
}

py::object to_python(const Pose& pose) {
  if (!pose) return py::none();
  return array_of(*pose);
}

Selection all_of(std::size_t count) {
  Selection all;
  all.probability.assign(count, 0.0f);
  all.reason.assign(count, KeypointReason::kStatic);
  all.kept.resize(count);
  for (std::size_t i = 0; i < count; ++i) all.kept[i] = static_cast<int>(i);
  return all;
}

py::object process(PySlam& s, const py::object& frame, const py::object& front_end,
                   const py::object& segmentation) {
  const PySlam::Use use(s);
  const RgbdFrame given = frame_of(frame, "frame");
  if (front_end.is_none()) {
    return to_python(without_gil([&] {
      const auto& keypoints = s.slam.extract(given, DynamicMask());
      return s.slam.track(given, DynamicMask(), all_of(keypoints.size()));
    }));
  }
  if (!py::isinstance<PyFrontEnd>(front_end))
    throw Error("SlamSystem.process: front_end: expected a stillpoint.FrontEnd or None, found " +
                found_text(front_end));
  auto& f = *front_end.cast<PyFrontEnd*>();
  const OneAtATime::Use use_front_end(f.gate);
  std::optional<Segmentation> found;
  if (!segmentation.is_none()) found = segmentation_of(segmentation, given, "segmentation");
  if (found && f.has_segmenter)
    throw Error(
        "SlamSystem.process: segmentation: expected None, as the front end has a "
        "segmenter, found one");
  return to_python(without_gil([&] {
    const Pose motion = s.slam.predicted_motion();
    const DynamicMask& mask = found ? f.front_end.compute_mask(given, *found, motion)
                                    : f.front_end.compute_mask(given, motion);
    const auto& keypoints = s.slam.extract(given, mask);
    const Pose pose = s.slam.track(given, mask, f.front_end.select(keypoints));
    if (pose) f.front_end.correct_pose(*pose);
    return pose;
  }));
}

py::array extract(PySlam& s, const py::object& frame, const py::object& mask) {
  const PySlam::Use use(s);
  const RgbdFrame given = frame_of(frame, "frame");
  const DynamicMask dynamic{mask_or_none(mask, "mask"), 0, 0};
  const auto& keypoints = *without_gil([&] { return &s.slam.extract(given, dynamic); });
  std::vector<float> xy;
  for (const cv::KeyPoint& k : keypoints) xy.push_back(k.pt.x), xy.push_back(k.pt.y);
  return array_of(std::move(xy), 2);
}

py::object track(PySlam& s, const py::object& frame, const py::object& selection) {
  const PySlam::Use use(s);
  const RgbdFrame given = frame_of(frame, "frame");
  const Selection& chosen = selection_of(selection, "selection");
  return to_python(without_gil([&] { return s.slam.track(given, DynamicMask(), chosen); }));
}

py::array map_points(PySlam& s) {
  const PySlam::Use use(s);
  std::vector<double> xyz;
  for (const Eigen::Vector3d& p : s.slam.map_point_positions())
    xyz.insert(xyz.end(), {p.x(), p.y(), p.z()});
  return array_of(std::move(xyz), 3);
}

template <class Read>
auto slam_reader(Read read) {
  return [read](PySlam& s) {
    const PySlam::Use use(s);
    return read(s.slam);
  };
}

void bind_steps(py::class_<PySlam>& cls) {
  cls.def("process", &process, py::arg("frame"), py::arg("front_end") = py::none(),
          py::arg("segmentation") = py::none(),
          "Runs one RgbdFrame through front end and tracker, as `stillpoint run` does.\n\n"
          "front_end: FrontEnd; None: nothing is dynamic. segmentation: for a front end without a\n"
          "segmenter: a Segmentation, a label image, or a list of Instance.\n"
          "Returns T_world_camera, 4 x 4 float64, metres; None: lost.")
      .def("extract", &extract, py::arg("frame"), py::arg("mask") = py::none(),
           "Extracts keypoints outside the mask, (H, W) uint8, not 0 = dynamic: (N, 2) float32.")
      .def("track", &track, py::arg("frame"), py::arg("selection"),
           "Tracks an RgbdFrame on the selected keypoints of the last extract().\n\nReturns "
           "T_world_camera, 4 x 4 float64, metres; None: lost.")
      .def(
          "predicted_motion",
          [](PySlam& s) {
            const PySlam::Use use(s);
            return to_python(s.slam.predicted_motion());
          },
          "T_next_last, 4 x 4: for FrontEnd.compute_mask(T_current_last=...); None: not known.")
      .def("finish", &finish, "Ends background work and adjusts the whole map: 0.1 s to seconds.");
}

}  // namespace

void bind_slam(py::module_& m) {
  py::class_<PySlam> cls(
      m, "SlamSystem",
      "RGB-D SLAM on static keypoints: tracking, local mapping, loop closing.\n\n"
      "The world is the first tracked camera. threaded: mapping in threads of its own; else the\n"
      "same input gives the same trajectory. features: keypoints per frame. sensor: SensorModel, "
      "what\n"
      "the depth is worth; None: kinect_v1.");
  cls.def(py::init(&make_slam), py::arg("camera"), py::kw_only(), py::arg("features") = 1000,
          py::arg("threaded") = false, py::arg("loop_closing") = true,
          py::arg("sensor") = py::none());
  bind_steps(cls);
  cls.def("trajectory", slam_reader([](auto& s) { return trajectory_to_python(s.trajectory()); }),
          "Poses of all tracked frames as they are known now.")
      .def("keyframe_trajectory",
           slam_reader([](auto& s) { return trajectory_to_python(s.keyframe_trajectory()); }),
           "Poses of the keyframes in the map.")
      .def("map_points", &map_points, "Positions of the map's points, (M, 3) float64, metres.")
      .def_property_readonly("keyframes", slam_reader([](auto& s) { return s.keyframes(); }),
                             "Number of keyframes in the map.")
      .def_property_readonly("loops_closed", slam_reader([](auto& s) { return s.loops_closed(); }))
      .def("__repr__", [](PySlam& s) {
        const PySlam::Use use(s);
        return "<SlamSystem: " + std::to_string(s.slam.keyframes()) + " keyframes, " +
               std::to_string(s.slam.map_points()) + " points>";
      });
}

}  // namespace stillpoint::python

#else

namespace stillpoint::python {
void bind_slam(py::module_&) {}
}  // namespace stillpoint::python

#endif
