// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "stillpoint/core/camera.hpp"

/// The camera, with nothing said of its images' size: takes frames of any.
inline stillpoint::Camera of_any_size(stillpoint::Camera camera) {
  camera.width = camera.height = 0;
  return camera;
}
