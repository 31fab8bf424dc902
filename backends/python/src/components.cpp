// SPDX-License-Identifier: BSD-2-Clause
#include <pybind11/stl.h>

#include "arrays.hpp"
#include "bindings.hpp"
#include "calls.hpp"
#include "frames.hpp"
#include "settings.hpp"
#include "stillpoint/depth/depth_mask_fuser.hpp"
#include "stillpoint/keypoints/probabilistic_keypoint_filter.hpp"
#include "stillpoint/segmentation/segmentation_compensator.hpp"

namespace stillpoint::python {
namespace {

using Use = OneAtATime::Use;

/// A component behind its gate.
template <class Component>
struct Gated {
  template <class... Arguments>
  explicit Gated(const char* name, const Arguments&... arguments)
      : gate(name), component(arguments...) {}
  OneAtATime gate;
  Component component;
};
using Compensator = Gated<SegmentationCompensator>;
using Fuser = Gated<DepthMaskFuser>;
using Filter = Gated<ProbabilisticKeypointFilter<>>;

py::object status_of(std::uint32_t bits) {
  return py::module_::import("stillpoint._enums").attr("FrameStatus")(bits);
}

template <class Gate, class Read>
auto component_reader(Read read) {
  return [read](Gate& g) {
    const Use use(g.gate);
    return read(g.component);
  };
}

void bind_compensator(py::module_& m) {
  py::class_<Compensator>(m, "SegmentationCompensator",
                          "Mends what a segmenter misses (paper section 3.1): objects of the last "
                          "frames\nthat are missing in this one are put back where they must be "
                          "now.")
      .def(py::init(
               [](const py::object& camera, const py::object& settings, const py::kwargs& changes) {
                 constexpr const char* name = "SegmentationCompensator";
                 return std::make_unique<Compensator>(
                     name,
                     settings_of<SegmentationCompensatorSettings>(settings, changes,
                                                                  compensation_table(), name),
                     camera_of(camera, "camera"));
               }),
           py::arg("camera") = py::none(), py::arg("settings") = py::none())
      .def(
          "compensate",
          [](Compensator& c, const py::object& frame, const py::object& segmentation,
             const py::object& T_current_last) {
            const Use use(c.gate);
            const RgbdFrame given = frame_of(frame, "frame");
            const Segmentation found = segmentation_of(segmentation, given, "segmentation");
            const auto T = pose_or_none(T_current_last, "T_current_last");
            return without_gil(
                [&] { return Segmentation(c.component.compensate(given, found, T)); });
          },
          py::arg("frame"), py::arg("segmentation"), py::arg("T_current_last") = py::none(),
          "The segmentation of an RgbdFrame with missed objects restored.\n\nsegmentation: a "
          "Segmentation, a label image, a list of Instance, or None: no result.\nT_current_last: 4 "
          "x 4, maps points of the last frame's camera into this one's.")
      .def("reset", component_reader<Compensator>([](SegmentationCompensator& c) { c.reset(); }),
           "Forgets everything (a cut in the sequence).")
      .def_property_readonly("restored",
                             component_reader<Compensator>([](auto& c) { return c.restored(); }),
                             "How many objects the last call restored.")
      .def_property_readonly(
          "status", component_reader<Compensator>([](auto& c) { return status_of(c.status()); }),
          "FrameStatus bits of the last call.");
}

void bind_fuser(py::module_& m) {
  py::class_<Fuser>(m, "DepthMaskFuser",
                    "Makes the dynamic mask of a frame from its instances and its depth (paper "
                    "section\n3.2).")
      .def(py::init([](const py::object& camera, const py::object& settings,
                       const py::kwargs& changes) {
             constexpr const char* name = "DepthMaskFuser";
             return std::make_unique<Fuser>(
                 name, settings_of<DepthMaskFuserSettings>(settings, changes, depth_table(), name),
                 camera_of(camera, "camera"));
           }),
           py::arg("camera") = py::none(), py::arg("settings") = py::none())
      .def(
          "fuse",
          [](Fuser& f, const py::object& frame, const py::object& segmentation,
             const py::object& T_current_last) {
            const Use use(f.gate);
            const RgbdFrame given = frame_of(frame, "frame");
            const Segmentation found = segmentation_of(segmentation, given, "segmentation");
            const auto T = pose_or_none(T_current_last, "T_current_last");
            return array_of(
                without_gil([&] { return f.component.fuse(given, found, true, 0, T).image; }));
          },
          py::arg("frame"), py::arg("segmentation"), py::arg("T_current_last") = py::none(),
          "The mask of an RgbdFrame, (H, W) uint8, 255 = dynamic.\n\nsegmentation: a Segmentation, "
          "a label image, or a list of Instance.")
      .def("undilated", component_reader<Fuser>([](auto& f) {
             return array_of(cv::Mat(f.undilated().clone()));
           }),
           "The last mask before dilation, (H, W) uint8, 255 = dynamic.")
      .def_property_readonly("instances", component_reader<Fuser>([](auto& f) {
                               return std::vector<Instance>(f.instances());
                             }),
                             "The instances of the last call with their new masks.")
      .def_property_readonly("status",
                             component_reader<Fuser>([](auto& f) { return status_of(f.status()); }),
                             "FrameStatus.NO_DEPTH or 0.");
}

void bind_filter(py::module_& m) {
  py::class_<Filter>(m, "ProbabilisticKeypointFilter",
                     "Removes keypoints that are probably dynamic (paper section 3.3).")
      .def(py::init([](const py::object& settings, const py::kwargs& changes) {
             constexpr const char* name = "ProbabilisticKeypointFilter";
             return std::make_unique<Filter>(
                 name,
                 settings_of<KeypointFilterSettings>(settings, changes, probability_table(), name));
           }),
           py::arg("settings") = py::none())
      .def(
          "filter",
          [](Filter& f, const py::object& keypoints, const py::object& mask,
             const py::object& compute_probability) {
            const Use use(f.gate);
            const Keypoints points(keypoints, "keypoints");
            const DynamicMask given{mask_or_none(mask, "mask"), 0, 0};
            const bool compute = truth_of(compute_probability, "compute_probability");
            return without_gil(
                [&] { return Selection(f.component.filter(points, given, compute)); });
          },
          py::arg("keypoints"), py::arg("mask"), py::arg("compute_probability") = true,
          "Judges keypoints, (N, 2), x and y in pixels, or cv2.KeyPoint, against a mask, (H, W)\n"
          "uint8 or bool, not 0 = dynamic; None: nothing is dynamic.")
      .def_property_readonly(
          "status", component_reader<Filter>([](auto& f) { return status_of(f.status()); }),
          "FrameStatus bits of the last call.");
}

}  // namespace

void bind_components(py::module_& m) {
  bind_compensator(m);
  bind_fuser(m);
  bind_filter(m);
}

}  // namespace stillpoint::python
