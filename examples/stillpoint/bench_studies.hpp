// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <nlohmann/json.hpp>
#include <vector>

#include "charts.hpp"

namespace stillpoint::cli {

/// Error, and what is kept and removed of the keypoints of the whole image, against each setting
/// that was varied (with dilation_px: the paper's Fig. 12): one line per sequence of `rows`, with
/// its name if there are more. Empty if no setting has two values.
std::vector<LineChart> setting_charts(const nlohmann::ordered_json& rows);

/// The blur study: mask IoU, missed pixels and error of all frames of all results against the true
/// motion during the exposure (where blur.csv tells it) and against sharpness; and, for sequences
/// that differ in their shutter only (names end in _NNms), error against the shutter. Empty without
/// masks_gt, or with too few frames.
std::vector<LineChart> blur_charts(const nlohmann::ordered_json& rows,
                                   const std::vector<nlohmann::ordered_json>& results);

}  // namespace stillpoint::cli
