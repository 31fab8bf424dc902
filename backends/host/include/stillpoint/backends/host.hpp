// SPDX-License-Identifier: BSD-2-Clause
#pragma once

// The front end for hosts that are not C++17: this header is C++14 and needs OpenCV core alone to
// link; all that is C++17 or Eigen is behind a shared library with hidden symbols. So the host's
// language level, -march and Eigen alignment need not be those that the library was built with.
// (Its OpenCV must be the same.)

#include <cstdint>
#include <cstring>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "stillpoint/core/camera.hpp"
#include "stillpoint/core/error.hpp"
#include "stillpoint/core/frame.hpp"
#include "stillpoint/core/instance.hpp"
#include "stillpoint/core/keypoint.hpp"
#include "stillpoint/core/status.hpp"
#include "stillpoint/segmentation/dynamic_class.hpp"
#include "stillpoint/sensor/sensor_model.hpp"

#if defined(__GNUC__)
#define STILLPOINT_HOST_API __attribute__((visibility("default")))
#else
#define STILLPOINT_HOST_API
#endif

namespace stillpoint {

/// Settings of HostFrontEnd; the defaults suit ORB_SLAM2 and ORB_SLAM3.
struct HostSettings {
  /// Preset of the front end: "default", "network_only" (without the motion check: 1 ms per frame
  /// less) or "paper"; see FrontEndSettings. The motion check works best when correct_pose() is
  /// called for each frame.
  std::string preset = "default";
  /// Classes of the network that may move; instances without a class always may.
  std::vector<DynamicClass> dynamic_classes{"person"};
  /// Dilation of the mask to each side, for an image 640 wide.
  int dilation_px = 10;
  /// Exposure time of the color image, seconds; 0: the camera's (see BlurMeterSettings).
  double exposure_s = 0;
  /// What the depth camera's measurements are worth, e.g. SensorModel::realsense_d400().
  SensorModel sensor;
  /// Keypoints that a frame never falls below (unless the host gives fewer) until the host has
  /// started: ORB_SLAM2 and ORB_SLAM3 start at more than 500 only. Dynamic ones are among them when
  /// static ones are too few, so let the host extract 2000 or more.
  int min_keypoints_at_start = 510;
  /// The same once it has started.
  int min_keypoints = 100;
};

/// What was done with the newest frame, and counts since the beginning.
struct HostStats {
  double timestamp = 0;
  /// FrameStatus bits of the mask and of the last keypoints.
  std::uint32_t status = kOk;
  /// Objects in the mask, and how many of them were restored.
  int instances = 0, restored = 0;
  /// Share of the image in the mask, 0 to 1.
  double mask_share = 0;
  /// Time for the mask, and in the hook, milliseconds.
  double mask_ms = 0, hook_ms = 0;
  int keypoints = 0, kept = 0;
  /// Frames whose mask was computed, and frames in which the hook found one. If the second stays 0,
  /// the hook is not compiled into the host.
  int frames = 0, filtered = 0;
};

/// The front end with a plain boundary: masks are computed in the runner and found by timestamp
/// where the host has its keypoints.
///
///     stillpoint::HostFrontEnd front_end(camera);                    // runner, once
///     front_end.compute_mask(frame, segmentation);                   // runner, before the host
///     stillpoint::keep_static(timestamp, keypoints, descriptors);    // in the host: the hook
///     front_end.correct_pose(timestamp, T_world_camera);             // runner, after the host
///
/// compute_mask(), correct_pose() and set_lost() belong to one thread; the hook may run in another,
/// less than kMasks frames behind. Several front ends may live in one process.
class STILLPOINT_HOST_API HostFrontEnd {
 public:
  /// Masks that are kept for the hook.
  static constexpr int kMasks = 4;

  /// Throws Error if a setting makes no sense. `camera` may be left out (see FrontEnd).
  explicit HostFrontEnd(const Camera& camera = Camera(),
                        const HostSettings& settings = HostSettings());
  ~HostFrontEnd();
  HostFrontEnd(const HostFrontEnd&) = delete;
  HostFrontEnd& operator=(const HostFrontEnd&) = delete;

  /// Computes the mask of a frame and keeps it for the hook. Throws Error if the frame or the
  /// segmentation breaks its rules. Cost: that of FrontEnd::compute_mask().
  void compute_mask(const RgbdFrame& frame, const Segmentation& segmentation);

  /// Tells the pose that the host tracked: 4 x 4, maps points of the camera into the host's world.
  /// The next masks are then carried along with the camera's motion.
  void correct_pose(double timestamp, const cv::Matx44d& T_world_camera);
  /// Tells that the host tracked no pose; `starts_anew`: it waits for a first frame again, so the
  /// floor of keypoints is min_keypoints_at_start.
  void set_lost(bool starts_anew);

  /// The mask of the newest frame, H x W, CV_8UC1, 255 = dynamic; a copy.
  cv::Mat mask() const;
  HostStats stats() const;
  /// Keypoints to extract so that `wanted` static ones are left, judged by the last second.
  int features_for(int wanted, int most = 10000) const;

  /// Judges `count` points (raw pixels) by the mask of that timestamp; writes the indices of those
  /// to keep, ascending, to `kept` (room for `count`). Returns how many, or -1 if there is no such
  /// mask.
  int select(double timestamp, const cv::Point2f* points, int count, int* kept);
  /// The same with whichever living front end has such a mask; one that was fed by the calling
  /// thread comes first.
  static int select_by_timestamp(double timestamp, const cv::Point2f* points, int count, int* kept);

 private:
  struct Impl;
  std::shared_ptr<Impl> impl_;
};

namespace detail {

template <class Keypoints, class Select>
bool keep_static(Keypoints& keypoints, cv::Mat& descriptors, const Select& select) {
  using Keypoint = typename Keypoints::value_type;
  const int count = static_cast<int>(keypoints.size());
  check(descriptors.empty() || descriptors.rows == count, [&] {
    return "keep_static: descriptors: expected one row per keypoint, " + std::to_string(count) +
           ", found " + std::to_string(descriptors.rows);
  });
  std::vector<cv::Point2f> points;
  points.reserve(keypoints.size());
  for (const Keypoint& k : keypoints)
    points.emplace_back(KeypointTraits<Keypoint>::x(k), KeypointTraits<Keypoint>::y(k));
  std::vector<int> kept(keypoints.size());
  const int n = select(points.data(), count, kept.data());
  if (n < 0 || n == count) return n >= 0;
  // A new matrix: the host may share the old one.
  cv::Mat kept_descriptors;
  if (!descriptors.empty()) kept_descriptors.create(n, descriptors.cols, descriptors.type());
  for (int i = 0; i < n; ++i) {
    const int from = kept[static_cast<std::size_t>(i)];
    if (from != i)
      keypoints[static_cast<std::size_t>(i)] = keypoints[static_cast<std::size_t>(from)];
    if (!descriptors.empty())
      std::memcpy(kept_descriptors.ptr(i), descriptors.ptr(from),
                  descriptors.elemSize() * static_cast<std::size_t>(descriptors.cols));
  }
  keypoints.erase(keypoints.begin() + n, keypoints.end());
  descriptors = kept_descriptors;
  return true;
}

}  // namespace detail

/// The hook: leaves in `keypoints` (raw pixels, any type that KeypointTraits can read) and
/// `descriptors` (one row each, or empty) what is static in the frame of that timestamp, order
/// kept. Without a mask of that timestamp (to within 0.1 ms) it changes nothing and returns false,
/// so a host with the hook and no front end runs as ever. Never leaves fewer than the floor. O(n).
template <class Keypoints>
bool keep_static(double timestamp, Keypoints& keypoints, cv::Mat& descriptors) {
  return detail::keep_static(
      keypoints, descriptors, [&](const cv::Point2f* points, int count, int* kept) {
        return HostFrontEnd::select_by_timestamp(timestamp, points, count, kept);
      });
}

/// The same with the masks of one front end, for hosts that can carry it along.
template <class Keypoints>
bool keep_static(HostFrontEnd& front_end, double timestamp, Keypoints& keypoints,
                 cv::Mat& descriptors) {
  return detail::keep_static(keypoints, descriptors,
                             [&](const cv::Point2f* points, int count, int* kept) {
                               return front_end.select(timestamp, points, count, kept);
                             });
}

}  // namespace stillpoint
