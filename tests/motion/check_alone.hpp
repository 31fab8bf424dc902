// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "stillpoint/motion/ego_motion.hpp"
#include "stillpoint/motion/motion_check.hpp"

namespace stillpoint {

/// The motion check with what the front end brings it.
struct CheckAlone {
  explicit CheckAlone(const Camera& the_camera, const SensorModel& sensor = SensorModel::exact(),
                      const MotionCheckSettings& settings = {})
      : camera(the_camera), check(settings, sensor) {}

  const std::vector<Instance>& find(const RgbdFrame& frame,
                                    const std::optional<Eigen::Isometry3d>& T_current_last) {
    context.begin(frame, camera);
    ego.track(context, T_current_last);
    return check.find(context, ego);
  }
  void correct(const Eigen::Isometry3d& T_world_camera) {
    ego.correct(T_world_camera);
    check.correct(ego);
  }
  void remember(const cv::Mat& dynamic) {
    check.remember(dynamic);
    ego.remember(dynamic);
  }

  Camera camera;
  FrameContext context;
  EgoMotion ego;
  MotionCheck check;
};

}  // namespace stillpoint
