// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <pybind11/pybind11.h>

#include <optional>

#include "calls.hpp"
#include "stillpoint/front_end.hpp"

namespace stillpoint::python {

/// The front end behind stillpoint.FrontEnd.
struct PyFrontEnd {
  PyFrontEnd(const FrontEndSettings& settings, const Camera& camera, Segmenter* segmenter)
      : has_segmenter(segmenter != nullptr),
        depth_units_per_m(camera.valid() ? camera.depth_units_per_m : 0),
        front_end(settings, camera, segmenter) {}

  OneAtATime gate{"FrontEnd"};
  bool has_segmenter;
  double depth_units_per_m;  // 0: not known
  FrontEnd front_end;
};

}  // namespace stillpoint::python
