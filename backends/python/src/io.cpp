// SPDX-License-Identifier: BSD-2-Clause
#include "bindings.hpp"
#include "calls.hpp"
#include "frames.hpp"
#include "sequences.hpp"
#include "stillpoint/io/camera_file.hpp"
#include "stillpoint/io/image_file.hpp"
#include "stillpoint/io/mask_folder.hpp"

namespace stillpoint::python {
namespace {

std::unique_ptr<TumSequence> open_sequence(const py::object& folder, const py::object& camera,
                                           const py::object& associations,
                                           const py::object& max_difference_s,
                                           const py::object& depth_required) {
  TumSequence::Settings settings;
  if (py::isinstance<py::str>(camera))
    settings.camera = camera_from(camera.cast<std::string>());
  else if (!camera.is_none())
    settings.camera = camera_of(camera, "TumSequence: camera");
  if (!associations.is_none()) settings.associations = path_of(associations, "associations");
  settings.max_difference_s = number_of(max_difference_s, "max_difference_s");
  settings.depth_required = truth_of(depth_required, "depth_required");
  return std::make_unique<TumSequence>(path_of(folder, "TumSequence: folder"), settings);
}

RgbdFrame load(const TumSequence& sequence, py::ssize_t i) {
  const auto n = static_cast<py::ssize_t>(sequence.size());
  if (i < -n || i >= n)
    throw py::index_error("TumSequence: expected an index below " + std::to_string(n) + ", found " +
                          std::to_string(i));
  const auto index = static_cast<std::size_t>(i < 0 ? i + n : i);
  return without_gil([&] { return sequence.load(index); });
}

void bind_sequence(py::module_& m) {
  py::class_<TumSequence>(
      m, "TumSequence",
      "An RGB-D sequence in the layout of TUM RGB-D and Bonn: rgb.txt, depth.txt, images.\n\n"
      "    for frame in stillpoint.TumSequence(folder): ...\n\n"
      "reads one RgbdFrame after another; sequence[i] reads one.")
      .def(py::init(&open_sequence), py::arg("folder"), py::arg("camera") = py::none(),
           py::kw_only(), py::arg("associations") = py::none(), py::arg("max_difference_s") = 0.02,
           py::arg("depth_required") = true,
           "camera: Camera, 'fr1', 'fr2', 'fr3', 'bonn' or a YAML file; None: the folder's\n"
           "camera.yaml. max_difference_s: color and depth are paired when less than this apart.\n"
           "depth_required: False = color images alone will do.")
      .def("__len__", &TumSequence::size)
      .def("__getitem__", &load, py::arg("index"))
      .def("__iter__",
           [](const py::object& self) {
             return py::reinterpret_steal<py::object>(PySeqIter_New(self.ptr()));
           })
      .def_property_readonly(
          "camera",
          [](const TumSequence& s) -> py::object {
            if (!s.camera()) return py::none();
            return py::cast(*s.camera());
          },
          "The Camera; None: not known.")
      .def_property_readonly(
          "timestamps", [](const TumSequence& s) { return array_of(s.timestamps()); },
          "(N,) float64, seconds.")
      .def_property_readonly(
          "stems",
          [](const TumSequence& s) {
            py::list stems;
            for (const SequenceEntry& e : s.entries()) stems.append(e.stem);
            return stems;
          },
          "Names of the color files without folder and ending.")
      .def_property_readonly("folder", [](const TumSequence& s) { return s.folder().string(); })
      .def_property_readonly("has_groundtruth", &TumSequence::has_groundtruth)
      .def(
          "groundtruth", [](const TumSequence& s) { return trajectory_to_python(s.groundtruth()); },
          "Reads groundtruth.txt.")
      .def_property_readonly("without_depth", &TumSequence::without_depth,
                             "Color images left out: no depth image near enough.")
      .def_property_readonly("missing_images", &TumSequence::missing_images,
                             "Pairs left out: an image is not on the disk.")
      .def_property_readonly(
          "missing_pictures",
          [](const TumSequence& s) {
            if (PyErr_WarnEx(PyExc_DeprecationWarning,
                             "missing_pictures is now missing_images; the next version knows this "
                             "only",
                             1) != 0)
              throw py::error_already_set();
            return s.missing_images();
          },
          "Old name of missing_images.")
      .def("__repr__", [](const TumSequence& s) {
        return "<TumSequence of " + std::to_string(s.size()) + " frames: " + s.folder().string() +
               ">";
      });
}

}  // namespace

const TumSequence& sequence_of(const py::object& value, const char* where) {
  if (!py::isinstance<TumSequence>(value))
    throw Error(std::string(where) + ": expected a stillpoint.TumSequence, found " +
                found_text(value));
  return *value.cast<TumSequence*>();
}

void bind_io(py::module_& m) {
  bind_sequence(m);
  m.def(
      "read_color",
      [](const py::object& path) { return array_of(read_color(path_of(path, "path"))); },
      py::arg("path"), "Reads a color image, a gray one too: (H, W, 3) uint8, BGR.");
  m.def(
      "read_depth",
      [](const py::object& path) { return array_of(read_depth(path_of(path, "path"))); },
      py::arg("path"), "Reads a depth image: (H, W) uint16, as stored.");
  m.def(
      "read_labels",
      [](const py::object& path, const py::object& shape) {
        return array_of(read_labels(path_of(path, "path"), size_of_shape(shape, "shape")));
      },
      py::arg("path"), py::arg("shape"),
      "Reads a label image of shape (H, W), uint8: 0 = background, k = instance k.");
  m.def(
      "read_mask",
      [](const py::object& path, const py::object& shape) {
        return array_of(read_mask(path_of(path, "path"), size_of_shape(shape, "shape")));
      },
      py::arg("path"), py::arg("shape"),
      "Reads a mask of shape (H, W), uint8: 255 where the file is not 0.");
  m.def(
      "write_mask",
      [](const py::object& path, const py::object& mask) {
        write_image(path_of(path, "path"), mask_of(mask, "mask"));
      },
      py::arg("path"), py::arg("mask"), "Writes a mask or label image, (H, W) uint8 or bool.");
}

}  // namespace stillpoint::python
