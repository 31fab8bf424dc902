// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "stillpoint/backends/rgbd_slam/features.hpp"
#include "stillpoint/front_end.hpp"

namespace stillpoint::cli {

/// What the front end removes, seen on keypoints of the whole image.
///
/// A tracker looks for keypoints outside the mask only, so its own list does not show what it was
/// spared. Here the same extractor runs without a mask, and the same filter judges its keypoints:
/// for measuring and for images, never for tracking.
class WholeImageJudge {
 public:
  /// `features`: keypoints per image; 0: the extractor's default.
  WholeImageJudge(const FrontEndSettings& settings, int features)
      : extractor_(extractor_settings(features)),
        filter_(settings.probability),
        use_probability_(settings.use_probability) {}

  /// Judges a frame; a second call for the same frame costs nothing.
  void judge(const RgbdFrame& frame, const DynamicMask& mask) {
    if (selection_ && frame.timestamp == timestamp_) return;
    timestamp_ = frame.timestamp;
    cv::Mat gray = frame.color;
    if (gray.channels() == 3) cv::cvtColor(frame.color, gray, cv::COLOR_BGR2GRAY);
    extractor_.extract(gray, cv::Mat(), features_);
    selection_ = &filter_.filter(features_.keypoints, mask, use_probability_);
  }
  const std::vector<cv::KeyPoint>& keypoints() const { return features_.keypoints; }
  const Selection& selection() const { return *selection_; }

 private:
  static rgbd_slam::OrbExtractor::Settings extractor_settings(int features) {
    rgbd_slam::OrbExtractor::Settings settings;
    if (features > 0) settings.features = features;
    return settings;
  }

  rgbd_slam::OrbExtractor extractor_;
  rgbd_slam::Features features_;
  ProbabilisticKeypointFilter<> filter_;
  bool use_probability_;
  double timestamp_ = 0;
  const Selection* selection_ = nullptr;
};

}  // namespace stillpoint::cli
