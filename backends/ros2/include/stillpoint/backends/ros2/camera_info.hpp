// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "stillpoint/backends/ros2/messages.hpp"
#include "stillpoint/core/camera.hpp"

namespace stillpoint::ros2 {

namespace detail {

// OpenCV's rational model: the radius r becomes r * radial(r^2).
struct RationalLens {
  std::array<double, 8> d;
  double radial(double r2) const {
    return (1 + r2 * (d[0] + r2 * (d[1] + r2 * d[4]))) /
           (1 + r2 * (d[5] + r2 * (d[6] + r2 * d[7])));
  }
};

/// Writes the k1, k2, k3 that come nearest to the rational model up to the radius `most` (of the
/// raw image, normalized) into `camera`. Returns the largest difference, normalized; infinite if
/// the model folds back within the image.
inline double fit_radial(const RationalLens& lens, double most, Camera& camera) {
  constexpr int n = 200;
  cv::Mat_<double> rows(n, 3), wanted(n, 1), k;
  std::array<double, n> radii{};
  double last = 0, raw = 0;
  const double step = most / n * 0.5;
  double r = 0;
  // Undistorted radii out to the one that is seen at `most`, in n equal steps.
  while (raw < most) {
    r += step;
    raw = r * lens.radial(r * r);
    if (!(raw > last) || r > 20) return std::numeric_limits<double>::infinity();
    last = raw;
  }
  for (int i = 0; i < n; ++i) {
    const double x = r * (i + 1) / n, x2 = x * x;
    radii[static_cast<std::size_t>(i)] = x;
    for (int power = 0; power < 3; ++power) rows(i, power) = x * std::pow(x2, power + 1);
    wanted(i) = x * lens.radial(x2) - x;
  }
  cv::solve(rows, wanted, k, cv::DECOMP_QR);
  camera.k1 = k(0), camera.k2 = k(1), camera.k3 = k(2);
  return cv::norm(rows * k, wanted, cv::NORM_INF);
}

inline std::string set_lens(const CameraInfoMessage& info, Camera& camera) {
  const std::vector<double>& d = info.d;
  const bool zero = std::all_of(d.begin(), d.end(), [](double v) { return v == 0; });
  const std::string& model = info.distortion_model;
  if (!std::all_of(d.begin(), d.end(), [](double v) { return std::isfinite(v); }))
    return "expected finite distortion coefficients d, found NaN or infinity";
  if ((model == "plumb_bob" || model.empty()) && (zero || d.size() == 4 || d.size() == 5)) {
    if (zero) return "";
    camera.k1 = d[0], camera.k2 = d[1], camera.p1 = d[2], camera.p2 = d[3];
    if (d.size() == 5) camera.k3 = d[4];
    return "";
  }
  if (model == "rational_polynomial" && (zero || d.size() == 8)) {
    if (zero) return "";
    camera.p1 = d[2], camera.p2 = d[3];
    if (d[5] == 0 && d[6] == 0 && d[7] == 0) {
      camera.k1 = d[0], camera.k2 = d[1], camera.k3 = d[4];
      return "";
    }
    const double x = std::max(camera.cx, camera.width - 1 - camera.cx) / camera.fx;
    const double y = std::max(camera.cy, camera.height - 1 - camera.cy) / camera.fy;
    RationalLens lens;
    std::copy(d.begin(), d.end(), lens.d.begin());
    const double off_px = camera.fx * fit_radial(lens, std::hypot(x, y), camera);
    if (off_px <= 0.5) return "";
    return "expected a rational_polynomial lens that k1, k2, k3 describe to within 0.5 px, found " +
           (std::isfinite(off_px) ? text(off_px) + " px" : "one that folds back in the image") +
           "; rectify the images (image_proc) and set the parameter rectified";
  }
  return "expected the distortion_model plumb_bob (4 or 5 coefficients) or rational_polynomial "
         "(8), found '" +
         model + "' with " + std::to_string(d.size()) +
         "; rectify the images (image_proc) and set the parameter rectified";
}

}  // namespace detail

/// The camera of an image of that size. `rectified`: the images are (image_rect), so P is meant,
/// without distortion. Binning and region of interest are taken into account. A rational lens is
/// replaced by the nearest k1, k2, k3, if that is right to half a pixel.
///
/// Returns an empty text, or what was expected and found; `camera` is then not valid(). O(1).
inline std::string to_camera(const CameraInfoMessage& info, cv::Size image, bool rectified,
                             double depth_units_per_m, Camera& camera) {
  camera = Camera();
  Camera c;
  if (rectified)
    c.fx = info.p[0], c.cx = info.p[2], c.fy = info.p[5], c.cy = info.p[6];
  else
    c.fx = info.k[0], c.cx = info.k[2], c.fy = info.k[4], c.cy = info.k[5];
  const char* const name = rectified ? "p" : "k";
  if (!c.valid() || !std::isfinite(c.fx + c.fy + c.cx + c.cy))
    return std::string("expected focal lengths over 0 in ") + name + ", found " +
           detail::text(c.fx) + " and " + detail::text(c.fy) +
           "; calibrate the camera, or let the driver publish its calibration";
  const double x = std::max(1u, info.binning_x), y = std::max(1u, info.binning_y);
  const bool region = info.roi_width > 0 && info.roi_height > 0;
  const double width = (region ? info.roi_width : info.width) / x;
  const double height = (region ? info.roi_height : info.height) / y;
  if (std::abs(width - image.width) >= 1 || std::abs(height - image.height) >= 1)
    return "expected the calibration of an image of " + std::to_string(image.width) + "x" +
           std::to_string(image.height) + ", found one of " +
           std::to_string(static_cast<int>(width)) + "x" + std::to_string(static_cast<int>(height));
  if (region) c.cx -= info.roi_x, c.cy -= info.roi_y;
  c.fx /= x, c.cx /= x, c.fy /= y, c.cy /= y;
  c.width = image.width, c.height = image.height;
  c.depth_units_per_m = depth_units_per_m;
  const std::string problem = rectified ? "" : detail::set_lens(info, c);
  if (problem.empty()) camera = c;
  return problem;
}

}  // namespace stillpoint::ros2
