// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/mapping/dense_map.hpp"

#include "arrays.hpp"
#include "bindings.hpp"
#include "calls.hpp"
#include "frames.hpp"
#include "settings.hpp"
#include "stillpoint/io/ply_file.hpp"

namespace stillpoint::python {
namespace {

using Use = OneAtATime::Use;

struct PyDenseMap {
  explicit PyDenseMap(const DenseMap::Settings& settings) : map(settings) {}
  OneAtATime gate{"DenseMap"};
  DenseMap map;
};

/// Voxels, for arrays to be made of.
struct Points {
  std::vector<ColoredPoint> points;
};

py::array positions_of(const Points& p) {
  std::vector<float> xyz;
  xyz.reserve(3 * p.points.size());
  for (const ColoredPoint& q : p.points)
    xyz.insert(xyz.end(), {q.position.x(), q.position.y(), q.position.z()});
  return array_of(std::move(xyz), 3);
}

py::array colors_of(const Points& p) {
  std::vector<std::uint8_t> bgr;
  bgr.reserve(3 * p.points.size());
  for (const ColoredPoint& q : p.points) bgr.insert(bgr.end(), {q.bgr[0], q.bgr[1], q.bgr[2]});
  return array_of(std::move(bgr), 3);
}

py::array counts_of(const Points& p) {
  std::vector<std::uint32_t> counts;
  for (const ColoredPoint& q : p.points) counts.push_back(q.count);
  return array_of(std::move(counts));
}

void bind_points(py::module_& m) {
  py::class_<Points>(m, "ColoredPoints", "The points of a dense map, as arrays.")
      .def_property_readonly("positions", &positions_of, "(N, 3) float32, world, metres.")
      .def_property_readonly("colors_bgr", &colors_of, "(N, 3) uint8: blue, green, red.")
      .def_property_readonly("counts", &counts_of, "(N,) uint32: frames that saw each.")
      .def(
          "write_ply",
          [](const Points& p, const py::object& path) {
            const auto file = path_of(path, "write_ply: path");
            without_gil([&] { write_ply(file, p.points); });
          },
          py::arg("path"), "Writes a binary PLY, which CloudCompare, MeshLab and Open3D read.")
      .def("__len__", [](const Points& p) { return p.points.size(); })
      .def("__repr__", [](const Points& p) {
        return "<ColoredPoints: " + std::to_string(p.points.size()) + ">";
      });
}

}  // namespace

void bind_dense_map(py::module_& m) {
  bind_points(m);
  static SettingsTable table;
  using S = DenseMap::Settings;
  SettingsClass<S>(m, table, "DenseMapSettings", "Settings of DenseMap.")
      .add("voxel_m", &S::voxel_m, "Side of a voxel, metres.")
      .add("stride_px", &S::stride_px, "Every n-th pixel of every n-th row.")
      .add("min_depth_m", &S::min_depth_m, "Nearer pixels stay out, metres.")
      .add("max_depth_m", &S::max_depth_m, "Farther pixels stay out, metres.")
      .add("edge_ratio", &S::edge_ratio, "A pixel on a larger step of depth stays out.")
      .add("carve", &S::carve, "Remove voxels that later frames see through.")
      .add("carve_margin_m", &S::carve_margin_m, "How far behind a voxel the depth must lie.")
      .add("carve_margin_per_m", &S::carve_margin_per_m, "The part that grows with the depth.")
      .add("carve_frames", &S::carve_frames, "So many frames must see through a voxel.");
  py::class_<PyDenseMap>(m, "DenseMap",
                         "Colored point cloud of the static world, one point per voxel.\n\nKeyword "
                         "arguments change settings: DenseMap(voxel_m=0.01).")
      .def(py::init([](const py::object& settings, const py::kwargs& changes) {
             return std::make_unique<PyDenseMap>(
                 settings_of<S>(settings, changes, table, "DenseMap"));
           }),
           py::arg("settings") = py::none())
      .def(
          "integrate",
          [](PyDenseMap& d, const py::object& frame, const py::object& camera,
             const py::object& mask, const py::object& T_world_camera) {
            const Use use(d.gate);
            const RgbdFrame given = frame_of(frame, "frame");
            const Camera taken = camera_of(camera, "DenseMap.integrate: camera");
            const DynamicMask dynamic{mask_or_none(mask, "mask"), given.timestamp, 0};
            const Eigen::Isometry3d pose = pose_of(T_world_camera, "T_world_camera");
            without_gil([&] { d.map.integrate(given, taken, dynamic, pose); });
          },
          py::arg("frame"), py::arg("camera"), py::arg("mask"), py::arg("T_world_camera"),
          "Adds the static pixels of an RgbdFrame.\n\nmask: (H, W) uint8, not 0 = dynamic; None: "
          "nothing is. T_world_camera: 4 x 4, metres.")
      .def(
          "points",
          [](PyDenseMap& d, const py::object& min_count) {
            const Use use(d.gate);
            const long long count = whole_of(min_count, "min_count");
            if (count < 0 || count > 1000000000)
              throw Error("min_count: expected at least 0, found " + std::to_string(count));
            return Points{d.map.points(static_cast<std::uint32_t>(count))};
          },
          py::arg("min_count") = 1, "The voxels that at least min_count frames saw.")
      .def("__len__",
           [](PyDenseMap& d) {
             const Use use(d.gate);
             return d.map.size();
           })
      .def("__repr__", [](PyDenseMap& d) {
        const Use use(d.gate);
        return "<DenseMap of " + std::to_string(d.map.size()) + " voxels>";
      });
}

}  // namespace stillpoint::python
