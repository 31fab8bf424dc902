// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <vector>

#include "run_job.hpp"
#include "stillpoint/core/camera.hpp"
#include "stillpoint/front_end_settings.hpp"

namespace stillpoint::cli {

// Parts of stats.json (see run_job.cpp).

/// What was asked for, and all settings of the front end as used.
nlohmann::ordered_json settings_json(const RunSettings& settings,
                                     const FrontEndSettings& front_end);

nlohmann::ordered_json camera_json(const Camera& camera);

/// How far the room and the people move during a frame's exposure, from a synthetic sequence's
/// blur.csv (lines TIMESTAMP,LABEL,PIXELS,BLUR_PX; label 0: the room, 1 to 100: people).
void add_true_blur(nlohmann::ordered_json& series, const std::filesystem::path& file,
                   const std::vector<double>& frames);

}  // namespace stillpoint::cli
