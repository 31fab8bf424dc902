// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <opencv2/core.hpp>
#include <optional>

#include "stillpoint/core/blur.hpp"
#include "stillpoint/core/camera.hpp"
#include "stillpoint/core/config.hpp"
#include "stillpoint/core/frame_context.hpp"
#include "stillpoint/motion/blur_meter_settings.hpp"

namespace stillpoint {

/// Measures the motion blur of each image, in two ways that know nothing of each other.
///
/// The motion: how far the camera's motion carries 48 points of the image during the exposure.
/// The edges: where grey values differ over 12 pixels, how much of the difference lies in the
/// first 2 of them. A blur of w pixels spreads it over w pixels, so the share of its square
/// sinks with 1 / w. Both sums are of the same edges: contrast cancels out. Lens and texture do
/// not, so the result is set against the sharpest of the last 10 s or so.
///
/// Cost: about 10 us at 640 x 480, and the conversion of a twentieth of the rows to grey.
/// Deterministic, no allocation after the first image. Not thread-safe; one object per camera.
class BlurMeter {
 public:
  using Settings = BlurMeterSettings;

  /// Of `camera` the motion is measured by; without it only `fps` counts. Throws Error for settings
  /// or an `fps` that make no sense.
  explicit BlurMeter(const Settings& settings = {}, const Camera& camera = {})
      : settings_(settings), camera_(camera) {
    settings.check();
    detail::check(camera.fps > 0 && std::isfinite(camera.fps), [&] {
      return "camera.fps: expected frames per second, more than 0 (30 where it is not known), "
             "found " +
             std::to_string(camera.fps);
    });
  }

  /// Exposure time that motions are measured by, seconds.
  double exposure_s() const {
    if (settings_.exposure_s > 0) return settings_.exposure_s;
    return camera_.exposure_s > 0 ? camera_.exposure_s : 0.5 / camera_.fps;
  }

  /// Measures the frame of a context, and writes its `blur`. Without `T_current_last` the motion is
  /// not known.
  void measure(FrameContext& context) {
    const double since_s = context.frame.timestamp - last_s_;
    last_s_ = context.frame.timestamp;
    blur_.exposure_share = since_s > 0 && std::isfinite(since_s)
                               ? exposure_s() / since_s
                               : std::numeric_limits<double>::quiet_NaN();
    blur_.whole = Blur();
    if (context.T_current_last && camera_.valid())
      blur_.whole.motion_px = mean_displacement_px(context) * blur_.exposure_share;
    find_edges(context);
    learn_sharpness(since_s);
    context.blur = blur_;
  }

  /// The same for a frame alone; the reference stays valid until the next call.
  const ImageBlur& measure(const RgbdFrame& frame,
                           const std::optional<Eigen::Isometry3d>& T_current_last) {
    own_context_.begin(frame, camera_);
    own_context_.T_current_last = T_current_last;
    measure(own_context_);
    return blur_;
  }

 private:
  void learn_sharpness(double since_s) {
    double& reference = blur_.reference;
    // Slowly forgotten, as the camera comes to see other things, and at once where time goes back;
    // half way up at once, as one odd image must not blur all others.
    reference *= since_s > 0 ? std::exp(-since_s / kMemoryS) : 0;
    const double sharp = ImageBlur::ratio(blur_.total);
    if (std::isnan(sharp)) return;
    if (!(reference > 0))
      reference = sharp;
    else if (sharp > reference)
      reference += 0.5 * (sharp - reference);
    blur_.whole.sharpness = std::min(1.0, sharp / reference);
  }

  static constexpr double kMemoryS = 10;
  static constexpr int kStep = 2, kReach = 12;  // the short and the long distance, pixels
  static constexpr int kEdge = 32;              // of the sums of two pixels
  static constexpr int kWidth = ImageBlur::kBlockWidth, kHeight = ImageBlur::kBlockHeight;

  static double mean_displacement_px(const FrameContext& context) {
    constexpr int kAcross = 8, kDown = 6;
    const Lens& lens = context.depth.lens();
    const Eigen::Matrix3f R = context.T_current_last->linear().cast<float>();
    const Eigen::Vector3f t = context.T_current_last->translation().cast<float>();
    double sum = 0;
    int n = 0;
    for (int j = 0; j < kDown; ++j)
      for (int i = 0; i < kAcross; ++i) {
        const int x = context.size().width * (2 * i + 1) / (2 * kAcross);
        const int y = context.size().height * (2 * j + 1) / (2 * kDown);
        const Eigen::Vector2f pixel(static_cast<float>(x), static_cast<float>(y));
        const float z = depth_m_at(context.frame, x, y);
        Eigen::Vector3f p = R * lens.ray(pixel.x(), pixel.y()).homogeneous();
        if (z > 0) p += t / z;
        if (!(p.z() > 0.1f)) continue;
        sum += static_cast<double>((lens.pixel(p.hnormalized()) - pixel).norm());
        ++n;
      }
    return n > 0 ? sum / n : std::numeric_limits<double>::quiet_NaN();
  }

  // Sums the squares of the differences at..step and at..end of kWidth neighboring places, where
  // the latter is an edge. Each value is the sum of two pixels in a row, which takes noise away.
  static void compare(const uchar* STILLPOINT_RESTRICT at, const uchar* STILLPOINT_RESTRICT step,
                      const uchar* STILLPOINT_RESTRICT end, std::int64_t& short_sum,
                      std::int64_t& long_sum) {
    std::array<std::int16_t, kWidth> steps, edges;
    for (std::size_t i = 0; i < kWidth; ++i) {
      const int here = at[i] + at[i + 1];
      steps[i] = static_cast<std::int16_t>(step[i] + step[i + 1] - here);
      edges[i] = static_cast<std::int16_t>(end[i] + end[i + 1] - here);
    }
    std::int32_t sum = 0, edge_sum = 0;
    for (std::size_t i = 0; i < kWidth; ++i) {
      // All bits where the edge is stronger than kEdge, else none.
      const std::int16_t size = std::max(edges[i], static_cast<std::int16_t>(-edges[i]));
      const std::int16_t counts =
          static_cast<std::int16_t>(static_cast<std::int16_t>(kEdge - size) >> 15);
      const std::int16_t e = static_cast<std::int16_t>(edges[i] & counts);
      const std::int16_t s = static_cast<std::int16_t>(steps[i] & counts);
      edge_sum += e * e, sum += s * s;
    }
    short_sum += sum, long_sum += edge_sum;
  }

  void find_edges(const FrameContext& context) {
    const int bands = context.size().height / kHeight;
    blur_.columns = std::max(0, (context.size().width - kReach - 1) / kWidth);
    blur_.blocks.assign(static_cast<std::size_t>(bands * blur_.columns), {});
    blur_.total = {};
    constexpr int kFirst = (kHeight - kReach) / 2;
    for (int y = 0; y < bands; ++y) {
      const int first = y * kHeight + kFirst;
      const uchar* row = context.gray_row(first);
      const uchar* step = context.gray_row(first + kStep);
      const uchar* end = context.gray_row(first + kReach);
      for (int x = 0; x < blur_.columns; ++x) {
        ImageBlur::Edges& e = blur_.blocks[static_cast<std::size_t>(y * blur_.columns + x)];
        const uchar* at = row + x * kWidth;
        compare(at, at + kStep, at + kReach, e.short_x, e.long_x);
        compare(at, step + x * kWidth, end + x * kWidth, e.short_y, e.long_y);
        blur_.total += e;
      }
    }
  }

  Settings settings_;
  Camera camera_;
  FrameContext own_context_;
  ImageBlur blur_;
  double last_s_ = std::numeric_limits<double>::quiet_NaN();
};

}  // namespace stillpoint
