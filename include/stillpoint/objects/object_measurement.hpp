// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "stillpoint/core/depth_view.hpp"
#include "stillpoint/core/instance.hpp"
#include "stillpoint/sensor/sensor_model.hpp"

namespace stillpoint {

/// Where one frame shows an object.
struct ObjectMeasurement {
  /// Which instance of the frame it is.
  std::size_t instance = 0;
  /// Median depth, metres; 0: not measured, and then what follows is 0, too.
  float depth_m = 0;
  /// Centroid of the visible surface in the camera's frame, metres, and its covariance.
  Eigen::Vector3d centroid = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  /// Pixels of the mask and their centre, as far as its samples tell.
  double area_px = 0;
  cv::Point2f center_px;
};

/// Measures objects by those of 400 to 1600 pixels of each box that are on the mask. O(1) per
/// object, no allocation after the first ones. Not thread-safe.
class ObjectMeter {
 public:
  /// `centroid_m`: how far the centroid wanders on the object, see ObjectTrackerSettings.
  ObjectMeter(const SensorModel& sensor, double centroid_m)
      : sensor_(sensor), centroid_m_(centroid_m) {
    pixels_.reserve(kMostSamples), depths_.reserve(kMostSamples);
  }

  /// Measures each object of a frame once: an instance without a name, or one that was carried here
  /// from earlier frames, is the same object as another one where the greater part of either lies
  /// on the other, or both are at one place. `depth` may be empty. In the order of the instances;
  /// the reference stays valid until the next call. O(instances^2).
  const std::vector<ObjectMeasurement>& measure(const DepthView& depth,
                                                const std::vector<Instance>& instances) {
    order_by_size(instances);
    measured_.clear();
    for (const std::size_t i : order_) {
      ObjectMeasurement m = measure(depth, instances[i]);
      m.instance = i;
      if (m.area_px == 0) continue;
      const bool sure = !instances[i].class_name.empty() && !instances[i].predicted;
      if (sure || !is_found_twice(instances, m)) measured_.push_back(m);
    }
    std::sort(measured_.begin(), measured_.end(),
              [](const auto& a, const auto& b) { return a.instance < b.instance; });
    return measured_;
  }

 private:
  static constexpr double kSamples = 400;  // more, by less than a whole step
  static constexpr std::size_t kMostSamples = 1600;
  static constexpr std::size_t kLeastDepths = 5;
  static constexpr float kReachM = 0.6f;  // from the median depth: what is farther is not of it
  static constexpr double kCutOff = 4;    // how much less a cut-off object tells of its centroid
  static constexpr double kSameShare = 0.5;
  static constexpr double kSamePlaceM = 0.3;  // nearer than two people walk

  // What is found twice is the later one: named and seen, then named and predicted, then by its
  // motion alone, from large to small.
  void order_by_size(const std::vector<Instance>& instances) {
    order_.resize(instances.size());
    for (std::size_t i = 0; i < order_.size(); ++i) order_[i] = i;
    const auto rank = [](const Instance& s) { return s.class_name.empty() ? 2 : s.predicted; };
    std::sort(order_.begin(), order_.end(), [&](std::size_t a, std::size_t b) {
      const Instance &p = instances[a], &q = instances[b];
      if (rank(p) != rank(q)) return rank(p) < rank(q);
      if (rank(p) == 2 && p.box.area() != q.box.area()) return p.box.area() > q.box.area();
      return a < b;
    });
  }

  // Legs that move below a body that is masked, an arm, what is carried: people are tall, not wide.
  static bool is_one_body(const ObjectMeasurement& a, const ObjectMeasurement& b) {
    const Eigen::Vector3d off = a.centroid - b.centroid;
    return std::abs(a.depth_m - b.depth_m) < 0.4f && std::abs(off.x()) < 0.4 && off.norm() < 1.1;
  }

  // Whether an instance, whose pixels are in pixels_, lies on one that was measured before.
  bool is_found_twice(const std::vector<Instance>& instances, const ObjectMeasurement& m) const {
    if (pixels_.empty()) return false;
    const bool unnamed = instances[m.instance].class_name.empty();
    const double per_pixel = m.area_px / static_cast<double>(pixels_.size());
    for (const ObjectMeasurement& other : measured_) {
      const Instance& s = instances[other.instance];
      if ((s.box & instances[m.instance].box).empty()) continue;
      if (m.depth_m > 0 && other.depth_m > 0 &&
          (unnamed ? is_one_body(m, other) : (m.centroid - other.centroid).norm() < kSamePlaceM))
        return true;
      int shared = 0;
      for (const cv::Point& p : pixels_)
        shared += s.box.contains(p) &&
                  (s.mask.empty() || s.mask.at<uchar>(p.y - s.box.y, p.x - s.box.x) != 0);
      if (shared * per_pixel > kSameShare * std::min(m.area_px, other.area_px)) return true;
    }
    return false;
  }

  ObjectMeasurement measure(const DepthView& depth, const Instance& instance) {
    ObjectMeasurement m;
    const cv::Rect& box = instance.box;
    const int step = std::max(1, static_cast<int>(std::sqrt(box.area() / kSamples)));
    pixels_.clear(), depths_.clear();
    for (int y = step / 2; y < box.height; y += step) {
      const uchar* mask = instance.mask.empty() ? nullptr : instance.mask.ptr<uchar>(y);
      for (int x = step / 2; x < box.width; x += step)
        if (!mask || mask[x]) pixels_.push_back({box.x + x, box.y + y});
    }
    if (pixels_.empty()) return m;
    cv::Point sum;
    for (const cv::Point& p : pixels_) sum += p;
    m.center_px = cv::Point2f(sum) / static_cast<float>(pixels_.size());
    m.area_px = static_cast<double>(pixels_.size()) * step * step;
    if (depth.empty()) return m;
    for (const cv::Point& p : pixels_)
      if (const std::uint16_t units = depth.row(p.y)[p.x]) depths_.push_back(depth.to_m(units));
    if (depths_.size() < kLeastDepths) return m;
    const auto middle = depths_.begin() + static_cast<std::ptrdiff_t>(depths_.size() / 2);
    std::nth_element(depths_.begin(), middle, depths_.end());
    m.depth_m = *middle;
    find_centroid(depth, instance, m);
    return m;
  }

  void find_centroid(const DepthView& depth, const Instance& instance, ObjectMeasurement& m) const {
    int n = 0;
    for (const cv::Point& p : pixels_) {
      const float z = depth.to_m(depth.row(p.y)[p.x]);
      if (!(z > 0 && std::abs(z - m.depth_m) < kReachM)) continue;
      const Eigen::Vector2f ray = depth.ray(p);
      if (!ray.allFinite()) continue;  // a lens that does not reach there
      m.centroid += z * ray.homogeneous().cast<double>();
      ++n;
    }
    if (n == 0) return void(m.depth_m = 0);
    m.centroid /= n;
    // What the sensor gets wrong alike at each pixel does not average out; it lies along the ray.
    const double along = sensor_.depth_sigma_m(m.depth_m) * std::sqrt(sensor_.depth_systematic);
    const cv::Rect inside = cv::Rect(cv::Point(1, 1), depth.size() - cv::Size(2, 2)) & instance.box;
    const bool cut_off = inside != instance.box || instance.predicted;
    const double across = centroid_m_ * (cut_off ? kCutOff : 1);
    const Eigen::Vector3d ray = m.centroid.normalized();
    m.covariance = across * across * Eigen::Matrix3d::Identity() +
                   along * along * ray * ray.transpose() + 1e-6 * Eigen::Matrix3d::Identity();
  }

  SensorModel sensor_;
  double centroid_m_;
  std::vector<cv::Point> pixels_;
  std::vector<float> depths_;
  std::vector<std::size_t> order_;
  std::vector<ObjectMeasurement> measured_;
};

}  // namespace stillpoint
