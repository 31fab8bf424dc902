// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <locale>
#include <opencv2/core.hpp>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "stillpoint/core/camera.hpp"
#include "stillpoint/core/frame.hpp"
#include "stillpoint/core/instance.hpp"

namespace stillpoint {

/// Notices a wrong depth factor (units per metre) by what the first second of a recording shows.
///
/// Images alone cannot tell: with all depths five times too large, the camera moves five times too
/// far, and everything agrees. What tells is what rooms, people and sensors are like:
///  - the distances in a room where a camera is held, driven or flown (nearest, median, farthest);
///  - the height of people whose box lies inside the image;
///  - the steps of structured light and stereo (Kinect v1, Xtion), which are 2.87 mm at 1 m and
///  grow
///    with the square of the distance;
///  - files of 5000 units per metre that were made of whole millimetres: all multiples of five.
/// The factors in use (5000, 1000, 10000, 1) are compared with the given one; a better one must be
/// better by far. A scene with all surfaces at 0.3 m that was read with 5000 is called wrong unless
/// its values or steps say otherwise.
class DepthScaleCheck {
 public:
  /// `camera`: for the height of people; its focal length may be 0 (unknown).
  explicit DepthScaleCheck(const Camera& camera = {}) : fy_(camera.fy) {}

  /// Looks at a frame, and at the people in it (instances of the class "person", or none). Frames
  /// after the first second, and those less than 0.1 s after the last one, are passed over.
  /// O(pixels).
  void add(const RgbdFrame& frame, const std::vector<Instance>& instances = {}) {
    if (frames_ > 0 && (frame.timestamp - first_s_ > 1 || frame.timestamp - last_s_ < 0.1)) return;
    if (frame.depth.empty() || (frame.depth.depth() != CV_16U && frame.depth.depth() != CV_32F))
      return;
    const std::size_t before = depths_m_.size();
    read(frame);
    if (depths_m_.size() == before) return;
    if (frames_++ == 0) {
      first_s_ = frame.timestamp;
      stored_in_units_ = frame.depth.depth() == CV_16U;
      units_per_m_ = stored_in_units_ ? frame.depth_units_per_m : 1;
    }
    last_s_ = frame.timestamp;
    for (const Instance& person : instances)
      if (person.class_name == "person") add_person(frame, person);
  }

  /// True once a frame came that is more than a second after the first one.
  bool is_over(double timestamp) const { return frames_ > 0 && timestamp - first_s_ > 1; }

  /// What is wrong with the factor, with the one that would fit; nothing if all is well, or nothing
  /// was measured. O(n) in the pixels seen.
  std::optional<std::string> problem() const {
    if (depths_m_.empty()) return std::nullopt;
    const Scene given = scene();
    const double doubt = doubt_of(given, 1);
    double best = doubt, best_units = 0;
    for (const double units : {5000.0, 1000.0, 10000.0, 1.0}) {
      const double d = doubt_of(given, units_per_m_ / units);
      if (d < best) best = d, best_units = units;
    }
    const bool better = best_units > 0 && doubt - best > kBetter;
    if (!better && doubt < kSenseless) return std::nullopt;
    return message(given, better ? best_units : 0);
  }

 private:
  static constexpr double kBetter = 8;            // a difference of doubts; see doubt_of()
  static constexpr double kSenseless = 90;        // of 120 by the distances
  static constexpr double kKinectStep = 2.87e-3;  // 1 / (8 * 580 px * 0.075 m), 1 / m

  struct Scene {
    double near_m = 0, median_m = 0, far_m = 0;
    /// Median height of people, metres; 0: none was seen.
    double person_m = 0;
    /// Step of the depth at 1 m, metres, if it grows with the square; else 0.
    double step_m = 0;
    bool multiples_of_five = false;
  };

  void read(const RgbdFrame& frame) {
    const bool units = frame.depth.depth() == CV_16U;
    if (units && seen_.empty()) seen_.assign(1 << 16, 0);
    std::size_t n = 0;
    for (int y = 0; y < frame.depth.rows; ++y)
      for (int x = 0; x < frame.depth.cols; ++x) {
        const float z = depth_m_at(frame, x, y);
        if (!(z > 0)) continue;
        if (units) seen_[frame.depth.at<std::uint16_t>(y, x)] = 1;
        if (n++ % 5 == 0) depths_m_.push_back(z);
      }
  }

  // Who is cut off by the border, or far too narrow a box, says nothing.
  void add_person(const RgbdFrame& frame, const Instance& person) {
    const cv::Rect& box = person.box;
    const bool inside =
        box.x > 0 && box.y > 0 && box.br().x < frame.depth.cols && box.br().y < frame.depth.rows;
    if (!inside || !(fy_ > 0) || box.height < frame.depth.rows / 8 || box.height < 2 * box.width)
      return;
    std::vector<float> depths;
    for (int y = box.y; y < box.br().y; ++y)
      for (int x = box.x; x < box.br().x; ++x) {
        if (!person.mask.empty() && person.mask.at<uchar>(y - box.y, x - box.x) == 0) continue;
        if (const float z = depth_m_at(frame, x, y); z > 0) depths.push_back(z);
      }
    if (depths.size() * 4 < static_cast<std::size_t>(box.area())) return;
    people_m_.push_back(static_cast<float>(quantile(depths, 0.5) * box.height / fy_));
  }

  static double quantile(std::vector<float>& values, double share) {
    const auto at = values.begin() +
                    static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), at, values.end());
    return static_cast<double>(*at);
  }

  Scene scene() const {
    Scene s;
    std::vector<float> depths = depths_m_, people = people_m_;
    s.near_m = quantile(depths, 0.01);
    s.median_m = quantile(depths, 0.5);
    s.far_m = quantile(depths, 0.95);
    if (!people.empty()) s.person_m = quantile(people, 0.5);
    if (!stored_in_units_) return s;
    s.step_m = step_m(s);
    std::size_t values = 0, fives = 0, tens = 0;
    for (std::size_t v = 1; v < seen_.size(); ++v)
      if (seen_[v]) ++values, fives += v % 5 == 0, tens += v % 10 == 0;
    s.multiples_of_five = values >= 50 && fives == values && tens < values * 9 / 10;
    return s;
  }

  // By the number of different values between two distances; both halves of that range of inverse
  // depth must have as many.
  double step_m(const Scene& s) const {
    const double w0 = 1 / s.far_m, w1 = 1 / s.near_m, middle = (w0 + w1) / 2;
    std::array<double, 2> values{0, 0};
    for (std::size_t v = 1; v < seen_.size(); ++v) {
      const double w = units_per_m_ / static_cast<double>(v);
      if (seen_[v] && w >= w0 && w <= w1) ++values[w < middle ? 0 : 1];
    }
    if (values[0] < 20 || values[1] < 20 || values[0] > 1.5 * values[1] ||
        values[1] > 1.5 * values[0])
      return 0;
    return (w1 - w0) / (values[0] + values[1]);
  }

  /// How much speaks against all depths being `scale` times what they are now: squared deviations
  /// in sigmas from what rooms and people are like, less what the sensor's steps speak for it.
  double doubt_of(const Scene& s, double scale) const {
    const auto off = [&](double found, double expected, double sigma) {
      const double d = std::log(found * scale / expected) / sigma;
      return std::min(40.0, d * d);
    };
    double doubt = off(s.near_m, 1.2, 0.5) + off(s.median_m, 2.4, 0.5) + off(s.far_m, 4, 0.5);
    if (s.person_m > 0) doubt += off(s.person_m, 1.4, 0.35);
    if (s.step_m > 0 && std::abs(std::log(s.step_m / scale / kKinectStep)) < 0.3) doubt -= 8;
    if (s.multiples_of_five && std::abs(units_per_m_ / scale - 5000) < 1e-6) doubt -= 30;
    return doubt;
  }

  std::string message(const Scene& s, double better_units) const {
    std::ostringstream out;
    out.imbue(std::locale::classic());
    out.precision(3);
    const auto plain = [](double v) {
      std::ostringstream text;
      text.imbue(std::locale::classic());
      text.precision(10);
      text << v;
      return text.str();
    };
    out << "the depth factor (DepthMapFactor, units per metre) of " << plain(units_per_m_)
        << " is likely wrong: with it half of the scene is nearer than "
        << plain(rounded(s.median_m)) << " m and the nearest at " << plain(rounded(s.near_m))
        << " m";
    if (s.person_m > 0) out << ", people are " << plain(rounded(s.person_m)) << " m tall";
    if (!stored_in_units_) out << "; 32-bit depth must be in metres";
    if (better_units <= 0) return out.str();
    if (!stored_in_units_) {
      out << ", and this looks like " << (better_units == 1000 ? "millimetres" : "other units");
      return out.str();
    }
    const double scale = units_per_m_ / better_units;
    out << "; " << plain(better_units) << " would give " << plain(rounded(s.median_m * scale))
        << " m and " << plain(rounded(s.near_m * scale)) << " m";
    return out.str();
  }

  /// To three digits.
  static double rounded(double v) {
    const double step = std::pow(10, std::floor(std::log10(v)) - 2);
    return std::round(v / step) * step;
  }

  double fy_ = 0;
  int frames_ = 0;
  double first_s_ = 0, last_s_ = 0, units_per_m_ = 1;
  bool stored_in_units_ = true;
  std::vector<float> depths_m_, people_m_;
  std::vector<char> seen_;  // the values of 16-bit depth
};

/// The same for a single frame. Returns the message, with the factor that would fit, or nothing:
/// all is well, or there is no measurement to judge by. O(pixels).
inline std::optional<std::string> check_depth_scale(const RgbdFrame& frame) {
  DepthScaleCheck check;
  check.add(frame);
  return check.problem();
}

}  // namespace stillpoint
