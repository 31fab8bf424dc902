// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace stillpoint::cli {

/// Error, and what is kept and removed of the keypoints of the whole picture, against each setting
/// that was varied (with dilation_px: the paper's Fig. 12), as <svg> elements: one line per
/// sequence of `rows`, with its name if there are more. Empty if no setting has two values.
std::string setting_plots(const std::vector<const nlohmann::ordered_json*>& rows);

/// The same as one picture (an SVG file), or empty.
std::string setting_picture(const nlohmann::ordered_json& rows);

/// The blur study as <svg> elements: mask IoU, missed pixels and error of all frames of all results
/// against the true motion during the exposure (where blur.csv tells it) and against sharpness;
/// and, for sequences that differ in their shutter only (names end in _NNms), error against the
/// shutter. Empty without masks_gt, or with too few frames.
std::string blur_plots(const nlohmann::ordered_json& rows,
                       const std::vector<nlohmann::ordered_json>& results);

/// The same as one picture (an SVG file); empty unless there are sequences of two shutters.
std::string blur_picture(const nlohmann::ordered_json& rows,
                         const std::vector<nlohmann::ordered_json>& results);

}  // namespace stillpoint::cli
