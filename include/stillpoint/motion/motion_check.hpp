// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <vector>

#include "stillpoint/core/error.hpp"
#include "stillpoint/core/frame_context.hpp"
#include "stillpoint/core/instance.hpp"
#include "stillpoint/motion/depth_cells.hpp"
#include "stillpoint/motion/depth_pose.hpp"
#include "stillpoint/motion/ego_motion.hpp"
#include "stillpoint/motion/free_space_map.hpp"
#include "stillpoint/motion/motion_check_settings.hpp"
#include "stillpoint/motion/mover_detector.hpp"
#include "stillpoint/motion/near_holes.hpp"
#include "stillpoint/motion/touching_cells.hpp"
#include "stillpoint/sensor/sensor_model.hpp"

namespace stillpoint {

/// Finds what moves against the static world, without a network: whatever stands where earlier
/// frames looked through has moved there.
///
/// Each cell of a new frame is carried into depth images of the last 1.7 s (FreeSpaceMap), whose
/// poses are found by their own depth (DepthPose): if free space was seen there, by more
/// than the sensor can be wrong (SensorModel), the cell has moved; if the same surface was there,
/// it is static; else nothing is said ("unknown" is never "dynamic"). Corners of the image that
/// move together otherwise than the camera have moved, too, before there is a past to compare with.
/// From moved cells come instances without a class (MoverDetector).
///
/// It needs depth, and the camera's motion (EgoMotion). Memory: about 5 MB. Cost: O(cells x 20).
/// Not thread-safe; one object per camera.
class MotionCheck {
 public:
  using Settings = MotionCheckSettings;

  explicit MotionCheck(const Settings& settings = {}, const SensorModel& sensor = {})
      : settings_(settings),
        sensor_(sensor),
        pose_(sensor),
        map_(sensor),
        touching_(sensor),
        near_(sensor),
        detector_(settings.movers) {
    settings.check();
    sensor.check();
  }

  const Settings& settings() const { return settings_; }

  /// Finds the movers of a frame that `ego` has tracked, and labels the context's cells. The
  /// reference stays valid until the next call. Call remember() afterwards.
  const std::vector<Instance>& find(FrameContext& context, EgoMotion& ego) {
    detector_.clear();
    judged_ = false;
    const bool goes_on =
        std::isfinite(last_s_) && context.size() == size_ && context.frame.timestamp > last_s_;
    const bool hardly_measured = ego.between() || !context.depth.any_measured();
    if (hardly_measured && (context.depth.empty() || !goes_on)) return detector_.found();
    if (!goes_on) {
      reset();
      start_s_ = context.frame.depth_time();
    }
    size_ = context.size();
    last_s_ = context.frame.timestamp;
    const int block_px = settings_.block_px > 0 ? settings_.block_px
                                                : std::clamp(2 * ((size_.width + 80) / 160), 2, 64);
    cells_.set(context.depth, block_px);
    if (cells_.size() == 0) return detector_.found();  // not one cell
    if (hardly_measured) {  // who covers the lens is followed; nothing else can be told
      find_near(nullptr, context);
      return detector_.found();
    }
    take_brightness(context, ego);
    if (ego.chain() != chain_ && !map_.empty()) {
      // The host may yet tell the pose that is missing.
      if (!ego.motion()) {
        outliers_.clear();
        find_near(nullptr, context);
        return detector_.found();
      }
      forget_map();
    }
    chain_ = ego.chain();
    begins_ = map_.empty();
    pose_.locate(context.frame.depth_time(), cells_, find_moving(ego), ego, map_);
    map_.judge(pose_.shot(), cells_, context.labels);
    label_outlier_corners(ego, context);
    find_near(&pose_.shot(), context);
    context.labels.find_wide_static();
    judged_ = true;
    return detector_.find(cells_, context.labels, outlier_cells_);
  }

  /// How long after its stamp the depth is taken, as far as the frames tell.
  const DepthDelay& delay() const { return pose_.delay(); }
  /// How long it takes to read the depth out, row by row, as far as the frames tell.
  const DepthReadout& readout() const { return pose_.readout(); }

  /// What the last find() returned.
  const std::vector<Instance>& found() const { return detector_.found(); }

  /// Remembers the last frame of find(): `dynamic`, CV_8UC1 of the frame's size, 255 = dynamic, is
  /// what was taken for dynamic in it (before dilation); such cells never speak for "static".
  void remember(const cv::Mat& dynamic) {
    if (!judged_) return;
    detail::check(dynamic.type() == CV_8UC1 && dynamic.size() == size_, [&] {
      return "MotionCheck::remember: expected CV_8UC1 of the frame's size, found " +
             detail::type_text(dynamic) + " " + detail::size_text(dynamic);
    });
    const int b = cells_.block_px;
    dynamic_.assign(cells_.size(), 0);
    for (int y = 0; y < cells_.height; ++y)
      for (int k = b / 4; k < b; k += b / 2) {
        const uchar* row = dynamic.ptr<uchar>(y * b + k);
        for (int x = 0; x < cells_.width; ++x)
          dynamic_[cells_.index(x, y)] |=
              static_cast<std::uint8_t>((row[x * b + b / 4] | row[x * b + b / 4 + b / 2]) != 0);
      }
    map_.add(pose_.shot(), cells_, dynamic_, touching_.find(cells_, dynamic_), gray_);
  }

  /// To be called after `ego` was given the host's pose of the last frame.
  void correct(const EgoMotion& ego) {
    if (!judged_) return;
    if (begins_) chain_ = ego.chain();  // the pose bridges a gap before the map's first frame
    if (ego.chain() != chain_) return;
    if (pose_.correct(ego)) map_.correct(pose_.shot());
  }

  /// Forgets everything (a cut in the sequence).
  void reset() {
    forget_map();
    near_.reset();
    last_s_ = -std::numeric_limits<double>::infinity();
  }

 private:
  // Corners are followed ill, in parts of their displacement, when the image is read out while the
  // camera rotates: so many times the rotation during the readout, rad.
  static constexpr double kReadoutError = 3;
  static constexpr float kOutlierReachM = 0.1f, kOutlierStepM = 0.1f;
  // The camera's motion is sure enough to doubt corners if so much agrees with it; less will do
  // where the depth images, too, say that something large has moved, and in the first moment of a
  // sequence, when nothing else finds movers.
  static constexpr double kSureSupport = 0.6, kSupportAtStart = 0.55;
  static constexpr double kSupportAmongMovers = 0.45, kFitAmongMovers = 0.85;
  // A cluster of outlier corners must show twice, but for one that is off by so much in the first
  // moment of a sequence, which has no past to compare with, or before a camera that does not
  // rotate, whose corners are followed well. Where the camera's motion was lost there is no past
  // either, but it is lost as the camera rotates fast before few corners: then clusters are often
  // wrong.
  static constexpr double kStartS = 0.7, kStillRadS = 0.1;
  static constexpr float kOnceOffM = 0.01f;
  static constexpr float kSameClusterM = 0.5f;  // from one frame to the next

  void forget_map() {
    map_.clear();
    pose_.reset();
    outliers_.clear();
  }

  void take_brightness(const FrameContext& context, EgoMotion& ego) {
    const cv::Mat& small = ego.images().small_gray();
    cv::resize(small.empty() ? context.gray() : small, gray_, {cells_.width, cells_.height}, 0, 0,
               cv::INTER_AREA);
  }

  // Labels what is too near to be measured. `shot`: null where the pose is not known.
  void find_near(const DepthShot* shot, FrameContext& context) {
    const double now_s = context.frame.depth_time();
    if (near_.find(now_s, cells_, gray_, shot, map_, context.labels) && !shot)
      context.labels.find_wide_static();
  }

  // The cells whose corners moved by themselves in the last frame, and what their surfaces go on
  // into: a large mover must not drag the camera's pose along. Empty: none.
  const std::vector<std::uint8_t>& find_moving(const EgoMotion& ego) {
    moving_.clear();
    const std::optional<Eigen::Isometry3d> T_now_last = ego.motion_from_depth();
    if (outliers_.empty() || !T_now_last) return moving_;
    moving_.resize(cells_.size());
    const Eigen::Isometry3f T = T_now_last->cast<float>();
    for (const Eigen::Vector3f& last : outliers_) {
      const Eigen::Vector3f now = T * last;
      if (!(now.z() > 0)) continue;
      const auto [u, v] = cells_.cell(now.x() / now.z(), now.y() / now.z());
      if (!(u > -0.5f && v > -0.5f && u < static_cast<float>(cells_.width) - 0.5f &&
            v < static_cast<float>(cells_.height) - 0.5f))
        continue;
      const std::size_t cell = cells_.index(static_cast<int>(u + 0.5f), static_cast<int>(v + 0.5f));
      if (std::abs(cells_.depth_m[cell] - now.z()) < kOutlierStepM) moving_[cell] = 1;
    }
    return touching_.find(cells_, moving_);
  }

  // Surfaces around corners that move by themselves have moved: a slow surface lies over where it
  // was a moment ago. Of those that have been there for longer nothing is known any more, once it
  // is seen twice: a reflection moves, and so does a flat board in its own plane.
  void label_outlier_corners(EgoMotion& ego, FrameContext& context) {
    CellLabels& labels = context.labels;
    outlier_cells_.clear();
    std::swap(outliers_, last_outliers_);
    outliers_.clear();
    const bool movers = pose_.fit() && *pose_.fit() < kFitAmongMovers;
    const bool starts = pose_.shot().timestamp - start_s_ < kStartS;
    const double least = movers ? kSupportAmongMovers : starts ? kSupportAtStart : kSureSupport;
    if (!ego.measured() || !(ego.measured()->support > least)) return;
    const float per_cell = 1.0f / static_cast<float>(cells_.block_px);
    const Eigen::Isometry3d& seen = ego.measured()->T_current_last;
    const double rad_s = ego.angular_velocity().norm();
    const double smeared_share = kReadoutError * sensor_.readout_s * rad_s;
    const bool once_is_enough = rad_s < kStillRadS || starts;
    for (const OutlierCorner& corner : ego.images().outlier_clusters(
             context.depth, seen, ego.trusted_prediction(), smeared_share)) {
      const int cx = static_cast<int>(corner.u * per_cell);
      const int cy = static_cast<int>(corner.v * per_cell);
      const std::size_t cell =
          cells_.index(std::min(cx, cells_.width - 1), std::min(cy, cells_.height - 1));
      const bool twice = seen_twice(cell, corner.depth_m, seen);
      if (!twice && !(once_is_enough && corner.off_m > kOnceOffM)) continue;
      outlier_cells_.push_back(cell);
      ego.images().remember_moving(corner, kOutlierStepM);
      const int reach = static_cast<int>(kOutlierReachM * cells_.fx / corner.depth_m);
      for (int y = std::max(0, cy - reach); y <= std::min(cells_.height - 1, cy + reach); ++y)
        for (int x = std::max(0, cx - reach); x <= std::min(cells_.width - 1, cx + reach); ++x) {
          const std::size_t i = cells_.index(x, y);
          if (!(cells_.depth_m[i] > 0) ||
              std::abs(cells_.depth_m[i] - corner.depth_m) >= kOutlierStepM)
            continue;
          if (!map_.settled(i))
            labels[i] = CellLabel::kMoved;
          else if (twice && labels[i] == CellLabel::kStatic)
            labels[i] = CellLabel::kUnknown;
        }
    }
  }

  // Whether the last frame had an outlier nearby, too.
  bool seen_twice(std::size_t cell, float depth_m, const Eigen::Isometry3d& T_now_last) {
    outliers_.push_back(depth_m * Eigen::Vector3f(cells_.ray_x[cell], cells_.ray_y[cell], 1));
    const Eigen::Isometry3f T = T_now_last.cast<float>();
    return std::any_of(
        last_outliers_.begin(), last_outliers_.end(), [&](const Eigen::Vector3f& last) {
          return (outliers_.back() - T * last).squaredNorm() < kSameClusterM * kSameClusterM;
        });
  }

  Settings settings_;
  SensorModel sensor_;
  cv::Size size_;
  DepthCells cells_;
  DepthPose pose_;
  FreeSpaceMap map_;
  TouchingCells touching_;
  NearHoles near_;
  cv::Mat_<uchar> gray_;  // mean brightness of the cells of the last frame
  MoverDetector detector_;
  double last_s_ = -std::numeric_limits<double>::infinity();
  int chain_ = -1;                          // of the ego-motion, at the last frame in the map
  bool judged_ = false;                     // the last frame
  bool begins_ = false;                     // it is the map's first
  std::vector<std::uint8_t> dynamic_;       // of the last frame, by cell
  std::vector<std::uint8_t> moving_;        // see find_moving(), by cell
  std::vector<std::size_t> outlier_cells_;  // of the outlier corners of the last frame
  double start_s_ = 0;                      // of the sequence
  std::vector<Eigen::Vector3f> outliers_, last_outliers_;  // of two frames, each in its camera
};

}  // namespace stillpoint
