// SPDX-License-Identifier: BSD-2-Clause
#include "synthetic/depth.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

namespace stillpoint {

namespace {

using namespace synthetic;

/// Measures the pixels of one row after the other.
class KinectCamera {
 public:
  KinectCamera(const cv::Mat& exact, const cv::Mat& hole_prone, const Camera& camera,
               const KinectNoise& noise, std::uint64_t seed)
      : exact_(exact),
        hole_prone_(hole_prone),
        camera_(camera),
        noise_(noise),
        seed_(seed),
        scale_(camera.fx / 525.0),
        disparity_(camera.fx * noise.baseline_m),
        shadow_(1, exact.cols) {}

  void measure_row(int y, std::uint16_t* out) {
    find_shadow(exact_.ptr<float>(y));
    const std::uint64_t row_seed = hash(seed_, static_cast<std::uint64_t>(y));
    for (int x = 0; x < exact_.cols; ++x)
      out[x] = measured(x, y, hash(row_seed, static_cast<std::uint64_t>(x)));
  }

 private:
  // A point is lit when no point right of it hides it from the projector, which stands to the
  // right: its column there is x - disparity / z.
  void find_shadow(const float* z_row) {
    double nearest = 1e9;
    for (int x = exact_.cols - 1; x >= 0; --x) {
      const bool there = z_row[x] > 0;
      const double column = there ? x - disparity_ / static_cast<double>(z_row[x]) : x;
      shadow_(0, x) = noise_.shadows && column > nearest + 0.6;
      if (there) nearest = std::min(nearest, column);
    }
  }

  std::uint16_t measured(int x, int y, std::uint64_t bits) const {
    // The matched window slips at edges: the value of a neighbor, now and then.
    const int from_x = std::clamp(x + slip(bits), 0, exact_.cols - 1);
    const int from_y = std::clamp(y + slip(bits >> 8), 0, exact_.rows - 1);
    const double z = static_cast<double>(exact_.at<float>(from_y, from_x));
    if (!(z > noise_.nearest_m && z < noise_.farthest_m)) return 0;
    if (shadow_(0, x) || (noise_.shadows && x < 8 * scale_)) return 0;
    if (is_hole(x, y, z)) return 0;
    const double value = with_noise(x, y, z, bits);
    if (value < noise_.nearest_m || value > noise_.farthest_m) return 0;
    return static_cast<std::uint16_t>(
        std::min(65535.0, std::floor(value * camera_.depth_units_per_m + 0.5)));
  }

  bool is_hole(int x, int y, double z) const {
    double share = noise_.holes;
    if (!hole_prone_.empty() && hole_prone_.at<uchar>(y, x)) share = noise_.holes_in_dark;
    // Grazing: depth changes fast from pixel to pixel.
    const float* z_row = exact_.ptr<float>(y);
    const int right = std::min(x + 1, exact_.cols - 1), below = std::min(y + 1, exact_.rows - 1);
    const double slope = (std::abs(static_cast<double>(z_row[right] - z_row[x])) +
                          std::abs(static_cast<double>(exact_.at<float>(below, x) - z_row[x]))) *
                         camera_.fx / z;
    share += noise_.holes > 0 ? 0.35 * smooth_step((slope - 4) / 16) : 0;
    if (!(share > 0)) return false;
    const auto px = static_cast<float>(x / (7 * scale_)), py = static_cast<float>(y / (7 * scale_));
    const double patch = 0.75 * value_noise(px, py, 4096, 4096, seed_ + 1) +
                         0.25 * value_noise(px * 3, py * 3, 4096, 4096, seed_ + 2);
    // `patch` is nearly normal: mean 0.5, deviation 0.16.
    return patch < 0.5 - 0.16 * deviations(share);
  }

  // With the noise of the axis and in steps of the disparity.
  double with_noise(int x, int y, double z, std::uint64_t bits) const {
    const double sigma = noise_.axial0_m + noise_.axial2_per_m * (z - 0.4) * (z - 0.4);
    const auto cx = static_cast<float>(x / (3 * scale_)), cy = static_cast<float>(y / (3 * scale_));
    const double wide = (static_cast<double>(value_noise(cx, cy, 4096, 4096, seed_ + 3)) - 0.5) * 5;
    const double noisy = z + sigma * (0.8 * gaussian(hash(bits, 1)) + 0.6 * wide);
    if (!(noise_.disparity_steps_per_px > 0)) return noisy;
    const double steps =
        std::floor(disparity_ / std::max(noisy, 0.1) * noise_.disparity_steps_per_px + 0.5);
    return disparity_ * noise_.disparity_steps_per_px / std::max(steps, 1.0);
  }

  const cv::Mat &exact_, &hole_prone_;
  const Camera& camera_;
  const KinectNoise& noise_;
  std::uint64_t seed_;
  double scale_;      // patches and strips as large as in an image 640 wide
  double disparity_;  // at 1 m, pixels
  cv::Mat_<bool> shadow_;
};

}  // namespace

cv::Mat measure_depth(const cv::Mat& exact, const cv::Mat& hole_prone, const Camera& camera,
                      const KinectNoise& noise, std::uint64_t seed) {
  cv::Mat measured(exact.size(), CV_16UC1);
  KinectCamera kinect(exact, hole_prone, camera, noise, seed);
  for (int y = 0; y < exact.rows; ++y) kinect.measure_row(y, measured.ptr<std::uint16_t>(y));
  return measured;
}

}  // namespace stillpoint
