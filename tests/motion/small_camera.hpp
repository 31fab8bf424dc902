// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "stillpoint/core/camera.hpp"

namespace stillpoint {

constexpr int kWidth = 320, kHeight = 240;

/// The camera of the motion tests, 320 x 240.
inline Camera small_camera() {
  Camera camera;
  camera.fx = camera.fy = 260;
  camera.cx = 159.5, camera.cy = 119.5;
  camera.width = kWidth, camera.height = kHeight;
  return camera;
}

}  // namespace stillpoint
