// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace stillpoint::ros2 {

/// A header's stamp, or a span between two.
using Nanoseconds = std::int64_t;

// Whole seconds and the rest apart: a stamp of today has too many digits for one product. The
// double is the one that its decimal text would be read as.
inline double seconds(Nanoseconds t) {
  return static_cast<double>(t / 1000000000) + static_cast<double>(t % 1000000000) * 1e-9;
}
inline Nanoseconds nanoseconds(double s) {
  const double whole = std::floor(s);
  return static_cast<Nanoseconds>(whole) * 1000000000 + std::llround((s - whole) * 1e9);
}

namespace detail {

// With three decimals.
inline std::string text(double value) {
  std::string s = std::to_string(value);
  return s.find('.') == std::string::npos ? s : s.substr(0, s.find('.') + 4);
}

}  // namespace detail

/// The fields of sensor_msgs/Image. Copies share the bytes, which belong to `owner`.
struct ImageMessage {
  Nanoseconds stamp = 0;
  std::string frame_id;
  std::string encoding;
  std::uint32_t width = 0, height = 0;
  /// Bytes from one row to the next.
  std::uint32_t step = 0;
  bool big_endian = false;
  const std::uint8_t* data = nullptr;
  std::size_t bytes = 0;
  std::shared_ptr<const void> owner;
};

/// The fields of sensor_msgs/CameraInfo that say what the lens does.
struct CameraInfoMessage {
  std::uint32_t width = 0, height = 0;
  std::string distortion_model;
  std::vector<double> d;
  /// Row by row, 3 x 3 and 3 x 4.
  std::array<double, 9> k{};
  std::array<double, 12> p{};
  std::uint32_t binning_x = 0, binning_y = 0;
  std::uint32_t roi_x = 0, roi_y = 0, roi_width = 0, roi_height = 0;

  bool operator==(const CameraInfoMessage& o) const {
    return width == o.width && height == o.height && distortion_model == o.distortion_model &&
           same(d, o.d) && same(k, o.k) && same(p, o.p) && binning_x == o.binning_x &&
           binning_y == o.binning_y && roi_x == o.roi_x && roi_y == o.roi_y &&
           roi_width == o.roi_width && roi_height == o.roi_height;
  }

 private:
  // NaN, for what is not known, is as good as another one.
  template <class Numbers>
  static bool same(const Numbers& a, const Numbers& b) {
    return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](double x, double y) {
      return x == y || (std::isnan(x) && std::isnan(y));
    });
  }
};

/// A box of vision_msgs/Detection2D, pixels, with its most probable class.
struct Detection {
  std::string class_name;
  double score = 1;
  double center_x = 0, center_y = 0, width = 0, height = 0;
};

/// What a network says of the frame with that stamp: a label image, or boxes.
struct SegmentationMessage {
  Nanoseconds stamp = 0;
  bool has_labels = false;
  ImageMessage labels;
  std::vector<Detection> detections;
};

}  // namespace stillpoint::ros2
