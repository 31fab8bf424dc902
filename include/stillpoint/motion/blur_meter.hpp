// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <string>

#include "stillpoint/core/blur.hpp"
#include "stillpoint/core/camera.hpp"
#include "stillpoint/core/config.hpp"
#include "stillpoint/core/error.hpp"
#include "stillpoint/core/frame.hpp"

namespace stillpoint {

/// Settings of BlurMeter.
struct BlurMeterSettings {
  /// Exposure time, seconds. 0: the camera's (`exposure_ms` of its file); where it tells none, half
  /// of its frame interval, 0.5 / fps.
  double exposure_s = 0;

  /// Throws Error if a setting makes no sense.
  void check() const {
    if (!(exposure_s >= 0 && exposure_s < 10))
      throw Error("BlurMeterSettings.exposure_s: expected 0 to 10 s, found " +
                  std::to_string(exposure_s));
  }
};

/// Measures the motion blur of each picture, in two ways that know nothing of each other.
///
/// The motion: how far the camera's motion carries 48 points of the picture during the exposure.
/// The edges: where grey values differ over 12 pixels, how much of the difference lies in the 2
/// pixels in the middle. A blur of w pixels spreads it over w pixels, so the share of its square
/// sinks with 1 / w. Both sums are of the same edges: contrast cancels out. Lens and texture do
/// not, so the result is set against the sharpest of the last 10 s or so.
///
/// Cost: three rows of grey values in every 60 rows, about 10 us at 640 x 480. Deterministic, no
/// allocation after the first picture. Not thread-safe; one object per camera.
class BlurMeter {
 public:
  using Settings = BlurMeterSettings;

  /// `camera` is needed only for the motion.
  explicit BlurMeter(const Settings& settings = {}, const Camera& camera = {})
      : settings_(settings), camera_(camera) {
    settings.check();
  }

  /// Exposure time that motions are measured by, seconds.
  double exposure_s() const {
    if (settings_.exposure_s > 0) return settings_.exposure_s;
    return camera_.exposure_s > 0 ? camera_.exposure_s : 0.5 / camera_.fps;
  }

  /// Measures the next frame. `T_current_last` maps points of the last frame's camera into this
  /// one's; without it the motion is not known. The reference stays valid until the next call.
  const PictureBlur& measure(const RgbdFrame& frame,
                             const std::optional<Eigen::Isometry3d>& T_current_last) {
    check_frame(frame);
    const double since_s = frame.timestamp - last_s_;
    last_s_ = frame.timestamp;
    blur_.exposure_share = since_s > 0 && std::isfinite(since_s)
                               ? exposure_s() / since_s
                               : std::numeric_limits<double>::quiet_NaN();
    blur_.whole = Blur();
    if (T_current_last && camera_.valid())
      blur_.whole.motion_px = mean_way_px(frame, *T_current_last) * blur_.exposure_share;
    find_edges(frame.color);
    const double sharp = PictureBlur::ratio(blur_.total);
    if (std::isnan(sharp)) return blur_;
    double& reference = blur_.reference;
    // Slowly forgotten, as the camera comes to see other things; half way up at once, as one odd
    // picture must not blur all others.
    if (since_s > 0) reference *= std::exp(-since_s / kMemoryS);
    if (!(reference > 0))
      reference = sharp;
    else if (sharp > reference)
      reference += 0.5 * (sharp - reference);
    blur_.whole.sharpness = std::min(1.0, sharp / reference);
    return blur_;
  }

  /// What the last measure() returned.
  const PictureBlur& blur() const { return blur_; }

 private:
  static constexpr double kMemoryS = 10;
  static constexpr int kStep = 2, kReach = 12;  // the short and the long way, pixels
  static constexpr int kEdge = 32;              // of the sums of two pixels
  static constexpr int kWidth = PictureBlur::kBlockWidth, kHeight = PictureBlur::kBlockHeight;

  double mean_way_px(const RgbdFrame& frame, const Eigen::Isometry3d& T) const {
    constexpr int kAcross = 8, kDown = 6;
    double sum = 0;
    int n = 0;
    for (int j = 0; j < kDown; ++j)
      for (int i = 0; i < kAcross; ++i) {
        const int x = frame.color.cols * (2 * i + 1) / (2 * kAcross);
        const int y = frame.color.rows * (2 * j + 1) / (2 * kDown);
        const double z = static_cast<double>(depth_m_at(frame, x, y));
        Eigen::Vector3d p = T.linear() * camera_.unproject(x, y, 1);
        if (z > 0) p += T.translation() / z;
        if (!(p.z() > 0.1)) continue;
        sum += (camera_.project(p) - Eigen::Vector2d(x, y)).norm();
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

  // The same row of all blocks, one below the other, in grey values.
  struct Rows {
    const uchar* first;
    std::size_t step;
    const uchar* at(int y, int x) const {
      return first + static_cast<std::size_t>(y) * step + static_cast<std::size_t>(x);
    }
  };

  // Has the processor fetch a row: many at a time, where the conversion would wait for each.
  static void fetch(const cv::Mat& color, int y) {
    const uchar* row = color.ptr(y);
    const std::size_t bytes = static_cast<std::size_t>(color.cols) * color.elemSize();
    unsigned sum = 0;
    for (std::size_t i = 0; i < bytes; i += 64) sum += row[i];
    volatile unsigned read = sum;
    static_cast<void>(read);
  }

  Rows take_rows(const cv::Mat& color, int first, int count, cv::Mat& gray) const {
    const uchar* data = color.ptr(first);
    const std::size_t step = static_cast<std::size_t>(kHeight) * color.step[0];
    if (color.channels() == 1) return {data, step};
    cv::cvtColor(cv::Mat(count, color.cols, color.type(), const_cast<uchar*>(data), step), gray,
                 cv::COLOR_BGR2GRAY);
    return {gray.data, gray.step[0]};
  }

  void find_edges(const cv::Mat& color) {
    const int bands = color.rows / kHeight;
    blur_.columns = std::max(0, (color.cols - kReach - 1) / kWidth);
    blur_.blocks.assign(static_cast<std::size_t>(bands * blur_.columns), {});
    blur_.total = {};
    if (blur_.blocks.empty()) return;
    constexpr int kFirst = (kHeight - kReach) / 2;
    for (const int k : {0, kStep, kReach})
      for (int y = 0; y < bands; ++y) fetch(color, y * kHeight + kFirst + k);
    const Rows at = take_rows(color, kFirst, bands, gray_[0]);
    const Rows step = take_rows(color, kFirst + kStep, bands, gray_[1]);
    const Rows end = take_rows(color, kFirst + kReach, bands, gray_[2]);
    for (int y = 0; y < bands; ++y)
      for (int x = 0; x < blur_.columns; ++x) {
        PictureBlur::Edges& e = blur_.blocks[static_cast<std::size_t>(y * blur_.columns + x)];
        const int u = x * kWidth;
        compare(at.at(y, u), at.at(y, u + kStep), at.at(y, u + kReach), e.short_x, e.long_x);
        compare(at.at(y, u), step.at(y, u), end.at(y, u), e.short_y, e.long_y);
        blur_.total += e;
      }
  }

  Settings settings_;
  Camera camera_;
  PictureBlur blur_;
  std::array<cv::Mat, 3> gray_;
  double last_s_ = std::numeric_limits<double>::quiet_NaN();
};

}  // namespace stillpoint
