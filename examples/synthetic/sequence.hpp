// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <opencv2/core.hpp>

#include "stillpoint/core/camera.hpp"
#include "stillpoint/core/frame.hpp"
#include "stillpoint/testing/degraded_masks.hpp"
#include "synthetic/camera.hpp"
#include "synthetic/movers.hpp"
#include "synthetic/people.hpp"
#include "synthetic/rasterizer.hpp"
#include "synthetic/room.hpp"
#include "synthetic/settings.hpp"

namespace stillpoint {

/// A deterministic RGB-D sequence with known poses, labels and blur. Each frame depends on the
/// settings and its number alone: frames may be rendered in any order and in many threads.
///
///     SyntheticSettings settings;
///     settings.motion = synthetic_motion("rpy");
///     const SyntheticSequence sequence(settings);
///     SyntheticFrame frame = sequence.frame(17);
class SyntheticSequence {
 public:
  /// Builds the room, paints the textures and makes the light: under a second, about 40 MB. Throws
  /// Error for settings out of range.
  explicit SyntheticSequence(const SyntheticSettings& settings);

  /// The settings, with the number of frames filled in.
  const SyntheticSettings& settings() const { return settings_; }
  const Camera& camera() const { return camera_; }
  int frame_count() const { return settings_.frames; }

  /// Time of a frame since the first, rounded to microseconds.
  double seconds(int index) const { return std::floor(1e6 * index / settings_.fps + 0.5) * 1e-6; }
  /// Mid-exposure timestamp of a frame.
  double timestamp(int index) const { return settings_.start_s + seconds(index); }
  /// Pose at `t_s` seconds after the first frame.
  Eigen::Isometry3d T_world_camera(double t_s) const {
    return synthetic::to_isometry(path_.at(t_s));
  }

  /// Renders a frame: about 0.1 s at 640 x 480, more the more it is blurred. Throws Error for a
  /// number out of range. Safe from several threads.
  SyntheticFrame frame(int index) const;

  /// What a camera gives of a rendered frame, none of its truth. Refers to its images.
  RgbdFrame rgbd(const SyntheticFrame& frame) const {
    RgbdFrame rgbd{frame.color, frame.depth, frame.timestamp};
    rgbd.depth_units_per_m = camera_.depth_units_per_m;
    return rgbd;
  }

  /// How far the parts of a person move across the image during the exposure of a frame, mean
  /// in pixels, whether in view or not; without rendering. The same for a mover's label.
  double expected_blur_px(int label, int index) const;

  /// Middle of a person's body, or of a mover's round parts, in the world at `t_s` seconds after
  /// the first frame, metres: the mean of its parts by the area that they show. NaN for no such
  /// label.
  Eigen::Vector3d center_m(int label, double t_s) const;

 private:
  /// Whether the view moves to the left in the first seconds: the nearest people then walk to the
  /// left too, as if followed, which is what a static SLAM withstands least.
  bool pans_left() const;
  synthetic::MovingThings things(double t_s) const;
  /// Moving things and camera at one instant.
  struct Instant {
    synthetic::MovingThings things;
    synthetic::Frame camera;
  };
  Instant instant(double t_s) const { return {things(t_s), path_.at(t_s)}; }

  /// The image's point of a world point, false when behind the camera.
  bool project(const synthetic::Frame& frame, synthetic::Vec3 p, double& x, double& y) const;
  double displacement_px(const Instant& open, synthetic::Vec3 at_open, const Instant& close,
                         synthetic::Vec3 at_close) const;
  /// The same of a point `p` of surface `id`, during the exposure.
  double exposure_displacement_px(const synthetic::Rasterizer& raster, int id, synthetic::Vec3 p,
                                  const Instant& middle, const Instant& open,
                                  const Instant& close) const;
  /// Fills depth, labels, limbs; gives the way of each pixel of a coarse grid.
  double look(const synthetic::Rasterizer& raster, const Instant& middle, const Instant& open,
              const Instant& close, SyntheticFrame& frame, cv::Mat& hole_prone) const;
  void expose(synthetic::Rasterizer& raster, double t_s, double longest_px, std::uint64_t seed,
              cv::Mat& color) const;

  SyntheticSettings settings_;
  Camera camera_;
  synthetic::CameraPath path_;
  synthetic::StaticScene scene_;
  synthetic::RoomPlan plan_;
  synthetic::People people_;
  synthetic::Movers movers_;
};

/// The masks of a frame as a blur-stricken segmenter gives them (degrade_masks), coded as
/// `frame.labels`; `index` is the frame's number. The same for the same seed.
cv::Mat degraded_masks(const SyntheticSequence& sequence, const SyntheticFrame& frame, int index,
                       const MaskDamage& damage = MaskDamage());

}  // namespace stillpoint
