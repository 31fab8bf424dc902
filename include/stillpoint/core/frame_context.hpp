// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "stillpoint/core/blur.hpp"
#include "stillpoint/core/camera.hpp"
#include "stillpoint/core/cell_labels.hpp"
#include "stillpoint/core/depth_view.hpp"
#include "stillpoint/core/frame.hpp"

namespace stillpoint {

/// What is known of one frame: made once, handed from component to component, each of which adds
/// what it learns. FrontEnd does this; whoever uses a component alone calls begin() himself.
class FrameContext {
 public:
  /// Takes a frame, checked with its camera. Shares its images. O(1) for 16-bit depth.
  void begin(const RgbdFrame& new_frame, const Camera& new_camera) {
    check_frame(new_frame, new_camera);
    frame = new_frame;
    camera = new_camera;
    depth.set(frame, camera);
    T_current_last.reset();
    blur.clear();
    labels.clear();
    converted_ = false;
  }

  cv::Size size() const { return frame.color.size(); }
  /// The grey image, CV_8UC1: the frame's, or converted at the first call. Not to be written to: it
  /// may be the caller's.
  const cv::Mat& gray() const {
    if (!frame.given_gray().empty()) return frame.given_gray();
    if (!converted_) cv::cvtColor(frame.color, gray_, cv::COLOR_BGR2GRAY);
    converted_ = true;
    return gray_;
  }

  /// Row `y` of it; if it has not been converted, that row alone is.
  const uchar* gray_row(int y) const {
    if (converted_ || !frame.given_gray().empty()) return gray().ptr<uchar>(y);
    gray_.create(size(), CV_8UC1);
    cv::Mat row = gray_.row(y);
    cv::cvtColor(frame.color.row(y), row, cv::COLOR_BGR2GRAY);
    return row.ptr<uchar>();
  }

  RgbdFrame frame;
  Camera camera;
  DepthView depth;
  /// Maps points of the last frame's camera into this one's (EgoMotion); empty: not known.
  std::optional<Eigen::Isometry3d> T_current_last;
  /// Motion blur (BlurMeter).
  ImageBlur blur;
  /// What earlier frames say of each cell (MotionCheck); empty: nothing.
  CellLabels labels;

 private:
  mutable cv::Mat gray_;
  mutable bool converted_ = false;  // gray_ is this frame's
};

}  // namespace stillpoint
