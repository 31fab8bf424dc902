// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <cstdint>
#include <limits>
#include <opencv2/core.hpp>
#include <optional>

#include "stillpoint/core/error.hpp"
#include "stillpoint/core/frame_context.hpp"
#include "stillpoint/core/rigid_motion.hpp"
#include "stillpoint/core/status.hpp"
#include "stillpoint/motion/camera_motion.hpp"
#include "stillpoint/motion/ego_motion_settings.hpp"
#include "stillpoint/sensor/sensor_model.hpp"

namespace stillpoint {

/// The camera's motion, and the one place that knows it: the images' own (CameraMotion), the host's
/// prediction, and the pose that the host tracked in the end; gaps, cuts and jumps.
///
/// The images' own motion is taken where they show enough, else the host's prediction. The pose
/// that the host tracked (correct()) is better and taken afterwards, unless it is a jump, or the
/// images speak against it: a tracker that went with a person close by is not followed. What is not
/// finite or no rigid motion is refused, and status() says so; it changes nothing. So is a
/// prediction of metres (in millimetres, say) between images that show the same.
///
/// Where depth comes less often than color, corners are followed from depth image to depth image.
/// In a frame between them the camera goes on as before, unless the host predicts its motion.
///
/// Poses have an origin of their own. They hang together from frame to frame as long as each motion
/// is known; where one is not, chain() changes. Not thread-safe; one object per camera.
class EgoMotion {
 public:
  using Settings = EgoMotionSettings;

  explicit EgoMotion(const Settings& settings = {}, const SensorModel& sensor = {})
      : settings_(settings), camera_motion_(sensor) {
    settings.check();
    sensor.check();
  }

  const Settings& settings() const { return settings_; }

  /// Takes the next frame, and writes the camera's motion to it, if it is known, into the context.
  /// `host` is the host's prediction: it maps points of the last frame's camera into this one's.
  /// O(pixels) where it measures, else O(1).
  void track(FrameContext& context, const std::optional<Eigen::Isometry3d>& host) {
    status_ = kOk;
    const double now_s = context.frame.timestamp;
    detail::check_time_is_set(last_s_, now_s);
    if (now_s <= last_s_) {
      reset();
      status_ |= kTimestampOrder;
    }
    const double step_s = now_s - last_s_;
    last_s_ = now_s;
    std::optional<Eigen::Isometry3d> steady;
    if (motion_) steady = moved(step_s).inverse();
    extend_gap();
    last_host_pose_ = host_pose_;
    host_pose_.reset();
    predicted_.reset();
    if (host) {
      if (detail::is_rigid(*host))
        predicted_ = host;
      else
        status_ |= kPoseRefused;
    }
    const bool leaps = predicted_ && is_cut(*predicted_);
    if (leaps) predicted_.reset(), steady.reset();
    between_ = settings_.measure && context.depth.measured_share() < kLeastMeasured;
    measured_ = measure(context);
    if (leaps) {
      if (measured_ && measured_->support > kSure)
        status_ |= kPoseRefused;
      else
        cut();
    }
    tracked_ = predicted_;
    if (measured_) tracked_ = measured_->T_current_last * gap_.inverse();
    if (tracked_ && is_cut(*tracked_)) cut();
    const bool bridged = between_ && gap_s_ + step_s < kLongestGapS;
    if (between_ && !bridged) camera_motion_.reset();
    motion_ = bridged && !tracked_ ? steady : tracked_;
    before_ = T_world_camera_;
    step_s_ = step_s;
    apply();
    context.T_current_last = motion_;
  }

  /// Tells the pose that the host tracked for the last frame, in the host's own world. Of several
  /// for one frame the last counts.
  void correct(const Eigen::Isometry3d& T_world_camera) {
    if (!detail::is_rigid(T_world_camera)) {
      status_ |= kPoseRefused;
      return;
    }
    if (last_host_pose_) {
      const Eigen::Isometry3d T_current_last = T_world_camera.inverse() * *last_host_pose_;
      if (!is_jump(T_current_last) && trusts(T_current_last)) {
        const bool first = !motion_;
        motion_ = T_current_last;
        if (first) --chain_;  // the gap is bridged
        apply();
      }
    }
    host_pose_ = T_world_camera;
    T_host_world_ = T_world_camera * T_world_camera_.inverse();
    host_chain_ = chain_;
  }

  /// Tells what was taken for dynamic in the last frame, CV_8UC1 of its size.
  void remember(const cv::Mat& dynamic) {
    if (settings_.measure && !between_) camera_motion_.remember_dynamic(dynamic);
  }

  /// Maps points of the camera before the last frame into the last frame's; empty: not known.
  const std::optional<Eigen::Isometry3d>& motion() const { return motion_; }
  /// The same from the last camera before it that had depth.
  std::optional<Eigen::Isometry3d> motion_from_depth() const {
    return motion_ ? std::optional<Eigen::Isometry3d>(*motion_ * gap_) : std::nullopt;
  }
  /// The images' own motion from depth to depth, if the last frame has one.
  const std::optional<CameraMotion::Estimate>& measured() const { return measured_; }
  /// The host's prediction of it, if there is one that the images do not speak against.
  std::optional<Eigen::Isometry3d> trusted_prediction() const {
    if (!predicted_ || !trusts(*predicted_)) return std::nullopt;
    return *predicted_ * gap_;
  }
  CameraMotion& images() { return camera_motion_; }
  /// The last frame has too little depth: corners are followed from the one before to the next.
  bool between() const { return between_; }

  /// Where the camera was at the last frame.
  const Eigen::Isometry3d& pose() const { return T_world_camera_; }
  /// Where it was, or will be, a moment from the last frame, at the velocity of its last motion.
  Eigen::Isometry3d pose_at(double timestamp) const {
    const double seconds = timestamp - last_s_;
    if (seconds == 0 || !motion_) return T_world_camera_;
    return T_world_camera_ * moved(seconds);
  }
  /// The camera's rotation per second about its own axes, rad/s; 0 where it is not known.
  Eigen::Vector3d angular_velocity() const {
    const double seconds = span_s();
    if (!motion_ || !(seconds > 0 && std::isfinite(seconds))) return Eigen::Vector3d::Zero();
    return detail::rotation_vector(span().linear()) / -seconds;
  }
  /// Its speed, m/s; 0 where it is not known.
  double speed_m_s() const {
    const double seconds = span_s();
    return motion_ && seconds > 0 && std::isfinite(seconds) ? span().translation().norm() / seconds
                                                            : 0;
  }
  /// Maps the world of these poses into the host's, by the last pose that the host told; empty:
  /// nothing is known of it.
  std::optional<Eigen::Isometry3d> T_host_world() const {
    return host_chain_ == chain_ ? T_host_world_ : std::nullopt;
  }
  /// Poses hang together as long as this number is the same.
  int chain() const { return chain_; }
  /// kPoseRefused, kTimestampOrder or kOk, of the last frame.
  std::uint32_t status() const { return status_; }

  /// Forgets everything (a cut in the sequence).
  void reset() {
    cut();
    camera_motion_.reset();
    between_ = false;
    last_s_ = -std::numeric_limits<double>::infinity();
  }

 private:
  // With less depth, as of a sensor that fails, corners are followed past the frame.
  static constexpr double kLeastMeasured = 0.02;
  // Images that show so much of the same belong together, whatever the host predicts.
  static constexpr double kSure = 0.5;
  // From depth to depth: 5 Hz are bridged. Corners of longer ago are not found again.
  static constexpr double kLongestGapS = 0.25;

  // Where its images show the same, a motion of the host's is as good as theirs or better.
  bool trusts(const Eigen::Isometry3d& T_current_last) const {
    return !measured_ ||
           camera_motion_.support(T_current_last * gap_) > measured_->support - settings_.max_doubt;
  }

  bool is_cut(const Eigen::Isometry3d& T) const {
    return !(T.translation().norm() < settings_.max_step_m &&
             detail::rotation_angle(T.linear()) * 180 / CV_PI < settings_.max_rotation_deg);
  }

  bool is_jump(const Eigen::Isometry3d& T_current_last) const {
    if (!tracked_) return is_cut(T_current_last);
    const Eigen::Isometry3d off = T_current_last * tracked_->inverse();
    return !(off.translation().norm() < settings_.jump_m &&
             detail::rotation_angle(off.linear()) < settings_.jump_rad);
  }

  // What the velocity is taken from: a measured motion, or the host's.
  Eigen::Isometry3d span() const { return measured_ ? *motion_ * gap_ : *motion_; }
  double span_s() const { return measured_ ? step_s_ + gap_s_ : step_s_; }

  // Where the camera will be in the last one's frame, at the velocity of the last motion.
  Eigen::Isometry3d moved(double seconds) const {
    Eigen::Isometry3d ahead = Eigen::Isometry3d::Identity();
    ahead.linear() = detail::rotation_matrix(angular_velocity() * seconds);
    ahead.translation() = span().inverse().translation() * (seconds / span_s());
    return ahead;
  }

  // To be called before the last motion is replaced by the next one.
  void extend_gap() {
    if (!between_) {
      gap_ = Eigen::Isometry3d::Identity();
      gap_s_ = 0;
      return;
    }
    if (motion_) gap_ = *motion_ * gap_;
    gap_s_ += step_s_;
  }

  std::optional<CameraMotion::Estimate> measure(const FrameContext& context) {
    if (!settings_.measure || between_) return std::nullopt;
    const Eigen::Isometry3d guess = predicted_ ? *predicted_
                                    : motion_  ? *motion_
                                               : Eigen::Isometry3d::Identity();
    return camera_motion_.add(context, guess * gap_);
  }

  void apply() {
    if (!motion_) {
      ++chain_;
      return;
    }
    T_world_camera_ = before_ * motion_->inverse();
    detail::normalize_rotation(T_world_camera_);
  }

  void cut() {
    ++chain_;
    motion_.reset();
    tracked_.reset();
    host_pose_.reset();
    last_host_pose_.reset();
  }

  Settings settings_;
  CameraMotion camera_motion_;
  std::optional<CameraMotion::Estimate> measured_;
  std::optional<Eigen::Isometry3d> predicted_;                // by the host
  std::optional<Eigen::Isometry3d> motion_;                   // to the last frame
  std::optional<Eigen::Isometry3d> tracked_;                  // the same before correct()
  std::optional<Eigen::Isometry3d> host_pose_;                // of the last frame
  std::optional<Eigen::Isometry3d> last_host_pose_;           // of the frame before
  Eigen::Isometry3d before_ = Eigen::Isometry3d::Identity();  // pose of the frame before the last
  Eigen::Isometry3d T_world_camera_ = Eigen::Isometry3d::Identity();
  double last_s_ = -std::numeric_limits<double>::infinity();
  double step_s_ = 0;     // to the last frame from the one before
  bool between_ = false;  // the last frame has hardly any depth, and is to be measured
  // From the last camera that had depth, before the last frame, to the frame before the last.
  Eigen::Isometry3d gap_ = Eigen::Isometry3d::Identity();
  double gap_s_ = 0;
  std::optional<Eigen::Isometry3d> T_host_world_;
  int chain_ = 0, host_chain_ = 0;  // of T_host_world_
  std::uint32_t status_ = kOk;
};

}  // namespace stillpoint
