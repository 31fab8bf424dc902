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
#include "stillpoint/depth/floor_plane.hpp"

namespace stillpoint {

/// Notices a wrong depth factor (units per metre) by what the first second of a recording shows.
///
/// Images alone cannot tell: with all depths five times too large, the camera moves five times too
/// far, and everything agrees. What tells is what rooms, people and sensors are like:
///  - the distances in a room where a camera is held, driven or flown (nearest, median, farthest);
///  - the height of people whose box lies inside the image;
///  - the height of the camera above the floor, where one is seen;
///  - the steps of structured light (Kinect v1, Xtion), which are 2.9 to 3.2 mm at 1 m and grow
///  with
///    the square of the distance;
///  - files of 5000 units per metre that were made of whole millimetres: all multiples of five;
///  - a path that is metric, if add_motion() is told of one: it alone decides.
/// The factors in use (5000, 1000, 10000, 1) are compared with the given one; a better one must be
/// better by far. A scene with all surfaces at 0.3 m that was read with 5000 is called wrong unless
/// its values or steps say otherwise. A factor wrong by two is noticed by Kinect's steps or a
/// metric path only.
class DepthScaleCheck {
 public:
  /// `camera`: for the heights of people and above the floor; its focal length may be 0 (unknown).
  explicit DepthScaleCheck(const Camera& camera = {}) : camera_(camera) {}

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
    // Stereo cameras with half of its steps (RealSense D435, read with half of the right factor)
    // see another angle.
    has_kinect_lens_ = std::abs(camera_.fx / frame.depth.cols - 0.84) < 0.06;
    add_floor(frame);
    for (const Instance& person : instances)
      if (person.class_name == "person") add_person(frame, person);
  }

  /// How far the camera moved between two frames: by what was tracked with this depth, and by a
  /// metric source (ground truth, wheel odometry), metres. Metric distances under 0.1 m are passed
  /// over. Five that agree decide. O(1).
  void add_motion(double tracked_m, double metric_m) {
    if (metric_m >= 0.1 && tracked_m > 0)
      too_far_.push_back(static_cast<float>(tracked_m / metric_m));
  }

  /// True once a frame came that is more than a second after the first one.
  bool is_over(double timestamp) const { return frames_ > 0 && timestamp - first_s_ > 1; }

  /// What is wrong with the factor, with the one that would fit; nothing if all is well, or nothing
  /// was measured. O(n) in the pixels seen.
  std::optional<std::string> problem() const {
    if (depths_m_.empty()) return std::nullopt;
    const Scene given = scene();
    const bool has_path = given.too_far > 0;
    if (has_path && std::abs(std::log(given.too_far)) < std::log(kPathOff)) return std::nullopt;
    const double doubt = doubt_of(given, 1);
    double best = doubt, best_units = 0;
    for (const double units : kInUse) {
      const double d = doubt_of(given, units_per_m_ / units);
      if (d < best) best = d, best_units = units;
    }
    const bool better = best_units > 0 && doubt - best > kBetter;
    if (!better && doubt < kSenseless && !has_path) return std::nullopt;
    return message(given, better ? best_units : 0);
  }

 private:
  // Also a float of 65 m or more, which is no measurement elsewhere: it may be millimetres.
  static float stored_depth_m(const RgbdFrame& frame, int x, int y) {
    if (frame.depth.depth() == CV_16U) return depth_m_at(frame, x, y);
    const float z = frame.depth.at<float>(y, x);
    return std::isfinite(z) && z > 0 ? z : 0;
  }

  static constexpr std::array<double, 4> kInUse{5000, 1000, 10000, 1};
  static constexpr double kPathOff = 1.5;      // less is what a tracker can make of people
  static constexpr double kBetter = 8;         // a difference of doubts; see doubt_of()
  static constexpr double kSenseless = 90;     // of 120 by the distances
  static constexpr double kKinectStep = 3e-3;  // 1 / (8 * 525 to 580 px * 0.075 m), 1 / m

  struct Scene {
    double near_m = 0, median_m = 0, far_m = 0;
    /// Median height of people, metres; 0: none was seen.
    double person_m = 0;
    /// Median height of the camera above the floor, metres; 0: no floor was seen.
    double floor_m = 0;
    /// How many times too far the camera is tracked to move; 0: not known, or motions disagree.
    double too_far = 0;
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
        const float z = stored_depth_m(frame, x, y);
        if (!(z > 0)) continue;
        if (units) seen_[frame.depth.at<std::uint16_t>(y, x)] = 1;
        if (n++ % 5 == 0) depths_m_.push_back(z);
      }
  }

  // The plane is sought with the median depth as the unit: whatever the factor, the same is found.
  void add_floor(const RgbdFrame& frame) {
    if (!(camera_.fx > 0 && camera_.fy > 0)) return;
    constexpr int kStep = 16;
    std::vector<InverseSample> samples;
    std::vector<float> depths;
    for (int y = kStep / 2; y < frame.depth.rows; y += kStep)
      for (int x = kStep / 2; x < frame.depth.cols; x += kStep) {
        const float z = stored_depth_m(frame, x, y);
        if (!(z > 0)) continue;
        depths.push_back(z);
        samples.push_back({static_cast<float>((x - camera_.cx) / camera_.fx),
                           static_cast<float>((y - camera_.cy) / camera_.fy), 1 / z});
      }
    if (depths.empty()) return;
    const double unit = quantile(depths, 0.5) / 2.4;  // find_floor() expects a room in metres
    for (InverseSample& s : samples) s.inverse *= static_cast<float>(unit);
    const InversePlane floor = find_floor(samples, {}, 1);
    if (floor.found)
      floors_m_.push_back(static_cast<float>(unit / static_cast<double>(floor.n.norm())));
  }

  // Who is cut off by the border, or far too narrow a box, says nothing.
  void add_person(const RgbdFrame& frame, const Instance& person) {
    const cv::Rect& box = person.box;
    const bool inside =
        box.x > 0 && box.y > 0 && box.br().x < frame.depth.cols && box.br().y < frame.depth.rows;
    if (!inside || !(camera_.fy > 0) || box.height < frame.depth.rows / 8 ||
        box.height < 2 * box.width)
      return;
    std::vector<float> depths;
    for (int y = box.y; y < box.br().y; ++y)
      for (int x = box.x; x < box.br().x; ++x) {
        if (!person.mask.empty() && person.mask.at<uchar>(y - box.y, x - box.x) == 0) continue;
        if (const float z = stored_depth_m(frame, x, y); z > 0) depths.push_back(z);
      }
    if (depths.size() * 4 < static_cast<std::size_t>(box.area())) return;
    people_m_.push_back(static_cast<float>(quantile(depths, 0.5) * box.height / camera_.fy));
  }

  static double quantile(std::vector<float>& values, double share) {
    const auto at = values.begin() +
                    static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), at, values.end());
    return static_cast<double>(*at);
  }

  Scene scene() const {
    Scene s;
    std::vector<float> depths = depths_m_, people = people_m_, floors = floors_m_;
    s.near_m = quantile(depths, 0.01);
    s.median_m = quantile(depths, 0.5);
    s.far_m = quantile(depths, 0.95);
    if (!people.empty()) s.person_m = quantile(people, 0.5);
    if (!floors.empty()) s.floor_m = quantile(floors, 0.5);
    s.too_far = too_far();
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
    if (s.floor_m > 0) doubt += off(s.floor_m, 1.2, 0.5);
    if (s.too_far > 0) doubt += off(s.too_far, 1, 0.35);
    if (s.step_m > 0 && std::abs(std::log(s.step_m / scale / kKinectStep)) < 0.25)
      doubt -= has_kinect_lens_ ? 14 : 8;
    if (s.multiples_of_five && std::abs(units_per_m_ / scale - 5000) < 1e-6) doubt -= 30;
    return doubt;
  }

  std::string message(const Scene& s, double better_units) const {
    std::string text = "the depth factor (DepthMapFactor, units per metre) of " +
                       plain(units_per_m_) + " is likely wrong: with it half of the scene is " +
                       "nearer than " + rounded(s.median_m) + " m and the nearest at " +
                       rounded(s.near_m) + " m";
    if (s.person_m > 0) text += ", people are " + rounded(s.person_m) + " m tall";
    if (s.floor_m > 0) text += ", the camera is " + rounded(s.floor_m) + " m above the floor";
    if (s.too_far > 0)
      text += ", the tracked path is " + rounded(s.too_far) + " times as long as the metric one";
    if (!stored_in_units_) {
      text += "; 32-bit depth must be in metres";
      if (better_units > 0)
        text += better_units == 1000 ? ", and this looks like millimetres"
                                     : ", and this looks like other units";
      return text;
    }
    if (better_units > 0) {
      const double scale = units_per_m_ / better_units;
      return text + "; " + plain(better_units) + " would give " + rounded(s.median_m * scale) +
             " m and " + rounded(s.near_m * scale) + " m";
    }
    if (s.too_far > 0) text += "; about " + rounded(units_per_m_ * s.too_far) + " would fit";
    return text;
  }

  double too_far() const {
    if (too_far_.size() < 5) return 0;
    std::vector<float> ratios = too_far_;
    const double median = quantile(ratios, 0.5);
    const auto agree = std::count_if(ratios.begin(), ratios.end(),
                                     [&](float r) { return std::abs(std::log(r / median)) < 0.1; });
    return static_cast<std::size_t>(agree) * 5 >= ratios.size() * 4 ? median : 0;
  }

  static std::string plain(double v) {
    std::ostringstream text;
    text.imbue(std::locale::classic());
    text.precision(10);
    text << v;
    return text.str();
  }

  /// To three digits.
  static std::string rounded(double v) {
    const double step = std::pow(10, std::floor(std::log10(v)) - 2);
    return plain(std::round(v / step) * step);
  }

  Camera camera_;
  int frames_ = 0;
  double first_s_ = 0, last_s_ = 0, units_per_m_ = 1;
  bool stored_in_units_ = true, has_kinect_lens_ = false;
  std::vector<float> depths_m_, people_m_, floors_m_, too_far_;
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
