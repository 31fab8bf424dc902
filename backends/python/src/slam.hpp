// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#ifdef STILLPOINT_WITH_RGBD_SLAM

#include <pybind11/pybind11.h>

#include <future>

#include "calls.hpp"
#include "stillpoint/backends/rgbd_slam/slam_system.hpp"

namespace stillpoint::python {

/// The system behind stillpoint.SlamSystem.
struct PySlam {
  PySlam(const Camera& camera, const rgbd_slam::SlamSystem::Settings& settings)
      : slam(camera, settings) {}
  ~PySlam() {
    const pybind11::gil_scoped_release release;
    if (finishing.valid()) finishing.wait();
  }

  /// One call at a time, after what an interrupted finish() still does.
  class Use {
   public:
    explicit Use(PySlam& s) : use_(s.gate) {
      if (!s.finishing.valid()) return;
      const pybind11::gil_scoped_release release;
      s.finishing.get();
    }

   private:
    OneAtATime::Use use_;
  };

  OneAtATime gate{"SlamSystem"};
  rgbd_slam::SlamSystem slam;
  std::future<void> finishing;  // what a Ctrl-C left behind
};

}  // namespace stillpoint::python

#endif
