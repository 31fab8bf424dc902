// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <opencv2/core.hpp>
#include <string>

#include "stillpoint/core/error.hpp"
#include "stillpoint/core/frame.hpp"
#include "stillpoint/evaluation/binary_counts.hpp"

namespace stillpoint {

/// Counts the pixels of a mask against the true one. All are CV_8UC1 of one size, non-zero =
/// dynamic; with `valid`, only its non-zero pixels count (e.g. those with depth). Throws Error for
/// another type or size. O(pixels).
inline BinaryCounts compare_masks(const cv::Mat& mask, const cv::Mat& truth,
                                  const cv::Mat& valid = cv::Mat()) {
  const auto check = [&](const cv::Mat& m, const char* name) {
    detail::check(m.type() == CV_8UC1 && m.size() == truth.size(), [&] {
      return std::string("compare_masks: ") + name + ": expected CV_8UC1 of the truth's size " +
             detail::size_text(truth) + ", found " + detail::type_text(m) + " " +
             detail::size_text(m);
    });
  };
  check(mask, "mask");
  check(truth, "truth");
  if (!valid.empty()) check(valid, "valid");
  BinaryCounts counts;
  std::uint64_t* const cells[] = {&counts.true_negative, &counts.false_negative,
                                  &counts.false_positive, &counts.true_positive};
  for (int y = 0; y < truth.rows; ++y) {
    const uchar *m = mask.ptr<uchar>(y), *t = truth.ptr<uchar>(y);
    const uchar* v = valid.empty() ? nullptr : valid.ptr<uchar>(y);
    std::uint64_t row[4] = {};
    for (int x = 0; x < truth.cols; ++x)
      if (!v || v[x]) ++row[(m[x] != 0) * 2 + (t[x] != 0)];
    for (int i = 0; i < 4; ++i) *cells[i] += row[i];
  }
  return counts;
}

/// Where a depth image has a measurement, as CV_8UC1, 255; for compare_masks(). O(pixels).
inline cv::Mat measured_pixels(const RgbdFrame& frame) {
  cv::Mat valid = cv::Mat::zeros(frame.depth.size(), CV_8UC1);
  for (int y = 0; y < valid.rows; ++y)
    for (int x = 0; x < valid.cols; ++x)
      if (depth_m_at(frame, x, y) > 0) valid.at<uchar>(y, x) = 255;
  return valid;
}

/// Sums up the masks of a sequence, in two ways: over all pixels of all frames, and as a mean over
/// the frames.
class MaskMetrics {
 public:
  void add(const BinaryCounts& frame) {
    pixels_ += frame;
    iou_.add(frame.iou());
    recall_.add(frame.recall());
    precision_.add(frame.precision());
    ++frames_;
  }

  /// Over all pixels of all frames: large people weigh more.
  const BinaryCounts& pixels() const { return pixels_; }
  /// Means over the frames in which the ratio exists: IoU where one of the masks is not empty,
  /// recall where the true one is not, precision where the found one is not. NaN: in none.
  double mean_iou() const { return iou_.value(); }
  double mean_recall() const { return recall_.value(); }
  double mean_precision() const { return precision_.value(); }
  std::uint64_t frames() const { return frames_; }

 private:
  BinaryCounts pixels_;
  MeanOfNumbers iou_, recall_, precision_;
  std::uint64_t frames_ = 0;
};

}  // namespace stillpoint
