// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <limits>
#include <string>

#include "stillpoint/core/blur.hpp"
#include "stillpoint/core/status.hpp"

namespace stillpoint {

/// What the front end did with one frame.
struct FrameStats {
  double timestamp = 0;
  /// FrameStatus bits.
  std::uint32_t status = kOk;
  /// Message of the exception that the segmenter threw; empty if it did not.
  std::string segmenter_error;
  /// The image's motion blur; that of each object is in FrontEnd::instances(). Measuring it is
  /// counted with the compensation.
  Blur blur;
  double segmentation_ms = 0, motion_ms = 0, compensation_ms = 0, depth_ms = 0, probability_ms = 0;
  /// Instances after compensation, movers too, and how many of them were restored.
  int instances = 0, restored = 0;
  /// Instances that the motion check found.
  int moving = 0;
  /// Share of the image in the final mask, 0 to 1.
  double mask_share = 0;
  /// Age of the newest segmentation in the mask, seconds.
  double mask_age_s = 0;
  /// How long after its stamp the depth is taken, seconds, as frames in which the camera rotates
  /// tell the motion check; NaN: not known (yet).
  double depth_delay_s = std::numeric_limits<double>::quiet_NaN();
  /// How long it takes to read the depth out, from the first to the last row (negative: from
  /// below), seconds, found in the same way; NaN: not known (yet).
  double depth_readout_s = std::numeric_limits<double>::quiet_NaN();
  int keypoints = 0, kept = 0;
};

}  // namespace stillpoint
