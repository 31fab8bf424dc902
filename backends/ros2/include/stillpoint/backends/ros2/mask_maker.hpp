// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <cstdlib>
#include <deque>
#include <exception>
#include <functional>
#include <limits>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <utility>

#include "stillpoint/backends/ros2/camera_info.hpp"
#include "stillpoint/backends/ros2/images.hpp"
#include "stillpoint/backends/ros2/messages.hpp"
#include "stillpoint/backends/ros2/parameters.hpp"
#include "stillpoint/backends/ros2/segmentations.hpp"
#include "stillpoint/backends/ros2/synchronizer.hpp"
#include "stillpoint/front_end.hpp"

namespace stillpoint::ros2 {

/// The topics' names, for warnings.
struct TopicNames {
  std::string color = "color/image", depth = "depth/image", camera_info = "color/camera_info",
              segmentation = "labels", poses = "odometry";
};

/// A frame whose mask is made.
struct StreamFrame {
  /// The color image's header is the frame's: stamp and frame_id.
  ImageMessage color;
  /// The depth's message, if it was used.
  std::optional<ImageMessage> depth;
  /// What the front end was given: color as BGR or grey.
  RgbdFrame frame;
  /// Not valid() if no calibration came, or none that can be used.
  Camera camera;
};

/// Makes the mask of one frame after the other from messages that were put together. Not
/// thread-safe.
class MaskMaker {
 public:
  /// The pose of the camera `frame_id` in a world that stands still, at a stamp. Returns an empty
  /// text, or what was expected and found.
  using PoseAt = std::function<std::string(Nanoseconds stamp, const std::string& frame_id,
                                           Eigen::Isometry3d& T_world_camera)>;
  /// Is told of what cannot be used: the topic, what of it, what was expected and found.
  using Refuse = std::function<void(const std::string& topic, const std::string& what,
                                    const std::string& problem)>;

  /// Without `pose_at`, the front end has its own estimate only.
  MaskMaker(TopicNames topics, Refuse refuse, PoseAt pose_at)
      : topics_(std::move(topics)), refuse_(std::move(refuse)), pose_at_(std::move(pose_at)) {}

  /// Holds from the next frame on. Other settings of the front end than before, and it begins anew.
  void set_parameters(const Parameters& parameters) {
    if (!same_front_end(parameters_, parameters)) front_end_.reset();
    parameters_ = parameters;
  }
  /// The same for the calibration.
  void set_camera_info(const std::optional<CameraInfoMessage>& info) {
    info_ = info;
    front_end_.reset();
  }

  /// False: it could not be made, and the reason is told.
  bool make(FrameMessages messages) {
    if (messages.clock_jumped) front_end_.reset();
    return read_color(messages) && make_mask(messages);
  }

  /// Of the last frame whose mask was made.
  const StreamFrame& frame() const { return frame_; }
  const FrontEnd& front_end() const { return *front_end_; }

 private:
  static bool same_front_end(const Parameters& a, const Parameters& b) {
    return a.preset == b.preset && a.dynamic_classes == b.dynamic_classes && a.sensor == b.sensor &&
           a.rectified == b.rectified && a.depth_units_per_m == b.depth_units_per_m &&
           a.dilation_px == b.dilation_px && a.exposure_s == b.exposure_s &&
           a.max_mask_age_s == b.max_mask_age_s;
  }

  bool read_color(FrameMessages& messages) {
    const cv::Size last = frame_.frame.color.size();
    const std::string problem = to_color(messages.color, frame_.frame.color);
    if (!problem.empty()) {
      refuse_(topics_.color, "image", problem);
      return false;
    }
    if (frame_.frame.color.size() != last) front_end_.reset();
    frame_.color = std::move(messages.color);
    frame_.frame.timestamp = seconds(frame_.color.stamp);
    frame_.frame.depth_units_per_m = parameters_.depth_units_per_m;
    frame_.depth.reset();
    if (messages.depth) {
      const std::string wrong = read_depth(*messages.depth);
      if (wrong.empty())
        frame_.depth = std::move(messages.depth);
      else
        refuse_(topics_.depth, "image", wrong);
    } else if (parameters_.use_depth) {
      refuse_(topics_.depth, "stamp",
              "expected a depth image at most " + detail::text(parameters_.max_time_difference_s) +
                  " s from each color image (parameter max_time_difference_s), found " +
                  (messages.nearest_depth
                       ? "the nearest " + detail::text(seconds(*messages.nearest_depth)) + " s away"
                       : "none") +
                  "; masks are made without");
    }
    if (!frame_.depth) frame_.frame.depth = cv::Mat();
    return true;
  }

  std::string read_depth(const ImageMessage& depth) {
    RgbdFrame& frame = frame_.frame;
    const std::string& frame_id = frame_.color.frame_id;
    const std::string problem = to_depth(depth, frame.depth);
    if (!problem.empty()) return problem;
    if (frame.depth.size() != frame.color.size())
      return "expected depth registered to color, " + stillpoint::detail::size_text(frame.color) +
             ", found " + stillpoint::detail::size_text(frame.depth) +
             "; let the driver align depth to color";
    if (!parameters_.any_depth_frame && depth.frame_id != frame_id)
      return "expected depth registered to color, frame_id '" + frame_id + "', found '" +
             depth.frame_id +
             "'; let the driver align depth to color, or set the parameter any_depth_frame";
    frame.depth_timestamp = depth.stamp == frame_.color.stamp
                                ? std::numeric_limits<double>::quiet_NaN()
                                : seconds(depth.stamp);
    return "";
  }

  Camera read_camera() const {
    Camera camera;
    if (!info_) return camera;
    const std::string problem = to_camera(*info_, frame_.frame.color.size(), parameters_.rectified,
                                          parameters_.depth_units_per_m, camera);
    if (!problem.empty())
      refuse_(topics_.camera_info, "calibration", problem + "; masks are made without");
    return camera;
  }

  // The front end predicts from the frame that was segmented, so it must be one that it has seen;
  // one that was dropped on the way has a neighbor.
  void find_frame_of(Segmentation& segmentation, Nanoseconds stamp) const {
    if (stamp == frame_.color.stamp) return;
    Nanoseconds best = nanoseconds(parameters_.max_time_difference_s) + 1, nearest = 0;
    for (const Nanoseconds seen : stamps_)
      if (std::abs(seen - stamp) < best) best = std::abs(seen - stamp), nearest = seen;
    if (nearest != 0)
      segmentation.timestamp = seconds(nearest);
    else if (!stamps_.empty() && stamp > stamps_.front())
      refuse_(topics_.segmentation, "stamp",
              "expected the stamp of the color image that was segmented, found " +
                  detail::text(seconds(stamp)) + ", which none of the last images has");
  }

  Segmentation read_segmentation(const FrameMessages& messages) const {
    Segmentation segmentation;
    if (!messages.segmentation) return segmentation;
    const std::string problem = to_segmentation(*messages.segmentation, frame_.frame.color.size(),
                                                parameters_.dynamic_labels,
                                                parameters_.dynamic_classes.front(), segmentation);
    if (!problem.empty())
      refuse_(topics_.segmentation, "labels", problem);
    else
      find_frame_of(segmentation, messages.segmentation->stamp);
    return segmentation;
  }

  std::optional<Eigen::Isometry3d> pose(Nanoseconds stamp, std::string& problem) const {
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    problem = pose_at_ ? pose_at_(stamp, frame_.color.frame_id, T) : "none are expected";
    return problem.empty() ? std::optional(T) : std::nullopt;
  }

  // A pose may come after its frame was processed, so it is missing only if the next frame does not
  // find it either.
  std::optional<Eigen::Isometry3d> last_pose() const {
    if (stamps_.empty()) return std::nullopt;
    std::string problem;
    const std::optional<Eigen::Isometry3d> T_last = pose(stamps_.back(), problem);
    if (!T_last && pose_at_)
      refuse_(topics_.poses, "pose", "the images alone tell the camera's motion; " + problem);
    return T_last;
  }

  void begin_front_end() {
    stamps_.clear();
    pose_told_ = false;
    frame_.camera = read_camera();
    front_end_.emplace(parameters_.front_end(), frame_.camera);
  }

  bool make_mask(const FrameMessages& messages) try {
    if (!front_end_) begin_front_end();
    if (!info_)
      refuse_(topics_.camera_info, "calibration",
              "expected one, found no message so far; masks are made without");
    const Nanoseconds now = frame_.color.stamp;
    std::string problem;
    const std::optional<Eigen::Isometry3d> T_now = pose(now, problem), T_last = last_pose();
    std::optional<Eigen::Isometry3d> T_current_last;
    if (T_last && !pose_told_) front_end_->correct_pose(*T_last);
    if (T_last && T_now) T_current_last = T_now->inverse() * *T_last;
    front_end_->compute_mask(frame_.frame, read_segmentation(messages), T_current_last);
    if (T_now) front_end_->correct_pose(*T_now);
    pose_told_ = T_now.has_value();
    stamps_.push_back(now);
    while (now - stamps_.front() > nanoseconds(parameters_.max_mask_age_s)) stamps_.pop_front();
    return true;
  } catch (const std::exception& error) {
    refuse_(topics_.color, "frame", error.what());
    front_end_.reset();
    return false;
  }

  TopicNames topics_;
  Refuse refuse_;
  PoseAt pose_at_;
  Parameters parameters_;
  std::optional<CameraInfoMessage> info_;
  std::optional<FrontEnd> front_end_;
  StreamFrame frame_;
  std::deque<Nanoseconds> stamps_;  // of the frames that the front end has seen lately
  bool pose_told_ = false;
};

}  // namespace stillpoint::ros2
