// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <chrono>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include "stillpoint/core/camera.hpp"
#include "stillpoint/core/distortion.hpp"
#include "stillpoint/core/frame.hpp"
#include "stillpoint/core/instance.hpp"
#include "stillpoint/core/selection.hpp"
#include "stillpoint/front_end.hpp"
#include "stillpoint/keypoints/feature_budget.hpp"
#include "stillpoint/motion/constant_velocity.hpp"

// The one function of the host that its types do not lead to (data/common.h).
namespace stella_vslam {
namespace camera {
class base;
}
namespace data {
void assign_keypoints_to_grid(const camera::base* camera,
                              const std::vector<cv::KeyPoint>& undist_keypts,
                              std::vector<std::vector<std::vector<unsigned int>>>& cells,
                              unsigned int num_grid_cols, unsigned int num_grid_rows);
}
}  // namespace stella_vslam

namespace stillpoint {

/// Where StellaVslam applies the dynamic mask.
enum class StellaMasking {
  /// After extraction, keypoint by keypoint: the default.
  kAfterExtraction,
  /// The mask goes to the host's extractor, which then leaves out every cell (64 px at the first
  /// level, larger above) with a masked corner: fewer keypoints near people, and no probability.
  kByExtractor
};

/// Adapter for stella_vslam 0.6 on its public API: creates the host's frame, leaves out what moves,
/// feeds the frame, hands the pose back to the front end.
///
///     stella_vslam::system slam(config, vocabulary);  slam.startup();
///     stillpoint::FrontEnd front_end(settings, camera, &segmenter);
///     stillpoint::StellaVslam<stella_vslam::system> adapter(slam, front_end, camera);
///     std::shared_ptr<Eigen::Matrix4d> T_world_camera = adapter.track_rgbd(frame);
///
/// Include the host's data/frame.h as well. `System` is stella_vslam::system; it and the front end
/// must outlive the adapter. Keypoints are dropped *after* extraction: on a person-shaped mask the
/// host's extractor keeps 520 keypoints where this keeps 811. The host's extractor spreads
/// keypoints by area, so more are found by a smaller `Preprocessing.min_size`. It starts with 50
/// keypoints with depth: leave FrontEndSettings::probability.min_kept at 50 or more. Called from
/// one thread.
template <class System>
class StellaVslam {
 public:
  /// `camera` is that of the host's config: the host's keypoints are undistorted, the mask is not.
  StellaVslam(System& system, FrontEnd& front_end, const Camera& camera,
              StellaMasking masking = StellaMasking::kAfterExtraction)
      : system_(system), front_end_(front_end), camera_(camera), masking_(masking) {}

  /// Tracks one frame, segmented by the front end's segmenter. Returns T_world_camera, or null
  /// while the host is not started or lost. Throws Error for a frame that breaks its rules.
  std::shared_ptr<Eigen::Matrix4d> track_rgbd(const RgbdFrame& frame) {
    return track(frame, front_end_.compute_mask(frame, predicted(frame)));
  }
  /// The same with a segmentation that the caller brings.
  std::shared_ptr<Eigen::Matrix4d> track_rgbd(const RgbdFrame& frame,
                                              const Segmentation& segmentation) {
    return track(frame, front_end_.compute_mask(frame, segmentation, predicted(frame)));
  }

  /// What was left of the last frame's keypoints; empty with StellaMasking::kByExtractor.
  const Selection& selection() const { return selection_; }
  /// How many keypoints the host must extract (see FeatureBudget).
  const FeatureBudget& budget() const { return budget_; }

 private:
  using Clock = std::chrono::steady_clock;

  std::optional<Eigen::Isometry3d> predicted(const RgbdFrame& frame) const {
    return velocity_.predict(last_s_, frame.timestamp);
  }

  std::shared_ptr<Eigen::Matrix4d> track(const RgbdFrame& frame, const DynamicMask& mask) {
    detail::check(!frame.depth.empty(), [] {
      return std::string("track_rgbd: frame.depth: expected a depth image, found an empty one");
    });
    last_s_ = frame.timestamp;
    const Clock::time_point start = Clock::now();
    const bool by_extractor = masking_ == StellaMasking::kByExtractor;
    auto extracted = system_.create_RGBD_frame(frame.color, frame.depth, frame.timestamp,
                                               by_extractor ? mask.static_image() : cv::Mat());
    selection_.clear();
    const std::shared_ptr<Eigen::Matrix4d> pose =
        by_extractor ? feed(extracted, frame, start) : feed(filtered(extracted), frame, start);
    hand_back(frame.timestamp, pose.get());
    return pose;
  }

  template <class Frame>
  std::shared_ptr<Eigen::Matrix4d> feed(const Frame& host_frame, const RgbdFrame& frame,
                                        Clock::time_point start) {
    const std::chrono::duration<double, std::milli> extraction = Clock::now() - start;
    return system_.feed_frame(host_frame, frame.color, extraction.count());
  }

  // A new frame of what is static. The host sizes a frame's landmarks in its constructor, so the
  // observation of the old one cannot be cut down in place.
  template <class Frame>
  Frame filtered(const Frame& frame) {
    const auto& from = frame.frm_obs_;
    raw_.clear();
    for (const cv::KeyPoint& k : from.undist_keypts_) {
      const Eigen::Vector2d raw = distort_pixel(camera_, {k.pt.x, k.pt.y});
      raw_.emplace_back(static_cast<float>(raw.x()), static_cast<float>(raw.y()));
    }
    selection_ = front_end_.select(raw_);
    budget_.add(static_cast<int>(selection_.size()), static_cast<int>(selection_.kept.size()),
                frame.timestamp_);
    std::decay_t<decltype(from)> kept;
    kept.undist_keypts_ = from.undist_keypts_;
    kept.bearings_ = from.bearings_;
    kept.stereo_x_right_ = from.stereo_x_right_;
    kept.depths_ = from.depths_;
    compact(kept.undist_keypts_, selection_);
    compact(kept.bearings_, selection_);
    compact(kept.stereo_x_right_, selection_);
    compact(kept.depths_, selection_);
    kept.descriptors_.create(static_cast<int>(selection_.kept.size()), from.descriptors_.cols,
                             from.descriptors_.type());
    for (std::size_t i = 0; i < selection_.kept.size(); ++i)
      from.descriptors_.row(selection_.kept[i]).copyTo(kept.descriptors_.row(static_cast<int>(i)));
    kept.num_grid_cols_ = from.num_grid_cols_;
    kept.num_grid_rows_ = from.num_grid_rows_;
    ::stella_vslam::data::assign_keypoints_to_grid(frame.camera_, kept.undist_keypts_,
                                                   kept.keypt_indices_in_cells_,
                                                   kept.num_grid_cols_, kept.num_grid_rows_);
    // The host's frame holds these parameters as const and its constructor asks for them as not.
    using OrbParams = std::remove_const_t<std::remove_pointer_t<decltype(frame.orb_params_)>>;
    return Frame(frame.id_, frame.timestamp_, frame.camera_,
                 const_cast<OrbParams*>(frame.orb_params_), kept, frame.markers_2d_);
  }

  void hand_back(double timestamp, const Eigen::Matrix4d* pose) {
    // A pose that is not finite would spoil later predictions: the host is lost.
    if (!pose || !pose->allFinite()) {
      velocity_.reset();
      return;
    }
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.linear() = Eigen::Quaterniond(Eigen::Matrix3d(pose->topLeftCorner<3, 3>()))
                     .normalized()
                     .toRotationMatrix();
    T.translation() = pose->topRightCorner<3, 1>();
    velocity_.add(timestamp, T);
    front_end_.correct_pose(T);
  }

  System& system_;
  FrontEnd& front_end_;
  Camera camera_;
  StellaMasking masking_;
  ConstantVelocity velocity_;
  FeatureBudget budget_;
  double last_s_ = 0;
  std::vector<cv::Point2f> raw_;
  Selection selection_;
};

}  // namespace stillpoint
