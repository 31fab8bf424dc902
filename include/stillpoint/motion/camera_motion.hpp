// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <optional>
#include <utility>
#include <vector>

#include "stillpoint/core/depth_view.hpp"
#include "stillpoint/core/frame_context.hpp"
#include "stillpoint/core/rigid_motion.hpp"
#include "stillpoint/motion/corner_image.hpp"
#include "stillpoint/motion/flow_consensus.hpp"
#include "stillpoint/motion/outlier_clusters.hpp"
#include "stillpoint/motion/patch_shift.hpp"
#include "stillpoint/motion/rotation_alignment.hpp"
#include "stillpoint/sensor/sensor_model.hpp"

namespace stillpoint {

/// The camera's motion from one frame to the next, from the frames themselves: corners are followed
/// and the rigid motion is taken that most of the world agrees with.
///
/// A corner counts by the area that it stands for in space, not in the image: a person close by
/// may fill half of the image, yet the walls behind are ten times as many square metres. So it
/// keeps to the world where a tracker that counts keypoints goes with the person. It drifts by
/// about a millimetre a frame: enough to doubt a host's motion, and for hosts that tell none.
class CameraMotion {
 public:
  struct Estimate {
    /// Maps points of the last frame's camera into the new one's.
    Eigen::Isometry3d T_current_last = Eigen::Isometry3d::Identity();
    /// Share of the followed area that agrees with it, 0 to 1.
    double support = 0;
    /// It was not measured: the camera is taken to go on as before.
    bool assumed = false;
  };

  explicit CameraMotion(const SensorModel& sensor = {}) : sensor_(sensor) {}

  /// Forgets the last frame.
  void reset() {
    for (detail::CornerImage* image : {&last_, &current_})
      image->empty = true, image->corners.clear();
    last_motion_ = Eigen::Isometry3d::Identity();
    moved_ = false;
    usual_support_ = 1;
  }

  /// Takes the next frame, without looking for the motion to it. O(pixels).
  void begin(const FrameContext& context) {
    step_s_ = context.frame.timestamp - last_s_;
    last_s_ = context.frame.timestamp;
    current_.set(context);
    current_.add_far_corners(context.depth, sensor_.max_range_m);
    consensus_.begin(current_);
  }

  /// Takes the next frame and estimates the camera's motion to it. The corners of the frame before
  /// are followed from where `guess` puts them. Where few agree, they are followed once more from
  /// where the whole images fit best, and then less exact agreement will do. No value: too few
  /// corners, or no agreement among them. O(pixels), and about 3 us per corner.
  std::optional<Estimate> add(const FrameContext& context, const Eigen::Isometry3d& guess) {
    std::swap(last_, current_);
    begin(context);
    std::optional<Estimate> found;
    if (!last_.empty && !current_.empty && last_.size() == current_.size()) {
      // Not before it is known which of them are on people: these may have most of the corners.
      last_.keep_strongest(kMostCorners, kMostDynamic);
      if (last_.corners.size() >= detail::FlowConsensus::kMinFlows)
        found = estimate(context.depth, guess);
    }
    moved_ = found && !found->assumed;
    if (found) last_motion_ = found->T_current_last, motion_step_s_ = step_s_;
    return found;
  }

  /// Tells what is dynamic in the last frame, CV_8UC1 of its size: its corners there have no say on
  /// the camera's motion, but are followed, too, as outliers among them show that it still moves.
  void remember_dynamic(const cv::Mat& mask) {
    const int scale = current_.scale;
    for (detail::Corner& c : current_.corners)
      c.dynamic |= mask.at<uchar>(scale * c.y, scale * c.x) != 0;
  }

  /// The same for the corners around one that moves by itself, `reach_m` to the sides and in depth.
  /// O(corners).
  void remember_moving(const OutlierCorner& corner, float reach_m) {
    const float reach_px = reach_m * current_.fx / corner.depth_m;
    for (detail::Corner& c : current_.corners)
      c.dynamic |= std::abs(current_.frame_px(c.x) - corner.u) < reach_px &&
                   std::abs(current_.frame_px(c.y) - corner.v) < reach_px &&
                   std::abs(c.depth_m - corner.depth_m) < reach_m;
  }

  /// Share of the followed area that agrees with a motion.
  double support(const Eigen::Isometry3d& T_current_last) const {
    return consensus_.support(T_current_last);
  }

  /// The corners in clusters that move otherwise than a motion, and another one if there is one,
  /// says (detail::OutlierClusters). `depth`: of the frame last added. O(corners squared).
  const std::vector<OutlierCorner>& outlier_clusters(
      const DepthView& depth, const Eigen::Isometry3d& T_current_last,
      const std::optional<Eigen::Isometry3d>& another, double smeared_share) {
    return outliers_.find(consensus_.flows(), current_, depth, T_current_last, another,
                          smeared_share);
  }

  /// The grey image of the frame last added made small, CV_8UC1; empty: there is none.
  const cv::Mat& small_gray() const { return current_.small_gray(); }

  /// Corners followed from the frame before to the one last added.
  std::size_t followed() const { return consensus_.flows().size(); }

 private:
  using CornerImage = detail::CornerImage;
  using Flow = detail::Flow;

  static constexpr std::size_t kMostCorners = 200, kMostDynamic = 100;
  static constexpr double kMinSupport = 0.3, kUsual = 0.95;
  static constexpr double kSure = 0.5;        // no doubt that the corners were found again
  static constexpr double kPlainShare = 0.4;  // of the best support; see plain_motion()
  static constexpr double kNearPx = 2;        // fine ones: corners are found again from there
  static constexpr int kPartPx = 60;          // fine ones: a fifth of the image's width
  // A motion that is too sudden needs more support than a steady one, by so much.
  static constexpr double kSteadyShare = 0.75;
  static constexpr double kSurelySudden = 0.6;  // with less the steady one is assumed, for a frame
  static constexpr double kMostAcceleration = 15;  // of what a hand or a robot holds, m/s^2

  std::optional<Estimate> estimate(const DepthView& depth, const Eigen::Isometry3d& guess) {
    follow_all(depth, guess);
    const std::optional<Estimate> near_guess = search(guess, last_motion_);
    if (near_guess && near_guess->support > kSure) return near_guess;

    const Eigen::Isometry3d aligned = alignment_.align(last_, current_, guess);
    if (far_px(aligned, guess) > kNearPx) {
      const double agreed = near_guess ? near_guess->support * consensus_.area() : 0;
      std::swap(consensus_, other_consensus_);
      follow_all(depth, aligned);
      const std::optional<Estimate> near_aligned =
          search(aligned, near_guess ? near_guess->T_current_last : last_motion_);
      if (near_aligned && near_aligned->support * consensus_.area() > agreed) return near_aligned;
      if (near_guess) std::swap(consensus_, other_consensus_);
    }
    if (near_guess) return near_guess;
    consensus_.allow_blur();
    return search(aligned, last_motion_);
  }

  // The motion that most of the followed area agrees with, by steps from either of two or anew.
  std::optional<Estimate> search(const Eigen::Isometry3d& guess, const Eigen::Isometry3d& another) {
    Estimate found{guess};
    // As good as it usually gets is enough: no need to look further.
    const double s = consensus_.search(found.T_current_last, another, kUsual * usual_support_);
    if (s < kMinSupport) return std::nullopt;
    found.support = s;
    const bool sure = s >= kSure, sudden = is_sudden(found.T_current_last);
    if (!sure || sudden) {
      const Eigen::Isometry3d steady = moved_ ? steady_motion(found.T_current_last) : guess;
      const Estimate plain = plain_motion(guess, steady);
      if (!is_sudden(plain.T_current_last) &&
          plain.support > (sure ? kSteadyShare : kPlainShare) * s)
        return plain;
      if (sudden && s < kSurelySudden) return Estimate{steady, consensus_.support(steady), true};
    }
    if (!consensus_.allows_blur())
      usual_support_ += (s - usual_support_) * (s > usual_support_ ? 0.5 : 0.1);
    return found;
  }

  // People who fill the image and walk alike agree on a motion, too. Before half of the area is
  // behind one, what was expected, or rest, is more likely where it has some support of its own.
  // Where a wrong motion hardly differs from the true one in the image (rotation and displacement
  // before something close by), the steady one is more likely.
  Estimate plain_motion(const Eigen::Isometry3d& expected, const Eigen::Isometry3d& steady) {
    Estimate best;
    double most = 0;
    for (Eigen::Isometry3d T : {expected, steady, Eigen::Isometry3d::Identity()}) {
      const double support = consensus_.refine(T);
      const double preferred = is_sudden(T) ? kSteadyShare * support : support;
      if (preferred > most) most = preferred, best = {T, support, false};
    }
    return best;
  }

  // The displacement since the last frame at the speed of the one before.
  Eigen::Vector3d steady_translation() const {
    return last_motion_.translation() * (step_s_ / motion_step_s_);
  }

  // Whether it would take a camera that moved as in the last frame too great an acceleration. One
  // that slows down stops as soon as it likes.
  bool is_sudden(const Eigen::Isometry3d& T) const {
    if (!moved_) return false;
    const Eigen::Vector3d steady = steady_translation();
    const double square = steady.squaredNorm();
    const double share =
        square > 0 ? std::clamp(T.translation().dot(steady) / square, 0.0, 1.0) : 0;
    return (T.translation() - share * steady).norm() > kMostAcceleration * step_s_ * step_s_;
  }

  // A motion with that translation that shows most of the world where `T` does.
  Eigen::Isometry3d steady_motion(const Eigen::Isometry3d& T) const {
    double area = 0, area_per_m = 0;
    for (const Flow& f : consensus_.flows()) area += f.area, area_per_m += f.area / f.from.z();
    Eigen::Isometry3d steady = T;
    steady.translation() = steady_translation();
    const Eigen::Vector3d off = (steady.translation() - T.translation()) * (area_per_m / area);
    steady.linear() = detail::rotation_matrix({off.y(), -off.x(), 0}) * T.linear();
    return steady;
  }

  void follow_all(const DepthView& depth, const Eigen::Isometry3d& guess) {
    consensus_.begin(current_);
    corners_in_part_.assign(part({last_.fine.cols, last_.fine.rows}) + 1, 0);
    for (const detail::Corner& c : last_.corners)
      corners_in_part_[part({c.x, c.y})] += c.dynamic ? 0 : 1;
    for (const detail::Corner& c : last_.corners) follow(c, depth, guess);
  }

  // The part of the image that a fine pixel is in.
  std::size_t part(const cv::Point& p) const {
    const int in_a_row = last_.fine.cols / kPartPx + 1;
    return static_cast<std::size_t>(p.y / kPartPx * in_a_row + p.x / kPartPx);
  }

  void follow(const detail::Corner& c, const DepthView& depth, const Eigen::Isometry3d& guess) {
    const int scale = current_.scale;
    const float u0 = current_.frame_px(c.x), v0 = current_.frame_px(c.y);
    Flow f;
    f.x = c.x, f.y = c.y;
    const Lens& lens = depth.lens();
    f.from = c.depth_m * lens.ray(u0, v0).homogeneous();
    const Eigen::Vector3f q = (guess * f.from.cast<double>()).cast<float>();
    if (!(q.z() >= CornerImage::kLeastDepthM)) return;  // NaN, too: the lens cannot see the corner
    const Eigen::Vector2f p = lens.pixel(q.hnormalized());
    float du = p.x() - u0, dv = p.y() - v0;
    if (!detail::shift(last_.coarse, current_.coarse, c.x / 2, c.y / 2, 2 * scale, 0.1f, du, dv,
                       f.information) ||
        !detail::shift(last_.fine, current_.fine, c.x, c.y, scale, 0.02f, du, dv, f.information))
      return;
    f.u = u0 + du, f.v = v0 + dv;
    const Eigen::Vector2f flat = current_.project(lens.ray(f.u, f.v).homogeneous());
    if (!flat.allFinite()) return;  // nor there
    f.flat_u = flat.x(), f.flat_v = flat.y();
    f.area = c.dynamic ? 0 : std::min(c.depth_m, 4.0f) * std::min(c.depth_m, 4.0f);
    f.even_area = c.dynamic ? 0 : f.area / corners_in_part_[part({c.x, c.y})];
    const cv::Point pixel = f.nearest_pixel();
    f.depth_m = current_.whole_depth(depth, pixel.x, pixel.y);
    // Of two measurements, the corner's in the last frame and this one.
    f.depth_tolerance_m = std::sqrt(2.0f) * sensor_.least_step_m(f.depth_m);
    consensus_.add(f);
  }

  // How far apart two rotations put a corner, fine pixels.
  double far_px(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) const {
    const Eigen::Isometry3d apart = a.inverse() * b;
    const double angle = detail::rotation_angle(apart.linear());
    return angle * static_cast<double>(current_.fx) / current_.scale;
  }

  SensorModel sensor_;
  CornerImage last_, current_;
  Eigen::Isometry3d last_motion_ = Eigen::Isometry3d::Identity();
  bool moved_ = false;  // the last motion is known
  // Of the last frame; from the frame before, and of the last motion, seconds.
  double last_s_ = 0, step_s_ = 0, motion_step_s_ = 1;
  double usual_support_ = 1;
  std::vector<float> corners_in_part_;  // with a say, by part of the image
  detail::RotationAlignment alignment_;
  detail::FlowConsensus consensus_, other_consensus_;
  detail::OutlierClusters outliers_;
};

}  // namespace stillpoint
