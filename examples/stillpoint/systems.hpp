// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "run_job.hpp"
#include "stillpoint/core/camera.hpp"
#include "stillpoint/front_end.hpp"
#include "stillpoint/io/tum_sequence.hpp"
#include "stillpoint/segmentation/segmenter.hpp"
#include "stillpoint/tracking/tracker.hpp"

namespace stillpoint::cli {

// From what the user wrote to the objects that do the work. All throw Error listing the choices.

/// Opens the sequence with the camera that was named, or its own camera.yaml. Without depth, where
/// that is not required, it may have none.
TumSequence open_sequence(const std::filesystem::path& folder, const std::string& camera,
                          bool depth_required = true);

/// What a user must know of an opened sequence: frames of its lists that are left out, a camera
/// that cannot be its own.
std::vector<std::string> sequence_notes(const TumSequence& sequence);

/// Masks are named after their images: two images of one name would share a mask. Throws Error.
void check_names_differ(const TumSequence& sequence);

/// Reads the settings file, if one is given.
void load_settings(RunSettings& settings);

/// Fills in segmenter and masks where the user left them open.
void choose_segmenter(RunSettings& settings);

/// Null for "none".
std::unique_ptr<Segmenter> make_segmenter(const RunSettings& settings, const TumSequence& sequence);

/// The segmenter as --async or --latency wants it: in a thread, or as late as if it were slow.
std::unique_ptr<Segmenter> make_late(const RunSettings& settings,
                                     std::unique_ptr<Segmenter> segmenter);

/// Dynamic classes from "person" or "chair=0.5".
std::vector<DynamicClass> dynamic_classes(const RunSettings& settings);

std::unique_ptr<Tracker> make_tracker(const RunSettings& settings, const Camera& camera);

/// What stats.json says of the tracker: loops_closed, keyframes, map_points; null if it keeps none.
nlohmann::ordered_json tracker_json(const Tracker& tracker);

/// The preset with what was changed and left out; the seed is added to those of the preset.
FrontEndSettings front_end_settings(const RunSettings& settings);

}  // namespace stillpoint::cli
