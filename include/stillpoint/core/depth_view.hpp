// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "stillpoint/core/camera.hpp"
#include "stillpoint/core/frame.hpp"
#include "stillpoint/core/instance.hpp"
#include "stillpoint/core/lens.hpp"

namespace stillpoint {

/// The depth of a frame as the components read it: 16-bit units, 0 = no measurement, with the
/// rays of the camera. 16-bit images are not copied; CV_32FC1 is turned into millimetres once.
class DepthView {
 public:
  /// Closer than this, metres, cameras begin to measure nothing: a hole does not tell what is
  /// there.
  static constexpr float kSurelyMeasuredM = 1;

  /// Refers to the frame's data, which must outlive the view. O(1) for 16-bit depth, O(pixels) for
  /// 32F.
  void set(const RgbdFrame& frame, const Camera& camera) {
    const cv::Size size = frame.color.size();
    any_measured_.reset();
    lens_.set(camera, size);
    if (frame.depth.empty()) return clear();
    if (frame.depth.depth() == CV_16U) {
      image_ = frame.depth;
      metres_per_unit_ = metres_per_unit(frame);
      return;
    }
    metres_per_unit_ = 0.001f;
    converted_.create(size, CV_16UC1);
    for (int y = 0; y < size.height; ++y) {
      const float* in = frame.depth.ptr<float>(y);
      std::uint16_t* out = converted_.ptr<std::uint16_t>(y);
      // The comparison is false for NaN and infinity, too.
      for (int x = 0; x < size.width; ++x)
        out[x] = in[x] > 0 && in[x] < kLeastNoDepthM
                     ? static_cast<std::uint16_t>(static_cast<int>(in[x] * 1000.0f + 0.5f))
                     : std::uint16_t{0};
    }
    image_ = converted_;
  }

  /// Refers to nothing: every depth is "no measurement".
  void clear() { image_ = cv::Mat(), any_measured_ = false; }
  bool empty() const { return image_.empty(); }

  /// Whether any pixel is measured, asked of the instances' boxes first. The first call of a frame
  /// takes O(pixels of the boxes / 32) unless these are black.
  bool any_measured(const std::vector<Instance>& instances = {}) const {
    if (any_measured_) return *any_measured_;
    bool any = false;
    for (const Instance& s : instances) any |= glance(s.box);
    any = any || glance({cv::Point(), image_.size()});
    any_measured_ = any || cv::countNonZero(image_) > 0;
    return *any_measured_;
  }

  const std::uint16_t* row(int y) const { return image_.ptr<std::uint16_t>(y); }
  /// H x W, CV_16UC1, in units. Not to be written to: it may be the caller's.
  const cv::Mat& image() const { return image_; }
  cv::Size size() const { return image_.size(); }
  float metres_per_unit_value() const { return metres_per_unit_; }
  float to_m(std::uint16_t units) const { return units * metres_per_unit_; }
  /// The first unit at or beyond a depth in metres, clamped to 16 bits. With last_units() it says
  /// which depths lie in a range, the same ones in any coding: a hundredth of a millimetre of slack
  /// keeps rounding errors from deciding.
  int first_units(float metres) const {
    const float units = (metres - kSlackM) / metres_per_unit_;
    if (!(units > 0)) return 0;
    if (units > 65535) return 65535;
    const int below = static_cast<int>(units);
    return below + (static_cast<float>(below) < units ? 1 : 0);
  }
  /// The last unit at or before a depth in metres, clamped to 16 bits.
  int last_units(float metres) const {
    const float units = (metres + kSlackM) / metres_per_unit_;
    return !(units > 0) ? 0 : units > 65535 ? 65535 : static_cast<int>(units);
  }
  /// The camera's rays, those of the raw image.
  const Lens& lens() const { return lens_; }
  float focal_px() const { return lens_.fx(); }
  /// Ray (x / z, y / z) of a raw pixel.
  Eigen::Vector2f ray(const cv::Point& p) const {
    return lens_.ray(static_cast<float>(p.x), static_cast<float>(p.y));
  }

  /// Share of the image that is measured, by each 16th pixel of each 16th row.
  double measured_share() const {
    int measured = 0, seen = 0;
    for (int y = 8; y < image_.rows; y += 16)
      for (int x = 8; x < image_.cols; x += 16) ++seen, measured += row(y)[x] > 0;
    return seen > 0 ? static_cast<double>(measured) / seen : 0;
  }

 private:
  // Looks at one pixel of each line of memory of `part`; whether any of these is measured. Read
  // once in order, the part is at hand for reads here and there, each of which would have to wait
  // for it.
  bool glance(const cv::Rect& part) const {
    unsigned any = 0;
    for (int y = part.y; y < part.y + part.height; ++y) {
      const std::uint16_t* z = row(y);
      for (int x = part.x; x < part.x + part.width; x += 32) any |= z[x];
    }
    return any != 0;
  }

  static constexpr float kSlackM = 1e-5f;

  cv::Mat image_, converted_;
  mutable std::optional<bool> any_measured_ = false;  // empty: not yet known
  float metres_per_unit_ = 1;
  Lens lens_;
};

}  // namespace stillpoint
