// SPDX-License-Identifier: BSD-2-Clause
#include "synthetic/depth.hpp"

namespace stillpoint {

namespace synthetic {}  // namespace synthetic
cv::Mat measure_depth(const cv::Mat& exact, const cv::Mat& hole_prone, const Camera& camera,
                      const KinectNoise& noise, std::uint64_t seed) {
  using namespace synthetic;
  cv::Mat measured(exact.size(), CV_16UC1);
  const double scale = camera.fx / 525.0;  // patches and strips as large as in a 640 wide picture
  const double disparity = camera.fx * noise.baseline_m;
  cv::Mat shadow(1, exact.cols, CV_8UC1);
  for (int y = 0; y < exact.rows; ++y) {
    const float* z_row = exact.ptr<float>(y);
    // A point is lit when no point right of it hides it from the projector, which stands to the
    // right: its column there is x - disparity / z.
    double nearest = 1e9;
    for (int x = exact.cols - 1; x >= 0; --x) {
      const bool there = z_row[x] > 0;
      const double column = there ? x - disparity / static_cast<double>(z_row[x]) : x;
      shadow.at<uchar>(x) = noise.shadows && column > nearest + 0.6 ? 1 : 0;
      if (there) nearest = std::min(nearest, column);
    }
    auto* out = measured.ptr<std::uint16_t>(y);
    const std::uint64_t row_seed = hash(seed, static_cast<std::uint64_t>(y));
    for (int x = 0; x < exact.cols; ++x) {
      out[x] = 0;
      const std::uint64_t bits = hash(row_seed, static_cast<std::uint64_t>(x));
      // The matched window slips at edges: the value of a neighbor, now and then.
      const int from_x = std::clamp(x + slip(bits), 0, exact.cols - 1);
      const int from_y = std::clamp(y + slip(bits >> 8), 0, exact.rows - 1);
      const double z = static_cast<double>(exact.at<float>(from_y, from_x));
      if (!(z > noise.nearest_m && z < noise.farthest_m)) continue;
      if (shadow.at<uchar>(x) || (noise.shadows && x < 8 * scale)) continue;
      double share = noise.holes;
      if (!hole_prone.empty() && hole_prone.at<uchar>(y, x)) share = noise.holes_in_dark;
      // Grazing: depth changes fast from pixel to pixel.
      const int right = std::min(x + 1, exact.cols - 1), below = std::min(y + 1, exact.rows - 1);
      const double slope = (std::abs(static_cast<double>(z_row[right] - z_row[x])) +
                            std::abs(static_cast<double>(exact.at<float>(below, x) - z_row[x]))) *
                           camera.fx / z;
      share += noise.holes > 0 ? 0.35 * smooth_step((slope - 4) / 16) : 0;
      if (share > 0) {
        const auto px = static_cast<float>(x / (7 * scale)),
                   py = static_cast<float>(y / (7 * scale));
        const double patch = 0.75 * value_noise(px, py, 4096, 4096, seed + 1) +
                             0.25 * value_noise(px * 3, py * 3, 4096, 4096, seed + 2);
        // `patch` is nearly normal: mean 0.5, deviation 0.16.
        if (patch < 0.5 - 0.16 * deviations(share)) continue;
      }
      const double sigma = noise.axial0_m + noise.axial2_per_m * (z - 0.4) * (z - 0.4);
      const auto cx = static_cast<float>(x / (3 * scale)), cy = static_cast<float>(y / (3 * scale));
      const double wide =
          (static_cast<double>(value_noise(cx, cy, 4096, 4096, seed + 3)) - 0.5) * 5;
      const double noisy = z + sigma * (0.8 * gaussian(hash(bits, 1)) + 0.6 * wide);
      double steps = disparity / std::max(noisy, 0.1) * noise.disparity_steps_per_px;
      if (noise.disparity_steps_per_px > 0) steps = std::floor(steps + 0.5);
      const double value = noise.disparity_steps_per_px > 0
                               ? disparity * noise.disparity_steps_per_px / std::max(steps, 1.0)
                               : noisy;
      if (value < noise.nearest_m || value > noise.farthest_m) continue;
      out[x] = static_cast<std::uint16_t>(
          std::min(65535.0, std::floor(value * camera.depth_units_per_m + 0.5)));
    }
  }
  return measured;
}

}  // namespace stillpoint
