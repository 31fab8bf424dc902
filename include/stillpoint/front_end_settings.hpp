// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <string>
#include <vector>

#include "stillpoint/core/error.hpp"
#include "stillpoint/depth/depth_mask_fuser_settings.hpp"
#include "stillpoint/keypoints/keypoint_filter_settings.hpp"
#include "stillpoint/motion/blur_meter_settings.hpp"
#include "stillpoint/motion/ego_motion_settings.hpp"
#include "stillpoint/motion/motion_check_settings.hpp"
#include "stillpoint/objects/object_tracker_settings.hpp"
#include "stillpoint/segmentation/dynamic_class.hpp"
#include "stillpoint/segmentation/late_segmentation_settings.hpp"
#include "stillpoint/segmentation/segmentation_compensator_settings.hpp"
#include "stillpoint/sensor/sensor_model.hpp"

namespace stillpoint {

/// Settings of FrontEnd: those of its components, and which of them run (the paper's ablation). As
/// they stand they are the preset that docs/results.md recommends; network_only() and paper() are
/// the others.
struct FrontEndSettings {
  SegmentationCompensatorSettings compensation;
  DepthMaskFuserSettings depth;
  KeypointFilterSettings probability;
  MotionCheckSettings motion;
  EgoMotionSettings ego;
  LateSegmentationSettings late;
  BlurMeterSettings blur;
  ObjectTrackerSettings objects;
  /// What the camera's measurements are worth.
  SensorModel sensor;
  bool use_compensation = true;
  bool use_depth = true;
  bool use_probability = true;
  /// Beyond the paper: find what moves though no segmenter names it. Needs depth (without, it does
  /// nothing); better with a host that calls correct_pose().
  bool use_motion = true;
  /// Instances of other classes are taken for static. Objects without a class are always dynamic.
  std::vector<DynamicClass> dynamic_classes{"person"};
  /// A mask over this share of the image is reported as kMaskTooLarge (and still used: the floor
  /// of kept keypoints protects the tracker).
  double large_mask_share = 0.9;

  /// Without the motion check and the images' own motion, with coarser cells and the same dilation
  /// for all: what no segmenter names is static. The least time per frame.
  static FrontEndSettings network_only() {
    FrontEndSettings settings;
    settings.depth.cell_px = 6;
    settings.depth.dilation_per_blur_px = 0;
    settings.use_motion = false;
    return settings;
  }

  /// The literal method of the paper, for ablation and reproduction.
  static FrontEndSettings paper() {
    FrontEndSettings settings;
    settings.compensation = SegmentationCompensatorSettings::paper();
    settings.depth = DepthMaskFuserSettings::paper();
    settings.probability = KeypointFilterSettings::paper();
    settings.use_motion = false;
    return settings;
  }

  /// A preset by its name: "default", "network_only" or "paper". Throws Error for another.
  static FrontEndSettings preset(const std::string& name) {
    if (name == "default") return {};
    if (name == "network_only") return network_only();
    if (name == "paper") return paper();
    throw Error("preset: expected default, network_only or paper, found \"" + name + "\"");
  }

  /// Throws Error if a setting that is none of its components' makes no sense.
  void check() const {
    if (!(large_mask_share >= 0 && large_mask_share <= 1))
      throw Error("FrontEndSettings.large_mask_share: expected 0 to 1, found " +
                  std::to_string(large_mask_share));
  }

  [[deprecated("the default has the motion check: FrontEndSettings{}")]] static FrontEndSettings
  with_motion() {
    return {};
  }
};

}  // namespace stillpoint
