// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "stillpoint/core/colored_point.hpp"

namespace stillpoint::cli {

/// Where an image of a map is taken from. The map's world is the first camera: x right, y down,
/// z forward.
enum class MapViewpoint {
  kBehind,  ///< behind and above the first camera, looking the way it looked
  kAbove    ///< from the ceiling straight down, without what lies above the camera's head
};

/// Draws a point cloud as an image, CV_8UC3: each point a dot that grows with nearness. O(points).
cv::Mat draw_map(const std::vector<ColoredPoint>& points, MapViewpoint viewpoint, cv::Size size);

}  // namespace stillpoint::cli
