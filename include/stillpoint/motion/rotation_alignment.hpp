// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cstddef>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "stillpoint/core/normal_equations.hpp"
#include "stillpoint/core/rigid_motion.hpp"
#include "stillpoint/motion/corner_image.hpp"
#include "stillpoint/motion/packet.hpp"

namespace stillpoint::detail {

/// Estimates the rotation of the camera from whole images made very small. Corners are found again
/// only where the guess is near; small images can be aligned from far.
class RotationAlignment {
 public:
  /// Maps points of the camera before into the one now, with the translation of `guess`; `guess`
  /// where the images do not fit. O(pixels / 16 of the fine images).
  Eigen::Isometry3d align(const CornerImage& before, const CornerImage& now,
                          const Eigen::Isometry3d& guess) {
    Eigen::Isometry3d T = guess;
    shrink(before.fine, 4, smaller_before_[0]);
    shrink(now.fine, 4, smaller_[0]);
    for (std::size_t i = 1; i < smaller_.size(); ++i) {
      shrink(smaller_before_[i - 1], 2, smaller_before_[i]);
      shrink(smaller_[i - 1], 2, smaller_[i]);
    }
    for (std::size_t level = smaller_.size(); level-- > 0;) {
      const int fine_px = 4 << level;
      // A difference of brightness beyond this has a reason of its own; from far, most have none.
      const float unlike = 5.0f * static_cast<float>(fine_px);
      if (std::min(smaller_[level].cols, smaller_[level].rows) < 3) continue;
      cv::GaussianBlur(smaller_before_[level], small_before_, {3, 3}, 0.8);
      cv::GaussianBlur(smaller_[level], small_, {3, 3}, 0.8);
      const cv::Matx33d K = small_camera(now, fine_px * now.scale);
      float brighter = 0;
      for (int i = 0; i < 8; ++i) {
        const std::optional<double> size = step(K, unlike, brighter, T);
        if (!size) return guess;
        if (*size < 1e-3) break;
      }
    }
    normalize_rotation(T);
    return T;
  }

 private:
  // The camera of an image whose pixels are squares of `px` of the frame's.
  static cv::Matx33d small_camera(const CornerImage& image, double px) {
    cv::Matx33d K = cv::Matx33d::eye();
    K(0, 0) = image.fx / px, K(0, 2) = (image.cx + 0.5) / px - 0.5;
    K(1, 1) = image.fy / px, K(1, 2) = (image.cy + 0.5) / px - 0.5;
    return K;
  }

  // One step of Gauss and Newton over all pixels of the small images; its size, radians.
  std::optional<double> step(const cv::Matx33d& K, float unlike, float& brighter,
                             Eigen::Isometry3d& T) {
    cv::Matx33d R;
    for (int i = 0; i < 9; ++i) R.val[i] = T.linear()(i / 3, i % 3);
    cv::warpPerspective(small_, warped_, K * R * K.inv(), small_.size(),
                        cv::INTER_LINEAR | cv::WARP_INVERSE_MAP, cv::BORDER_CONSTANT, -1);
    const float fx = static_cast<float>(K(0, 0)), cx = static_cast<float>(K(0, 2));
    const float fy = static_cast<float>(K(1, 1)), cy = static_cast<float>(K(1, 2));
    const auto four = [](const float* first) { return Packet::load(first); };
    static constexpr float kFirst[] = {0, 1, 2, 3};
    NormalPackets<4> normal;
    for (int v = 1; v + 1 < small_.rows; ++v) {
      const float* before = small_before_.ptr<float>(v);
      const float* above = small_before_.ptr<float>(v - 1);
      const float* below = small_before_.ptr<float>(v + 1);
      const float* now = warped_.ptr<float>(v);
      const Packet y = Packet::constant((static_cast<float>(v) - cy) / fy);
      for (int u = 1; u + 4 < small_.cols; u += 4) {
        const Packet x = (static_cast<float>(u) - cx + four(kFirst)) / fx;
        const Packet gx = 0.5f * fx * (four(before + u + 1) - four(before + u - 1));
        const Packet gy = 0.5f * fy * (four(below + u) - four(above + u));
        const Packet seen = 1 - is_positive(-four(now + u));  // what is out of view is -1
        const Packet error = four(now + u) - four(before + u) - brighter;
        const Packet likely = 1 / (1 + error * error * (1 / (unlike * unlike)));
        // The unknowns: a rotation about x, y and z, and a change of brightness.
        normal.add(seen * likely * likely,
                   {-gx * x * y - gy * (1 + y * y), gx * (1 + x * x) + gy * x * y, gy * x - gx * y,
                    Packet::constant(1)},
                   error);
      }
    }
    const auto solved = solve_normal_equations<4>(normal.matrix(), normal.right());
    if (!solved) return std::nullopt;
    const Eigen::Vector4d& d = *solved;
    const Eigen::Vector3d rotation = d.head<3>();
    const double angle = rotation.norm();
    if (!(angle < 0.3)) return std::nullopt;
    // The steps are those of the image before, so they are taken back.
    Eigen::Isometry3d back = Eigen::Isometry3d::Identity();
    back.linear() = rotation_matrix(-rotation);
    T = T * back;
    brighter += static_cast<float>(d[3]);
    return angle;
  }

  // The finer first.
  std::array<cv::Mat, 3> smaller_before_, smaller_;
  cv::Mat small_before_, small_, warped_;
};

}  // namespace stillpoint::detail
