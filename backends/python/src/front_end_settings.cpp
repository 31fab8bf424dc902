// SPDX-License-Identifier: BSD-2-Clause
#include "bindings.hpp"
#include "settings.hpp"
#include "stillpoint/front_end.hpp"

namespace stillpoint::python {
namespace {

using Compensation = SegmentationCompensatorSettings;
using Depth = DepthMaskFuserSettings;

struct {
  SettingsTable compensation, depth, probability, movers, motion, ego, late, blur, objects, sensor;
} tables;

void bind_paper_stages(py::module_& m) {
  SettingsClass<Compensation>(m, tables.compensation, "SegmentationCompensatorSettings",
                              "Settings of SegmentationCompensator (paper section 3.1).")
      .add_choice("trigger", &Compensation::trigger, {"global", "per_object"},
                  "'per_object', or 'global': the paper's, by the area of the whole mask.")
      .add("area_ratio", &Compensation::area_ratio,
           "An object seen to less than this share counts as missed.")
      .add("history", &Compensation::history, "Last places that the line is fitted to, 1 to 8.")
      .add("corner_history", &Compensation::corner_history,
           "The line runs through the boxes' corners (paper), else through the masks' centres.")
      .add("use_depth", &Compensation::use_depth, "Find a missed object by depth.")
      .add("search_px", &Compensation::search_px, "Reach of the search around the prediction.")
      .add("min_template_score", &Compensation::min_template_score,
           "Correlation from which an object is still there, where depth cannot tell.")
      .add("min_depth_support", &Compensation::min_depth_support,
           "Share of an object's measured pixels whose depth must agree with it.")
      .add("max_restored_frames", &Compensation::max_restored_frames,
           "Results in a row that may miss an object before it is forgotten.")
      .add("sharp_px", &Compensation::sharp_px,
           "A miss counts twice where the object moves by less and edges are sharp.")
      .add("max_prediction_s", &Compensation::max_prediction_s,
           "How long an object is carried along without being seen, seconds.")
      .add("max_unnamed_s", &Compensation::max_unnamed_s,
           "The same for an object without a class, seconds.")
      .add("sudden_share", &Compensation::sudden_share,
           "What suddenly covers more of the image is doubted; 1: nothing is.")
      .add("sudden_results", &Compensation::sudden_results, "Until so many results show it.")
      .add("max_speed_m_s", &Compensation::max_speed_m_s, "Bound on an object's speed, m/s.")
      .add_preset("paper", &Compensation::paper, "The paper's method, changed by keywords.");
  SettingsClass<Depth>(m, tables.depth, "DepthMaskFuserSettings",
                       "Settings of DepthMaskFuser (paper section 3.2).")
      .add_choice("method", &Depth::method, {"paper", "connected"},
                  "'connected', or 'paper': mean depth of the box +- range_m.")
      .add("cell_px", &Depth::cell_px, "Side of a sampling cell, 1 to 64.")
      .add("range_m", &Depth::range_m, "Depth beyond the range seen on the mask, metres.")
      .add("growth_m", &Depth::growth_m, "How far the mask may grow over connected depth, metres.")
      .add("dilation_px", &Depth::dilation_px, "Dilation to each side, for an image 640 wide.")
      .add("dilation_per_blur_px", &Depth::dilation_per_blur_px,
           "Dilation by at least this share of an instance's blur.")
      .add("seed", &Depth::seed, "Seed of the samples' places.")
      .add_preset("paper", &Depth::paper, "The paper's method, changed by keywords.");
  using KeypointFilter = KeypointFilterSettings;
  SettingsClass<KeypointFilter>(m, tables.probability, "KeypointFilterSettings",
                                "Settings of ProbabilisticKeypointFilter (paper section 3.3).")
      .add("radius_px", &KeypointFilter::radius_px, "Neighbors lie within this distance.")
      .add("weight", &KeypointFilter::weight, "c1 of the weight c1 exp(-c2 r).")
      .add("decay_per_px", &KeypointFilter::decay_per_px, "c2 of the weight c1 exp(-c2 r).")
      .add("threshold", &KeypointFilter::threshold,
           "A keypoint that is more probable is removed, 0 to 1.")
      .add("min_kept", &KeypointFilter::min_kept,
           "Below this number the least dynamic ones are kept, too.")
      .add_preset("paper", &KeypointFilter::paper, "The paper's method, changed by keywords.");
}

void bind_motion(py::module_& m) {
  using Movers = MoverDetectorSettings;
  SettingsClass<Movers>(m, tables.movers, "MoverDetectorSettings",
                        "How moved cells become movers without a class.")
      .add("min_moved_cells", &Movers::min_moved_cells, "Least number of moved cells.")
      .add("min_moved_area_m2", &Movers::min_moved_area_m2, "Least area that moved, m2.")
      .add("min_moved_share", &Movers::min_moved_share, "Least share of moved cells, 0 to 1.")
      .add("growth_m", &Movers::growth_m, "How far a region grows over connected depth, metres.")
      .add("max_open_share", &Movers::max_open_share,
           "Greatest share of a mover's border that goes on into what is not part of it.");
  SettingsClass<MotionCheckSettings>(m, tables.motion, "MotionCheckSettings",
                                     "Settings of the motion check: movers that nobody named.")
      .add("block_px", &MotionCheckSettings::block_px, "Side of a cell; 0: 1/80 of the width.")
      .add_nested("movers", &MotionCheckSettings::movers, tables.movers,
                  "How cells become movers.");
  using Ego = EgoMotionSettings;
  SettingsClass<Ego>(m, tables.ego, "EgoMotionSettings", "Settings of the camera's motion.")
      .add("measure", &Ego::measure, "Measure it from the images; False: only what the host tells.")
      .add("max_step_m", &Ego::max_step_m, "A longer step between two frames is a cut, metres.")
      .add("max_rotation_deg", &Ego::max_rotation_deg, "A larger rotation is a cut, degrees.")
      .add("max_doubt", &Ego::max_doubt, "Support by which the images overrule the host, 0 to 1.")
      .add("jump_m", &Ego::jump_m, "A host off by more has jumped, metres.")
      .add("jump_rad", &Ego::jump_rad, "A host off by more has jumped, rad.");
  using Late = LateSegmentationSettings;
  SettingsClass<Late>(m, tables.late, "LateSegmentationSettings",
                      "What becomes of late segmentations.")
      .add("predict", &Late::predict, "Predict late masks forward.")
      .add("max_age_s", &Late::max_age_s, "An older segmentation is dropped, seconds.")
      .add("widen_after_s", &Late::widen_after_s, "Masks older than this are widened, seconds.")
      .add("widen_px_per_s", &Late::widen_px_per_s, "By so many pixels per second, at most 20.");
  SettingsClass<BlurMeterSettings>(m, tables.blur, "BlurMeterSettings",
                                   "Settings of the blur meter.")
      .add("exposure_s", &BlurMeterSettings::exposure_s,
           "Exposure time, seconds; 0: the camera's.");
  using Objects = ObjectTrackerSettings;
  SettingsClass<Objects>(m, tables.objects, "ObjectTrackerSettings",
                         "Settings of FrontEnd.objects.")
      .add("max_lost_s", &Objects::max_lost_s, "How long an object out of view keeps its id.")
      .add("velocity_m_s", &Objects::velocity_m_s, "Deviation of a new object's velocity, m/s.")
      .add("acceleration_m_s2", &Objects::acceleration_m_s2, "How much it changes in a second.")
      .add("centroid_m", &Objects::centroid_m, "How far the visible centroid wanders, metres.");
}

void bind_sensor(py::module_& m) {
  using Sensor = SensorModel;
  SettingsClass<Sensor>(m, tables.sensor, "SensorModel",
                        "How far a depth camera's measurements can be wrong.\n\nThe standard "
                        "deviation of a depth z is sqrt(floor^2 + (slope z)^2 + (square z^2)^2).")
      .add("depth_floor_m", &Sensor::depth_floor_m, "Fixed part, metres.")
      .add("depth_slope", &Sensor::depth_slope, "Part that grows with z.")
      .add("depth_square", &Sensor::depth_square, "Part that grows with z^2, 1 / metres.")
      .add("depth_systematic", &Sensor::depth_systematic,
           "Share of the depth's variance that is the same in every frame, 0 to 1.")
      .add("sigmas", &Sensor::sigmas, "Differences within so many deviations mean nothing.")
      .add("delay_s", &Sensor::delay_s, "Unknown time between color and depth, seconds.")
      .add("readout_s", &Sensor::readout_s, "From the first to the last row, seconds.")
      .add("min_range_m", &Sensor::min_range_m, "Least distance that is measured, metres.")
      .add("max_range_m", &Sensor::max_range_m, "Distance up to which it measures, metres.")
      .add_preset("kinect_v1", &Sensor::kinect_v1, "Structured light: Kinect v1, Xtion.")
      .add_preset("time_of_flight", &Sensor::time_of_flight, "Kinect v2, Azure Kinect.")
      .add_preset("realsense_d400", &Sensor::realsense_d400, "Active stereo: RealSense D4xx.")
      .add_preset("exact", &Sensor::exact, "A rendered camera.");
}

}  // namespace

SettingsTable& front_end_table() {
  static SettingsTable table;
  return table;
}
SettingsTable& compensation_table() { return tables.compensation; }
SettingsTable& depth_table() { return tables.depth; }
SettingsTable& probability_table() { return tables.probability; }

void bind_settings(py::module_& m) {
  bind_paper_stages(m);
  bind_motion(m);
  bind_sensor(m);
  using S = FrontEndSettings;
  SettingsClass<S> settings(
      m, front_end_table(), "FrontEndSettings",
      "Settings of FrontEnd: those of its stages, and which of them run.\n\nKeyword "
      "arguments set members, also those of stages by their own name:\n\n    "
      "FrontEndSettings(use_motion=False, dilation_px=5, depth={\"growth_m\": 0.2})\n");
  settings
      .add_nested("compensation", &S::compensation, tables.compensation, "Missed detections (3.1).")
      .add_nested("depth", &S::depth, tables.depth, "Masks and depth (3.2).")
      .add_nested("probability", &S::probability, tables.probability, "Keypoints (3.3).")
      .add_nested("motion", &S::motion, tables.motion, "Movers without a name.")
      .add_nested("ego", &S::ego, tables.ego, "The camera's motion.")
      .add_nested("late", &S::late, tables.late, "Late segmentations.")
      .add_nested("blur", &S::blur, tables.blur, "Motion blur.")
      .add_nested("objects", &S::objects, tables.objects, "Ids, places and velocities.")
      .add_nested("sensor", &S::sensor, tables.sensor,
                  "What the depth camera's measurements are worth.")
      .add("use_compensation", &S::use_compensation, "Mend missed detections (3.1).")
      .add("use_depth", &S::use_depth, "Fuse masks with depth (3.2).")
      .add("use_probability", &S::use_probability, "Judge keypoints by their neighbors (3.3).")
      .add("use_motion", &S::use_motion, "Find what moves though nobody names it. Needs depth.")
      .add("dynamic_classes", &S::dynamic_classes,
           "Classes that may move: a tuple of (name, prior); set by names or (name, prior).")
      .add("large_mask_share", &S::large_mask_share,
           "A mask over this share of the image is reported, 0 to 1.")
      .add_preset("network_only", &S::network_only,
                  "Without the motion check: what no segmenter names is static.")
      .add_preset("paper", &S::paper, "The method of the paper.");
  settings.python().def_static(
      "preset",
      [](const py::object& name, const py::kwargs& changes) {
        S preset = S::preset(text_of(name, "preset"));
        apply(front_end_table(), &preset, changes);
        return preset;
      },
      py::arg("name"), "The preset 'default', 'network_only' or 'paper', changed by keywords.");
  settings.python().def_static(
      "with_motion",
      [](const py::kwargs& changes) {
        if (PyErr_WarnEx(PyExc_DeprecationWarning,
                         "the default has the motion check: FrontEndSettings()", 1) != 0)
          throw py::error_already_set();
        S preset;
        apply(front_end_table(), &preset, changes);
        return preset;
      },
      "The default. Deprecated.");
}

}  // namespace stillpoint::python
