// SPDX-License-Identifier: BSD-2-Clause
#include "front_end.hpp"

#include <pybind11/stl.h>

#include <memory>

#include "arrays.hpp"
#include "bindings.hpp"
#include "frames.hpp"
#include "segmenter.hpp"
#include "settings.hpp"

namespace stillpoint::python {
namespace {

using Use = OneAtATime::Use;

std::unique_ptr<PyFrontEnd> make_front_end(const py::object& camera, const py::object& segmenter,
                                           const py::object& settings, const py::kwargs& changes) {
  const auto wanted =
      settings_of<FrontEndSettings>(settings, changes, front_end_table(), "FrontEnd");
  return std::make_unique<PyFrontEnd>(wanted, camera_of(camera, "FrontEnd: camera"),
                                      segmenter_of(segmenter, "FrontEnd: segmenter"));
}

/// The segmentation that a caller brings; nothing if he brings none.
std::optional<Segmentation> brought(const py::object& labels, const py::object& instances,
                                    const py::object& boxes, const py::object& segmentation,
                                    const RgbdFrame& frame) {
  const cv::Size size = frame.color.size();
  const int given =
      !labels.is_none() + !instances.is_none() + !boxes.is_none() + !segmentation.is_none();
  if (given == 0) return std::nullopt;
  if (given > 1)
    throw Error("compute_mask: expected one of labels, instances, boxes and segmentation, found " +
                std::to_string(given));
  if (!segmentation.is_none()) return segmentation_of(segmentation, frame, "segmentation");
  Segmentation result;
  result.available = true;
  result.instances = !labels.is_none()      ? instances_of_labels(labels, size, "labels")
                     : !instances.is_none() ? instances_of_list(instances, "instances")
                                            : instances_of_boxes(boxes, size);
  return result;
}

py::array compute_mask(PyFrontEnd& f, const py::object& color, const py::object& depth,
                       const py::object& timestamp, const py::object& labels,
                       const py::object& instances, const py::object& boxes,
                       const py::object& segmentation, const py::object& T_current_last,
                       const py::object& units, const py::object& depth_timestamp) {
  const Use use(f.gate);
  const RgbdFrame frame =
      frame_of(color, depth, timestamp, units, depth_timestamp, f.depth_units_per_m);
  const auto given = brought(labels, instances, boxes, segmentation, frame);
  if (given && f.has_segmenter)
    throw Error(
        "compute_mask: expected labels, instances, boxes or segmentation only without a "
        "segmenter, found both");
  const auto motion = pose_or_none(T_current_last, "T_current_last");
  without_gil([&] {
    if (given)
      f.front_end.compute_mask(frame, *given, motion);
    else
      f.front_end.compute_mask(frame, motion);
  });
  return array_of(f.front_end.mask().image);
}

py::object stage_mask(PyFrontEnd& f, cv::Mat (FrontEnd::*stage)() const) {
  const Use use(f.gate);
  if (f.front_end.mask().image.empty()) return py::none();
  const cv::Mat mask = without_gil([&] { return (f.front_end.*stage)(); });
  return array_of(mask);
}

constexpr const char* kClass =
    "Tells which pixels and keypoints of an RGB-D frame belong to the static world.\n\n"
    "Two calls per frame: compute_mask(), then select() on your keypoints. One object per\n"
    "camera, one call at a time; several cameras may run in several threads.\n\n"
    "camera: Camera; None: without its help (no camera motion, no floor).\n"
    "segmenter: Segmenter that is asked in each frame; None: you bring the masks.\n"
    "settings: FrontEndSettings. Keyword arguments change single settings, e.g.\n"
    "  FrontEnd(camera, use_motion=False, dilation_px=5).";

constexpr const char* kComputeMask =
    "Computes the dynamic mask of a frame: (H, W) uint8, 255 = dynamic, 0 = static.\n\n"
    "color: (H, W, 3) uint8 BGR or (H, W) gray; or an RgbdFrame, and the rest of the frame is\n"
    "  left out.\n"
    "depth: (H, W) float32 metres or uint16, registered to color; 0 and NaN: not measured. None:\n"
    "  no depth.\n"
    "timestamp: seconds, growing from frame to frame.\n"
    "labels: (H, W) uint8, 0 = background, k = instance k; or bool, or 0 and 255 only: split into\n"
    "  connected parts.\n"
    "instances: list of Instance. boxes: (N, 4), x, y, width, height in pixels. segmentation:\n"
    "  Segmentation, which may be of an earlier frame. At most one of the four; without any, the\n"
    "  frame has no result, and masks are predicted from earlier ones.\n"
    "T_current_last: 4 x 4, maps points of the last frame's camera into this one's, if you can\n"
    "  predict it.\n"
    "depth_units_per_m: of uint16 depth; None: the camera's.\n"
    "depth_timestamp: when the depth was measured, seconds; None: with the color.\n\n"
    "The mask shares no memory with later ones. Arrays whose rows are not contiguous are copied.";

void bind_stats(py::module_& m) {
  py::class_<FrameStats> stats(m, "FrameStats", "What the front end did with one frame.");
  stats
      .def_property_readonly(
          "status",
          [](const FrameStats& s) {
            return py::module_::import("stillpoint._enums").attr("FrameStatus")(s.status);
          },
          "FrameStatus bits; 0 = all as it should be.")
      .def_property_readonly(
          "blur_px", [](const FrameStats& s) { return s.blur.motion_px; },
          "Predicted motion of the image during the exposure, pixels; NaN: not known.")
      .def_property_readonly(
          "sharpness", [](const FrameStats& s) { return s.blur.sharpness; },
          "How sharp the edges are, 0 to 1; NaN: not known.")
      .def_readonly("timestamp", &FrameStats::timestamp, "Seconds.")
      .def_readonly("segmenter_error", &FrameStats::segmenter_error,
                    "What the segmenter raised; '' if it did not.")
      .def_readonly("segmentation_ms", &FrameStats::segmentation_ms)
      .def_readonly("motion_ms", &FrameStats::motion_ms)
      .def_readonly("compensation_ms", &FrameStats::compensation_ms)
      .def_readonly("depth_ms", &FrameStats::depth_ms)
      .def_readonly("probability_ms", &FrameStats::probability_ms)
      .def_readonly("instances", &FrameStats::instances, "Dynamic instances after compensation.")
      .def_readonly("restored", &FrameStats::restored, "How many of them were restored.")
      .def_readonly("moving", &FrameStats::moving, "Instances that the motion check found.")
      .def_readonly("mask_share", &FrameStats::mask_share, "Share of the image, 0 to 1.")
      .def_readonly("mask_age_s", &FrameStats::mask_age_s,
                    "Age of the newest segmentation in the mask, seconds; inf: there was none.")
      .def_readonly(
          "depth_delay_s", &FrameStats::depth_delay_s,
          "How long after its stamp the depth is taken, seconds; nan: not known (yet).\n\n"
          "Frames in which the camera rotates tell it.")
      .def_readonly("depth_readout_s", &FrameStats::depth_readout_s,
                    "How long it takes to read the depth out, from the first to the last row "
                    "(negative: from below), seconds; nan: not known (yet).")
      .def_readonly("keypoints", &FrameStats::keypoints)
      .def_readonly("kept", &FrameStats::kept)
      .def("__repr__", [](const FrameStats& s) {
        std::string status;
        for (const std::string& name : status_names(s.status))
          status += (status.empty() ? "" : ", ") + name;
        return "<FrameStats of " + std::to_string(s.timestamp) +
               " s: " + std::to_string(s.instances) + " instances, mask " +
               std::to_string(100 * s.mask_share).substr(0, 4) + " %, kept " +
               std::to_string(s.kept) + " of " + std::to_string(s.keypoints) + " keypoints" +
               (status.empty() ? "" : "; " + status) + ">";
      });
}

void bind_results(py::class_<PyFrontEnd>& cls) {
  cls.def_property_readonly(
         "mask",
         [](PyFrontEnd& f) -> py::object {
           const Use use(f.gate);
           if (f.front_end.mask().image.empty()) return py::none();
           return array_of(f.front_end.mask().image);
         },
         "The last mask, (H, W) uint8, 255 = dynamic; None before the first frame.\n\nselect() "
         "reads it: what you draw into it counts.")
      .def_property_readonly(
          "stats",
          [](PyFrontEnd& f) {
            const Use use(f.gate);
            return FrameStats(f.front_end.stats());
          },
          "What was done with the last frame.")
      .def_property_readonly(
          "instances",
          [](PyFrontEnd& f) {
            const Use use(f.gate);
            return std::vector<Instance>(f.front_end.instances());
          },
          "The objects of the last frame with their final masks, before dilation.")
      .def_property_readonly(
          "objects",
          [](PyFrontEnd& f) {
            const Use use(f.gate);
            return std::vector<DynamicObject>(f.front_end.objects());
          },
          "The objects of the last frame with ids, places and velocities.\n\nAsk after "
          "correct_pose(), which makes the places better.")
      .def_property_readonly(
          "settings", [](const PyFrontEnd& f) { return FrontEndSettings(f.front_end.settings()); },
          "A copy of the settings.");
  const std::pair<const char*, cv::Mat (FrontEnd::*)() const> masks[] = {
      {"raw_mask", &FrontEnd::raw_mask},
      {"movers_mask", &FrontEnd::movers_mask},
      {"mended_mask", &FrontEnd::mended_mask},
      {"undilated_mask", &FrontEnd::undilated_mask}};
  const char* docs[] = {"The segmenter's own mask, (H, W) uint8, 255 = dynamic.",
                        "What the motion check found, (H, W) uint8, 255 = dynamic.",
                        "Both, mended by the compensation, (H, W) uint8, 255 = dynamic.",
                        "The mask before dilation, (H, W) uint8, 255 = dynamic."};
  for (std::size_t i = 0; i < 4; ++i)
    cls.def(
        masks[i].first, [stage = masks[i].second](PyFrontEnd& f) { return stage_mask(f, stage); },
        docs[i]);
  cls.def("__repr__", [](PyFrontEnd& f) {
    FrontEndSettings settings = f.front_end.settings(), defaults;
    return "<FrontEnd" + std::string(f.has_segmenter ? " with a segmenter" : "") + ", " +
           repr(front_end_table(), &settings, &defaults) + ">";
  });
}

}  // namespace

void bind_front_end(py::module_& m) {
  bind_stats(m);
  py::class_<PyFrontEnd> cls(m, "FrontEnd", kClass);
  cls.def(py::init(&make_front_end), py::arg("camera") = py::none(),
          py::arg("segmenter") = py::none(), py::arg("settings") = py::none(),
          py::keep_alive<1, 3>())
      .def("compute_mask", &compute_mask, py::arg("color"), py::arg("depth") = py::none(),
           py::kw_only(), py::arg("timestamp") = py::none(), py::arg("labels") = py::none(),
           py::arg("instances") = py::none(), py::arg("boxes") = py::none(),
           py::arg("segmentation") = py::none(), py::arg("T_current_last") = py::none(),
           py::arg("depth_units_per_m") = py::none(), py::arg("depth_timestamp") = py::none(),
           kComputeMask)
      .def(
          "correct_pose",
          [](PyFrontEnd& f, const py::object& pose) {
            const Use use(f.gate);
            const Eigen::Isometry3d T_world_camera = pose_of(pose, "T_world_camera");
            without_gil([&] { f.front_end.correct_pose(T_world_camera); });
          },
          py::arg("T_world_camera"),
          "Tells the pose that you tracked for the last frame, 4 x 4, camera to world.\n\nOne that "
          "is no rigid motion is refused: FrameStatus.POSE_REFUSED.")
      .def(
          "select",
          [](PyFrontEnd& f, const py::object& keypoints) {
            const Use use(f.gate);
            const Keypoints points(keypoints, "keypoints");
            return without_gil([&] { return Selection(f.front_end.select(points)); });
          },
          py::arg("keypoints"),
          "Judges keypoints against the last mask: (N, 2), x and y in pixels, or cv2.KeyPoint.")
      .def(
          "select_tracked",
          [](PyFrontEnd& f, const py::object& now, const py::object& before) {
            const Use use(f.gate);
            const Keypoints points(now, "now"), earlier(before, "before");
            return without_gil(
                [&] { return Selection(f.front_end.select_tracked(points, earlier)); });
          },
          py::arg("now"), py::arg("before"),
          "The same for points that you track (KLT): drops them one frame before they are "
          "inside.\n\n"
          "before: where they were in the last frame, (N, 2); NaN: new.");
  bind_results(cls);
}

}  // namespace stillpoint::python
