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
  };

  explicit CameraMotion(const SensorModel& sensor = {}) : sensor_(sensor) {}

  /// Forgets the last frame.
  void reset() {
    for (detail::CornerImage* image : {&last_, &current_})
      image->empty = true, image->corners.clear();
    last_motion_ = Eigen::Isometry3d::Identity();
    usual_support_ = 1;
  }

  /// Takes the next frame, without looking for the motion to it. O(pixels).
  void begin(const FrameContext& context) {
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
    if (last_.empty || current_.empty || last_.size() != current_.size()) return std::nullopt;
    // Not before it is known which of them are on people: these may have most of the corners.
    last_.keep_strongest(kMostCorners, kMostDynamic);
    if (last_.corners.size() < detail::FlowConsensus::kMinFlows) return std::nullopt;
    const std::optional<Estimate> found = estimate(context.depth, guess);
    if (found) last_motion_ = found->T_current_last;
    return found;
  }

  /// Tells what is dynamic in the last frame, CV_8UC1 of its size: its corners there have no say on
  /// the camera's motion, but are followed, too, as outliers among them show that it still moves.
  void remember_dynamic(const cv::Mat& mask) {
    const int scale = current_.scale;
    for (detail::Corner& c : current_.corners)
      c.dynamic = mask.at<uchar>(scale * c.y, scale * c.x) != 0;
  }

  /// Share of the followed area that agrees with a motion.
  double support(const Eigen::Isometry3d& T_current_last) const {
    return consensus_.support(T_current_last);
  }

  /// A corner that moves otherwise than the camera says, with others around it that do so too.
  struct OutlierCorner {
    /// Where it is in the new frame, raw pixels; its depth, metres.
    float u, v, depth_m;
  };

  /// The corners in clusters that move otherwise than a motion says, and than another one if there
  /// is one: off by over 1.3 pixels (of 640 in a row), four times the median by area, and
  /// `smeared_share` (blur, shutter) of their own displacement, with at least
  /// four others within 0.3 m that move alike, and more than do not. None lies at an edge of
  /// `depth`, that of the frame last added. O(corners squared).
  const std::vector<OutlierCorner>& outlier_clusters(
      const DepthView& depth, const Eigen::Isometry3d& T_current_last,
      const std::optional<Eigen::Isometry3d>& another, double smeared_share) {
    outliers_.clear();
    const std::vector<Flow>& flows = consensus_.flows();
    if (flows.empty()) return outliers_;
    const float limit_another = another ? measure_errors(*another) : 0;
    std::swap(errors_, other_errors_);
    const float limit = measure_errors(T_current_last);
    const float per_px = std::max(kBlurError, static_cast<float>(smeared_share));
    for (std::size_t i = 0; i < flows.size(); ++i) {
      const float size = error_size(i, errors_);
      if (size < std::max(limit, per_px * length_px(flows[i])) ||
          (another && error_size(i, other_errors_) < limit_another) || !is_smooth(flows[i], depth))
        continue;
      int with = 0, against = 0;
      for (std::size_t j = 0; j < flows.size(); ++j) {
        if ((flows[i].from - flows[j].from).squaredNorm() > kClusterM * kClusterM) continue;
        if ((errors_[i] - errors_[j]).norm() > 0.5f * size)
          ++against;
        else if (error_size(j, errors_) >= limit && !same_patch(flows[i], flows[j]))
          ++with;
      }
      if (with >= kFewestWith && with > against)
        outliers_.push_back({flows[i].u, flows[i].v, flows[i].depth_m});
    }
    return outliers_;
  }

  /// Corners followed from the frame before to the one last added.
  std::size_t followed() const { return consensus_.flows().size(); }

 private:
  using CornerImage = detail::CornerImage;
  using Flow = detail::Flow;

  static constexpr std::size_t kMostCorners = 200, kMostDynamic = 100;
  static constexpr double kMinSupport = 0.3, kUsual = 0.95;
  static constexpr double kSure = 0.5;           // no doubt that the corners were found again
  static constexpr double kPlainShare = 0.4;     // of the best support; see plain_motion()
  static constexpr double kNearPx = 2;           // fine ones: corners are found again from there
  static constexpr float kLeastOutlier = 0.65f;  // fine pixels
  static constexpr float kClusterM = 0.3f;
  static constexpr int kFewestWith = 4;
  static constexpr float kBlurError =
      0.12f;  // of a corner's displacement: what is blurred is followed ill

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
    Estimate found{guess, 0};
    // As good as it usually gets is enough: no need to look further.
    const double s = consensus_.search(found.T_current_last, another, kUsual * usual_support_);
    if (s < kMinSupport) return std::nullopt;
    found.support = s;
    if (s < kSure) {
      const Estimate plain = plain_motion(guess);
      if (plain.support > kPlainShare * s) return plain;
    }
    if (!consensus_.allows_blur())
      usual_support_ += (s - usual_support_) * (s > usual_support_ ? 0.5 : 0.1);
    return found;
  }

  // People who fill the image and walk alike agree on a motion, too. Before half of the area is
  // behind one, what was expected, or rest, is more likely where it has some support of its own.
  Estimate plain_motion(const Eigen::Isometry3d& expected) {
    Estimate best;
    for (Eigen::Isometry3d T : {expected, Eigen::Isometry3d::Identity()}) {
      const double support = consensus_.refine(T);
      if (support > best.support) best = {T, support};
    }
    return best;
  }

  void follow_all(const DepthView& depth, const Eigen::Isometry3d& guess) {
    consensus_.begin(current_);
    for (const detail::Corner& c : last_.corners) follow(c, depth, guess);
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
    f.flat_u = flat.x(), f.flat_v = flat.y();
    f.area = c.dynamic ? 0 : std::min(c.depth_m, 4.0f) * std::min(c.depth_m, 4.0f);
    const cv::Point pixel = nearest_pixel(f);
    f.depth_m = current_.whole_depth(depth, pixel.x, pixel.y);
    // Of two measurements, the corner's in the last frame and this one.
    f.depth_tolerance_m = std::sqrt(2.0f) * sensor_.least_step_m(f.depth_m);
    consensus_.add(f);
  }

  // No depth edge in all of its patch.
  bool is_smooth(const Flow& f, const DepthView& depth) const {
    const cv::Point pixel = nearest_pixel(f);
    return f.depth_m > 0 && current_.is_whole(depth, pixel.x, pixel.y, CornerImage::kFar);
  }

  static cv::Point nearest_pixel(const Flow& f) {
    return {static_cast<int>(f.u + 0.5f), static_cast<int>(f.v + 0.5f)};
  }

  // How far apart two rotations put a corner, fine pixels.
  double far_px(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) const {
    const Eigen::Isometry3d apart = a.inverse() * b;
    const double angle = detail::rotation_angle(apart.linear());
    return angle * static_cast<double>(current_.fx) / current_.scale;
  }

  // Fills errors_; returns from which on one is not just noise.
  float measure_errors(const Eigen::Isometry3d& T_current_last) {
    const Eigen::Matrix3f R = T_current_last.linear().cast<float>();
    const Eigen::Vector3f t = T_current_last.translation().cast<float>();
    errors_.clear();
    sorted_.clear();
    float half = 0;
    for (const Flow& f : consensus_.flows()) {
      errors_.push_back(error_px(f, R * f.from + t));
      sorted_.emplace_back(errors_.back().norm(), f.area);
      half += 0.5f * f.area;
    }
    // The median by area: people close by may have most of the corners.
    std::sort(sorted_.begin(), sorted_.end());
    std::size_t median = 0;
    while (median + 1 < sorted_.size() && (half -= sorted_[median].second) > 0) ++median;
    return std::max(kLeastOutlier * static_cast<float>(current_.scale), 4 * sorted_[median].first);
  }

  Eigen::Vector2f error_px(const Flow& f, const Eigen::Vector3f& q) const {
    if (q.z() < CornerImage::kLeastDepthM) return {1e6f, 1e6f};
    return current_.project(q) - Eigen::Vector2f(f.flat_u, f.flat_v);
  }

  // The size of a flow's error, as far as its patch can tell (Mahalanobis distance).
  float error_size(std::size_t i, const std::vector<Eigen::Vector2f>& errors) const {
    return std::sqrt(std::max(0.0f, errors[i].dot(consensus_.flows()[i].information * errors[i])));
  }

  // Its displacement in the image.
  float length_px(const Flow& f) const {
    const float du = f.u - current_.frame_px(f.x), dv = f.v - current_.frame_px(f.y);
    return std::sqrt(du * du + dv * dv);
  }

  static bool same_patch(const Flow& a, const Flow& b) {
    return std::abs(a.x - b.x) <= detail::Patch::kRadius &&
           std::abs(a.y - b.y) <= detail::Patch::kRadius;
  }

  SensorModel sensor_;
  CornerImage last_, current_;
  Eigen::Isometry3d last_motion_ = Eigen::Isometry3d::Identity();
  double usual_support_ = 1;
  detail::RotationAlignment alignment_;
  detail::FlowConsensus consensus_, other_consensus_;
  std::vector<Eigen::Vector2f> errors_, other_errors_;
  std::vector<std::pair<float, float>> sorted_;  // error and area
  std::vector<OutlierCorner> outliers_;
};

}  // namespace stillpoint
