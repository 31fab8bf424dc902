// SPDX-License-Identifier: BSD-2-Clause
#include "systems.hpp"

#include "stillpoint/backends/mask_files.hpp"
#include "stillpoint/backends/rgbd_slam/odometry.hpp"
#include "stillpoint/backends/rgbd_slam/slam_system.hpp"

namespace stillpoint::cli {
namespace {

namespace fs = std::filesystem;

std::string joined(const std::vector<std::string>& names) {
  std::string out;
  for (const std::string& name : names) out += (out.empty() ? "" : ", ") + name;
  return out;
}

/// The camera that a folder's name speaks of ("rgbd_dataset_freiburg3_..."), for a hint.
std::string hinted_camera(const std::string& folder) {
  for (const char* n : {"1", "2", "3"})
    for (const char* word : {"freiburg", "fr"})
      if (folder.find(std::string(word) + n) != std::string::npos) return std::string("fr") + n;
  return folder.find("bonn") != std::string::npos ? "bonn" : "";
}

}  // namespace

std::vector<std::string> segmenter_names() { return {"none", "mask_files"}; }
std::vector<std::string> tracker_names() { return {"slam", "vo"}; }
std::string default_tracker() { return "slam"; }

TumSequence open_sequence(const fs::path& folder, const std::string& camera) {
  TumSequence::Settings settings;
  if (!camera.empty()) settings.camera = camera_from(camera);
  TumSequence sequence(folder, settings);
  if (!sequence.camera()) {
    const std::string hint = hinted_camera(fs::absolute(folder).lexically_normal().string());
    throw Error("sequence " + folder.string() +
                ": has no camera.yaml; say which camera took it: --camera fr1, fr2, fr3, bonn or "
                "an ORB-SLAM style YAML file" +
                (hint.empty() ? "" : " (its name speaks of --camera " + hint + ")"));
  }
  return sequence;
}

void choose_segmenter(RunSettings& settings) {
  const fs::path masks = settings.sequence / "masks";
  if (settings.segmenter.empty())
    settings.segmenter = !settings.masks.empty() || fs::is_directory(masks) ? "mask_files" : "none";
  if (settings.segmenter == "mask_files" && settings.masks.empty()) settings.masks = masks;
  if (settings.segmenter != "mask_files" && !settings.masks.empty())
    throw Error("--masks: only the segmenter mask_files reads masks, found --segmenter " +
                settings.segmenter);
}

std::unique_ptr<Segmenter> make_segmenter(const RunSettings& settings,
                                          const TumSequence& sequence) {
  if (settings.segmenter == "none") return nullptr;
  if (settings.segmenter == "mask_files")
    return std::make_unique<MaskFilesSegmenter>(settings.masks, frame_names(sequence));
  throw Error("--segmenter: expected one of " + joined(segmenter_names()) + ", found \"" +
              settings.segmenter + "\"");
}

std::unique_ptr<Tracker> make_tracker(const RunSettings& settings, const Camera& camera) {
  if (settings.tracker == "slam") {
    // Not threaded: the same input gives the same trajectory, which tables need.
    rgbd_slam::SlamSystem::Settings slam;
    if (settings.features > 0) slam.features.features = settings.features;
    return std::make_unique<rgbd_slam::SlamSystem>(camera, slam);
  }
  if (settings.tracker == "vo") {
    rgbd_slam::RgbdOdometry::Settings vo;
    if (settings.features > 0) vo.features.features = settings.features;
    return std::make_unique<rgbd_slam::RgbdOdometry>(camera, vo);
  }
  throw Error("--tracker: expected one of " + joined(tracker_names()) + ", found \"" +
              settings.tracker + "\"");
}

FrontEndSettings front_end_settings(const RunSettings& settings) {
  FrontEndSettings front_end = settings.preset == "paper"    ? FrontEndSettings::paper()
                               : settings.preset == "motion" ? FrontEndSettings::with_motion()
                                                             : FrontEndSettings();
  for (const std::string& stage : settings.without) {
    if (stage == "compensation") front_end.use_compensation = false;
    if (stage == "depth") front_end.use_depth = false;
    if (stage == "probability") front_end.use_probability = false;
    if (stage == "motion") front_end.use_motion = false;
  }
  front_end.depth.seed += settings.seed;
  return front_end;
}

}  // namespace stillpoint::cli
