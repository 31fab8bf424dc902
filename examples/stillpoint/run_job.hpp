// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "settings_file.hpp"

namespace stillpoint::cli {

/// Everything that decides what a run computes.
struct RunSettings {
  std::filesystem::path sequence;
  /// fr1, fr2, fr3, bonn or a YAML file; empty: SEQUENCE/camera.yaml.
  std::string camera;
  /// Empty: mask_files if the masks' folder exists, else none.
  std::string segmenter;
  /// Of mask_files; empty: SEQUENCE/masks.
  std::filesystem::path masks;
  /// Network of opencv_dnn or torchscript, its graph's text file (if it has one), its decoder
  /// (empty: recognised), and its input size WIDTHxHEIGHT (empty: the model's own).
  std::filesystem::path model, model_config;
  std::string decoder, input_size;
  /// Dynamic classes, NAME or NAME=PRIOR; empty: person.
  std::vector<std::string> dynamic;
  /// The segmenter beside the camera, at the speed of the recording.
  bool async = false;
  /// Frames come at the recording's own pace, and those that come too late are dropped; the tracker
  /// slam maps in threads of its own.
  bool real_time_rate = false;
  /// As if the segmenter took so long per frame; negative: as fast as it is.
  double latency_ms = -1;
  std::string preset = "default";
  bool front_end = true;
  /// Stages left out: compensation, depth, probability, motion, prediction (of late masks),
  /// loop_closing (of the tracker slam).
  std::vector<std::string> without;
  std::string tracker = "slam";
  /// ORB keypoints per frame; 0: the tracker's default.
  int features = 0;
  /// First frames only; 0: all.
  std::size_t frames = 0;
  /// The sensor's model (see sensor_names()); empty: the preset's.
  std::string sensor;
  /// Settings of the preset changed: a file's (see load_settings()), then by NAME=VALUE.
  std::filesystem::path settings_file;
  SettingsFile from_file;
  std::vector<std::string> changed;
  /// One more setting changed (see set_setting()); empty: none.
  std::string varied;
  double varied_value = 0;
  /// 0: the presets' own seeds; any other value is added to them, and a hundredth of the kept
  /// keypoints is left out (see ThinnedTracker).
  std::uint64_t seed = 0;
  /// What the ground truth's poses are of: "camera", or "body" (see camera_of_bonn_body()).
  std::string groundtruth_of = "camera";
};

/// What a run writes; an empty path or zero: not at all.
struct RunOutputs {
  /// trajectory.txt (TUM format): the poses as the whole map knows them in the end; and as track()
  /// returned them, which is what a robot acts on.
  std::filesystem::path trajectory, trajectory_online;
  /// The camera's ground truth, where groundtruth_of is "body".
  std::filesystem::path groundtruth;
  /// Writes what was tracked also when the run breaks off.
  bool keep_unfinished = false;
  std::filesystem::path map_ply, masks_dir, keypoints_csv, overlays_dir;
  /// The objects of each frame (see io/objects_file.hpp).
  std::filesystem::path objects_csv;
  /// Two small images of the map: behind.jpg and above.jpg.
  std::filesystem::path map_views_dir;
  /// An overlay of every n-th frame, or of those whose stems are listed.
  std::size_t overlay_every = 0;
  std::vector<std::string> overlay_stems;
  /// Overlays as small JPEGs (for a page) and not as PNGs.
  bool overlays_jpeg = false;
  /// The frames whose masks differ most from masks_gt, stage by stage, and how many of them.
  std::filesystem::path worst_dir;
  std::size_t worst = 0;
  /// Adds "series" to the result: error, mask share and blur per frame, and the aligned paths.
  bool series = false;
};

/// Runs the whole system over a sequence. Returns what stats.json holds (its fields are described
/// in run_job.cpp). `progress(done, total)` is called after each frame, `note(text)` as soon as
/// there is something that the user should know (also in stats["notes"]). Throws Error for bad
/// input.
nlohmann::ordered_json run_job(
    const RunSettings& settings, const RunOutputs& outputs,
    const std::function<void(std::size_t done, std::size_t total)>& progress,
    const std::function<void(const std::string& note)>& note = [](const std::string&) {});

/// Names that --segmenter and --tracker take in this build.
std::vector<std::string> segmenter_names();
std::vector<std::string> tracker_names();
std::string default_tracker();

/// The lines that `stillpoint run` prints of a result.
std::string summary_text(const nlohmann::ordered_json& stats);

}  // namespace stillpoint::cli
