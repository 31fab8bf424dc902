// SPDX-License-Identifier: BSD-2-Clause
#include <sstream>

#include "arrays.hpp"
#include "bindings.hpp"
#include "calls.hpp"
#include "frames.hpp"
#include "selections.hpp"
#include "settings.hpp"
#include "stillpoint/evaluation/bonn_ground_truth.hpp"
#include "stillpoint/evaluation/bootstrap.hpp"
#include "stillpoint/evaluation/coverage.hpp"
#include "stillpoint/evaluation/ghost_metrics.hpp"
#include "stillpoint/evaluation/keypoint_metrics.hpp"
#include "stillpoint/evaluation/mask_metrics.hpp"
#include "stillpoint/evaluation/trajectory_error.hpp"

namespace stillpoint::python {
namespace {

py::array pairs_of(const std::vector<TimestampPair>& pairs) {
  std::vector<std::int64_t> numbers;
  for (const TimestampPair& p : pairs) {
    numbers.push_back(static_cast<std::int64_t>(p.first));
    numbers.push_back(static_cast<std::int64_t>(p.second));
  }
  return array_of(std::move(numbers), 2);
}

template <class... Parts>
std::string text(const Parts&... parts) {
  std::ostringstream out;
  out.precision(4);
  (out << ... << parts);
  return out.str();
}

void bind_ate(py::module_& m) {
  py::class_<AteResult>(m, "AteResult", "Absolute trajectory error, over the matched poses.")
      .def_readonly("rmse_m", &AteResult::rmse_m)
      .def_readonly("sd_m", &AteResult::sd_m, "Of the population, as numpy.std.")
      .def_readonly("mean_m", &AteResult::mean_m)
      .def_readonly("median_m", &AteResult::median_m)
      .def_readonly("min_m", &AteResult::min_m)
      .def_readonly("max_m", &AteResult::max_m)
      .def_readonly("pairs", &AteResult::pairs, "Number of matched poses.")
      .def_property_readonly(
          "T_groundtruth_estimate",
          [](const AteResult& a) { return array_of(a.T_groundtruth_estimate); },
          "4 x 4, maps the estimate's world to the ground truth's; scale comes before it.")
      .def_readonly("scale", &AteResult::scale, "1 unless with_scale=True.")
      .def_property_readonly(
          "matches", [](const AteResult& a) { return pairs_of(a.matches); },
          "(M, 2) int64: indices in the ground truth and in the estimate.")
      .def_property_readonly(
          "errors_m", [](const AteResult& a) { return array_of(a.errors_m); },
          "(M,) float64: distance of each pair after alignment, metres.")
      .def("__repr__", [](const AteResult& a) {
        return text("<AteResult: RMSE ", a.rmse_m, " m over ", a.pairs, " poses>");
      });
  m.def(
      "ate",
      [](const py::object& groundtruth, const py::object& estimate, const py::object& difference,
         bool with_scale) {
        return ate(trajectory_of(groundtruth, "groundtruth"), trajectory_of(estimate, "estimate"),
                   number_of(difference, "max_difference_s"),
                   with_scale ? Alignment::kSim3 : Alignment::kSE3);
      },
      py::arg("groundtruth"), py::arg("estimate"), py::arg("max_difference_s") = 0.02,
      py::arg("with_scale") = false,
      "Absolute trajectory error as the TUM benchmark defines it, aligned without "
      "scale.\n\nevo_ape "
      "tum --align is the same with max_difference_s=0.01. with_scale: aligned in Sim(3).");
  m.def(
      "camera_of_bonn_body",
      [](const py::object& body) {
        return trajectory_to_python(camera_of_bonn_body(trajectory_of(body, "body")));
      },
      py::arg("body"),
      "Turns the ground truth of the Bonn data set, which is of its markers, into the camera's.");
  m.def(
      "median_interval",
      [](const py::object& values, double confidence, int samples, std::uint64_t seed) {
        const Interval sure =
            median_interval(numbers_of(values, "values"), confidence, samples, seed);
        return py::make_tuple(sure.low, sure.high);
      },
      py::arg("values"), py::arg("confidence") = 0.95, py::arg("samples") = 2000,
      py::arg("seed") = 1,
      "How sure the median of a few runs is: the bootstrap's (low, high); NaN of fewer than two.");
}

void bind_rpe(py::module_& m) {
  py::class_<ErrorStatistics>(m, "ErrorStatistics", "Statistics of errors; NaN: there are none.")
      .def_readonly("rmse", &ErrorStatistics::rmse)
      .def_readonly("sd", &ErrorStatistics::sd)
      .def_readonly("mean", &ErrorStatistics::mean)
      .def_readonly("median", &ErrorStatistics::median)
      .def_readonly("min", &ErrorStatistics::min)
      .def_readonly("max", &ErrorStatistics::max)
      .def_readonly("count", &ErrorStatistics::count)
      .def("__repr__", [](const ErrorStatistics& s) {
        return text("<ErrorStatistics: RMSE ", s.rmse, ", median ", s.median, ", max ", s.max,
                    " of ", s.count, ">");
      });
  py::class_<RpeResult>(m, "RpeResult", "Relative pose error.")
      .def_readonly("translation_m", &RpeResult::translation_m)
      .def_readonly("rotation_deg", &RpeResult::rotation_deg)
      .def_readonly("pairs", &RpeResult::pairs)
      .def("__repr__", [](const RpeResult& r) {
        return text("<RpeResult: RMSE ", r.translation_m.rmse, " m, ", r.rotation_deg.rmse,
                    " deg over ", r.pairs, " pairs>");
      });
  static SettingsTable table;
  SettingsClass<RpeSettings>(m, table, "RpeSettings", "Which poses rpe() compares.")
      .add("delta_frames", &RpeSettings::delta_frames,
           "Poses i and i + delta_frames; not used when delta_s is positive.")
      .add("delta_s", &RpeSettings::delta_s, "Positive: pose i and the one so many seconds later.")
      .add("max_delta_error_s", &RpeSettings::max_delta_error_s, "Pairs further off are left out.")
      .add("max_difference_s", &RpeSettings::max_difference_s,
           "A pose without ground truth this near is left out, seconds.")
      .add_preset("tum", &RpeSettings::tum, "evaluate_rpe.py --fixed_delta: 1 s.");
  m.def(
      "rpe",
      [](const py::object& groundtruth, const py::object& estimate, const py::object& settings,
         const py::kwargs& changes) {
        return rpe(trajectory_of(groundtruth, "groundtruth"), trajectory_of(estimate, "estimate"),
                   settings_of<RpeSettings>(settings, changes, table, "rpe"));
      },
      py::arg("groundtruth"), py::arg("estimate"), py::arg("settings") = py::none(),
      "Relative pose error of the TUM benchmark; by default from frame to frame.\n\nKeyword "
      "arguments change settings: rpe(truth, estimate, delta_s=1).");
}

void bind_coverage(py::module_& m) {
  py::class_<Coverage>(m, "Coverage", "How much of a sequence was tracked.")
      .def_readonly("frames", &Coverage::frames, "Frames with ground truth near in time.")
      .def_readonly("covered", &Coverage::covered, "Those of them that have a pose.")
      .def_readonly("share", &Coverage::share, "covered / frames, 0 to 1.")
      .def("__repr__", [](const Coverage& c) {
        return text("<Coverage: ", c.covered, " of ", c.frames, " frames, ", 100 * c.share, " %>");
      });
  m.def(
      "coverage",
      [](const py::object& groundtruth, const py::object& estimate, const py::object& frames,
         const py::object& difference) {
        const Trajectory& truth = trajectory_of(groundtruth, "groundtruth");
        const Trajectory& found = trajectory_of(estimate, "estimate");
        return coverage(
            truth, found,
            frames.is_none() ? guess_frames(truth, found) : numbers_of(frames, "frames"),
            number_of(difference, "max_difference_s"));
      },
      py::arg("groundtruth"), py::arg("estimate"), py::arg("frames") = py::none(),
      py::arg("max_difference_s") = 0.02,
      "Share of the frames with ground truth that have a pose.\n\nframes: timestamps of the "
      "camera's frames, seconds; None: guessed from the trajectories.");
  m.def(
      "associate",
      [](const py::object& first, const py::object& second, const py::object& difference) {
        return pairs_of(associate(numbers_of(first, "first"), numbers_of(second, "second"),
                                  number_of(difference, "max_difference_s")));
      },
      py::arg("first"), py::arg("second"), py::arg("max_difference_s") = 0.02,
      "Pairs two lists of timestamps as the TUM benchmark does: (M, 2) int64 indices.");
}

void bind_masks(py::module_& m) {
  using Counts = BinaryCounts;
  py::class_<Counts>(m, "BinaryCounts", "Outcomes against the truth; a ratio of nothing is NaN.")
      .def_readonly("true_positive", &Counts::true_positive)
      .def_readonly("false_positive", &Counts::false_positive)
      .def_readonly("false_negative", &Counts::false_negative)
      .def_readonly("true_negative", &Counts::true_negative)
      .def_property_readonly("precision", &Counts::precision)
      .def_property_readonly("recall", &Counts::recall)
      .def_property_readonly("iou", &Counts::iou, "Intersection over union.")
      .def_property_readonly("f1", &Counts::f1)
      .def("__add__",
           [](const Counts& a, const Counts& b) {
             Counts sum = a;
             return sum += b;
           })
      .def("__repr__", [](const Counts& c) {
        return text("<BinaryCounts: IoU ", c.iou(), ", precision ", c.precision(), ", recall ",
                    c.recall(), ">");
      });
  m.def(
      "compare_masks",
      [](const py::object& mask, const py::object& truth, const py::object& valid) {
        return compare_masks(mask_of(mask, "mask"), mask_of(truth, "truth"),
                             mask_or_none(valid, "valid"));
      },
      py::arg("mask"), py::arg("truth"), py::arg("valid") = py::none(),
      "Counts the pixels of a mask against the true one, (H, W), not 0 = dynamic.\n\nvalid: only "
      "its pixels that are not 0 count.");
  py::class_<MaskMetrics>(m, "MaskMetrics", "Sums up the masks of a sequence.")
      .def(py::init<>())
      .def("add", &MaskMetrics::add, py::arg("counts"), "Adds compare_masks() of a frame.")
      .def_property_readonly("pixels", &MaskMetrics::pixels, "Over all pixels of all frames.")
      .def_property_readonly("mean_iou", &MaskMetrics::mean_iou, "Mean over the frames.")
      .def_property_readonly("mean_recall", &MaskMetrics::mean_recall)
      .def_property_readonly("mean_precision", &MaskMetrics::mean_precision)
      .def_property_readonly("frames", &MaskMetrics::frames)
      .def("__repr__", [](const MaskMetrics& s) {
        return text("<MaskMetrics of ", s.frames(), " frames: mean IoU ", s.mean_iou(), ">");
      });
  m.def(
      "compare_keypoints",
      [](const py::object& keypoints, const py::object& selection, const py::object& truth) {
        return compare_keypoints(Keypoints(keypoints, "keypoints").points(),
                                 selection_of(selection, "selection"), mask_of(truth, "truth"))
            .counts;
      },
      py::arg("keypoints"), py::arg("selection"), py::arg("truth"),
      "Counts removed keypoints (positive) against the true mask, (H, W), not 0 = dynamic.");
}

struct PyGhostCounter {
  explicit PyGhostCounter(const GhostCounter::Settings& settings) : counter(settings) {}
  OneAtATime gate{"GhostCounter"};
  GhostCounter counter;
};

void bind_ghosts(py::module_& m) {
  py::class_<GhostCounts>(m, "GhostCounts", "How many points of a map are ghosts of people.")
      .def_readonly("points", &GhostCounts::points)
      .def_readonly("ghosts", &GhostCounts::ghosts)
      .def_property_readonly("share", &GhostCounts::share, "ghosts / points; NaN of nothing.")
      .def("__repr__", [](const GhostCounts& c) {
        return text("<GhostCounts: ", c.ghosts, " of ", c.points, " points>");
      });
  py::class_<PyGhostCounter>(
      m, "GhostCounter",
      "The space where people were and nothing static is: what of a map lies there is a ghost.")
      .def(py::init([](double cell_m) {
             GhostCounter::Settings settings;
             settings.cell_m = cell_m;
             return std::make_unique<PyGhostCounter>(settings);
           }),
           py::arg("cell_m") = GhostCounter::Settings().cell_m)
      .def(
          "add",
          [](PyGhostCounter& g, const py::object& frame, const py::object& camera,
             const py::object& people, const py::object& T_world_camera) {
            const OneAtATime::Use use(g.gate);
            const RgbdFrame given = frame_of(frame, "frame");
            const Camera taken = camera_of(camera, "GhostCounter.add: camera");
            const cv::Mat truth = mask_of(people, "people");
            const Eigen::Isometry3d pose = pose_of(T_world_camera, "T_world_camera");
            without_gil([&] { g.counter.add(given, taken, truth, pose); });
          },
          py::arg("frame"), py::arg("camera"), py::arg("people"), py::arg("T_world_camera"),
          "Adds a frame with its true mask of people, (H, W), not dilated, and its true pose, 4 x "
          "4.")
      .def(
          "count",
          [](PyGhostCounter& g, const py::object& points, const py::object& T_truth_map) {
            const OneAtATime::Use use(g.gate);
            const py::array_t<double> table = table_of(points, 3, "points");
            const Eigen::Isometry3d pose = pose_of(T_truth_map, "T_truth_map");
            const auto xyz = table.unchecked<2>();
            std::vector<ColoredPoint> of_map(static_cast<std::size_t>(xyz.shape(0)));
            for (py::ssize_t i = 0; i < xyz.shape(0); ++i)
              of_map[static_cast<std::size_t>(i)].position =
                  Eigen::Vector3d(xyz(i, 0), xyz(i, 1), xyz(i, 2)).cast<float>();
            return without_gil([&] { return g.counter.count(of_map, pose); });
          },
          py::arg("points"), py::arg("T_truth_map"),
          "Counts the ghosts among points (N, 3), metres. T_truth_map, 4 x 4, maps them into the "
          "world of the true poses (ate().T_groundtruth_estimate).");
}

}  // namespace

void bind_evaluation(py::module_& m) {
  bind_ate(m);
  bind_rpe(m);
  bind_coverage(m);
  bind_masks(m);
  bind_ghosts(m);
}

}  // namespace stillpoint::python
