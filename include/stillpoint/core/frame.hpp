// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <opencv2/core.hpp>
#include <string>

#include "stillpoint/core/camera.hpp"
#include "stillpoint/core/error.hpp"

namespace stillpoint {

/// Color and depth that were taken further apart, seconds, do not belong together, or their clocks
/// differ.
constexpr double kMostDepthOffsetS = 0.5;
/// No timestamp is as late, the year 5138; milliseconds since 1970 have been beyond it since 1973.
constexpr double kLatestS = 1e11;

/// One image of an RGB-D camera. cv::Mat members share their data: copying a frame is cheap.
struct RgbdFrame {
  /// H x W, CV_8UC3 (BGR, as OpenCV loads it) or CV_8UC1 (grey).
  cv::Mat color;
  /// H x W, CV_16UC1 in `depth_units_per_m`, or CV_32FC1 in metres, or empty (a camera without
  /// depth). 0 and NaN mean "no measurement", and so does a float of 65 m or more.
  cv::Mat depth;
  /// Seconds; any origin, one clock for the whole run.
  double timestamp = 0;
  /// Units of a 16-bit depth image per metre, 1 or more (5000: TUM, Bonn; 1000: millimetres). Not
  /// used for CV_32FC1.
  double depth_units_per_m = 5000;
  /// When the depth was measured, seconds of the same clock, at most kMostDepthOffsetS from
  /// `timestamp`; NaN: with the color. Kinects take the two up to 17 ms apart, and a camera that
  /// turns at 200 deg/s turns 3 degrees in that time.
  double depth_timestamp = std::numeric_limits<double>::quiet_NaN();
  /// H x W, CV_8UC1: `color` in grey, if it is there anyway, as before a host's keypoints. Empty:
  /// it is converted, at 1 % of the cost of the keypoints.
  cv::Mat gray{};

  /// When the depth was measured, as far as is known.
  double depth_time() const { return std::isnan(depth_timestamp) ? timestamp : depth_timestamp; }
  /// The grey image where nothing needs to be converted: `gray`, or `color` of one channel; else an
  /// empty one.
  const cv::Mat& given_gray() const { return gray.empty() && color.channels() == 1 ? color : gray; }
};

/// From here on a float depth is no measurement, metres.
constexpr float kLeastNoDepthM = 65;

/// Metres per stored unit of `frame.depth`.
inline float metres_per_unit(const RgbdFrame& frame) {
  return frame.depth.depth() == CV_16U ? static_cast<float>(1.0 / frame.depth_units_per_m) : 1.0f;
}

/// Depth at (x, y) in metres; 0 where there is no measurement. The pixel must lie in the image.
inline float depth_m_at(const RgbdFrame& frame, int x, int y) {
  if (frame.depth.empty()) return 0;
  if (frame.depth.depth() == CV_16U)
    return static_cast<float>(frame.depth.at<std::uint16_t>(y, x) / frame.depth_units_per_m);
  const float z = frame.depth.at<float>(y, x);
  return z > 0 && z < kLeastNoDepthM ? z : 0;
}

namespace detail {

inline std::string size_text(const cv::Mat& m) {
  return std::to_string(m.cols) + "x" + std::to_string(m.rows);
}

inline std::string type_text(const cv::Mat& m) {
  static const char* const names[] = {"8U", "8S", "16U", "16S", "32S", "32F", "64F", "16F"};
  return "CV_" + std::string(names[m.depth()]) + "C" + std::to_string(m.channels());
}

/// Throws Error if the time of two frames in a row is 0: nobody set it, and history would be
/// forgotten in each frame.
inline void check_time_is_set(double last_s, double now_s) {
  check(last_s != 0 || now_s != 0, [] {
    return std::string(
        "frame.timestamp: expected seconds that grow from frame to frame, found 0 twice in a row; "
        "set it to the camera's time, or to the frame's number divided by the frame rate");
  });
}

}  // namespace detail

/// Throws Error unless the frame has the shape and coding written at RgbdFrame. O(1).
inline void check_frame(const RgbdFrame& frame) {
  using detail::size_text;
  using detail::type_text;
  detail::check(!frame.color.empty(),
                [] { return std::string("frame.color: expected an image, found an empty one"); });
  detail::check(frame.color.type() == CV_8UC3 || frame.color.type() == CV_8UC1, [&] {
    return "frame.color: expected CV_8UC3 (BGR) or CV_8UC1, found " + type_text(frame.color);
  });
  detail::check(std::abs(frame.timestamp) < kLatestS, [&] {
    return "frame.timestamp: expected seconds, found " + std::to_string(frame.timestamp) +
           (std::isfinite(frame.timestamp) ? "; divide milliseconds by 1e3, nanoseconds by 1e9"
                                           : "");
  });
  detail::check(frame.gray.empty() ||
                    (frame.gray.type() == CV_8UC1 && frame.gray.size() == frame.color.size()),
                [&] {
                  return "frame.gray: expected CV_8UC1 of the size of frame.color, " +
                         size_text(frame.color) + ", found " + type_text(frame.gray) + " " +
                         size_text(frame.gray);
                });
  if (frame.depth.empty()) return;
  detail::check(std::abs(frame.depth_time() - frame.timestamp) <= kMostDepthOffsetS, [&] {
    return "frame.depth_timestamp: expected seconds of the clock of frame.timestamp, " +
           std::to_string(frame.timestamp) + ", at most " + std::to_string(kMostDepthOffsetS) +
           " s away, or NaN where it is not known, found " + std::to_string(frame.depth_timestamp);
  });
  detail::check(frame.depth.type() == CV_16UC1 || frame.depth.type() == CV_32FC1, [&] {
    return "frame.depth: expected CV_16UC1 or CV_32FC1 (metres), found " + type_text(frame.depth);
  });
  detail::check(frame.depth.size() == frame.color.size(), [&] {
    return "frame.depth: expected the size of frame.color, " + size_text(frame.color) + ", found " +
           size_text(frame.depth);
  });
  const double units = frame.depth_units_per_m;
  detail::check(frame.depth.depth() != CV_16U || (units >= 1 && std::isfinite(units)), [&] {
    return "frame.depth_units_per_m: expected units per metre, 1 or more (5000 for TUM, 1000 for "
           "millimetres), found " +
           std::to_string(units);
  });
}

/// The same, and the images must have the camera's width and height, where it has them. A camera
/// of another resolution gives wrong places and motions, and nothing else would say so. O(1).
inline void check_frame(const RgbdFrame& frame, const Camera& camera) {
  check_frame(frame);
  const cv::Size size(camera.width, camera.height);
  detail::check(size.empty() || frame.color.size() == size, [&] {
    return "frame.color: expected the camera's size " + std::to_string(size.width) + "x" +
           std::to_string(size.height) + ", found " + detail::size_text(frame.color) +
           "; is it the right camera? Where images are resized, resize it with them: "
           "Camera::resized()";
  });
}

}  // namespace stillpoint
