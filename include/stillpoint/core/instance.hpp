// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <limits>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "stillpoint/core/blur.hpp"
#include "stillpoint/core/config.hpp"
#include "stillpoint/core/error.hpp"
#include "stillpoint/core/fill_image.hpp"
#include "stillpoint/core/frame.hpp"

namespace stillpoint {

/// One segmented (or only detected) object of a frame.
struct Instance {
  /// Class by name ("person"); empty for an object without a class, found by its motion.
  std::string class_name = "person";
  /// Detector's confidence, 0 to 1.
  float score = 1;
  /// Bounding box in pixels, inside the image.
  cv::Rect box;
  /// CV_8UC1 of the box's size, 255 = object, 0 = not. Empty: only the box is known, and the depth
  /// fusion carves the object out of it.
  cv::Mat mask{};
  /// Distance at which the object is expected, metres; 0: not known. Segmenters leave it alone, the
  /// compensator fills it in for objects that it remembers.
  float depth_m = 0;
  /// The mask was carried here from earlier frames and may lie a little beside the object.
  /// Segmenters leave it alone, the front end fills it in.
  bool predicted = false;
  /// By how many seconds the result is late that shows it; 0: in time, or no result shows it.
  /// Segmenters leave it alone, the front end fills it in.
  double late_s = 0;
  /// Motion blur in the frame. Segmenters leave it alone, the front end fills it in.
  Blur blur{};
};

/// Timestamps that differ by less, seconds, are of the same frame.
constexpr double kSameTimeS = 1e-4;

/// What a segmenter says of one frame.
struct Segmentation {
  /// False: no result for this frame (the network did not run); masks are predicted from earlier
  /// ones, and `instances` holds at most what was found without it. True with no instances: the
  /// network ran and saw nobody.
  bool available = false;
  /// Timestamp of the frame that was segmented, seconds; NaN: of the frame that it is given with.
  /// An earlier frame's masks are predicted forward; a later one's are an Error.
  double timestamp = std::numeric_limits<double>::quiet_NaN();
  std::vector<Instance> instances{};
};

/// Timestamp of the frame that a result is of, an earlier one or that of `now_s`, which it came
/// with. Seconds.
inline double result_time(const Segmentation& segmentation, double now_s) {
  return segmentation.timestamp < now_s - kSameTimeS ? segmentation.timestamp : now_s;
}

/// Smallest box around the non-zero pixels of an 8-bit mask; empty if there are none. O(pixels).
inline cv::Rect mask_bounds(const cv::Mat& mask) {
  int x0 = mask.cols, x1 = -1, y0 = mask.rows, y1 = -1;
  for (int y = 0; y < mask.rows; ++y) {
    const uchar* row = mask.ptr<uchar>(y);
    int first = 0;
    while (first < mask.cols && !row[first]) ++first;
    if (first == mask.cols) continue;
    int last = mask.cols - 1;
    while (!row[last]) --last;
    x0 = std::min(x0, first), x1 = std::max(x1, last);
    y0 = std::min(y0, y), y1 = y;
  }
  return x1 < 0 ? cv::Rect() : cv::Rect(x0, y0, x1 - x0 + 1, y1 - y0 + 1);
}

/// Makes an instance from a mask of the whole image (CV_8UC1, non-zero = object). Returns an
/// instance with an empty box if the mask is empty. O(pixels).
inline Instance instance_from_mask(const cv::Mat& full_mask,
                                   const std::string& class_name = "person", float score = 1) {
  detail::check(full_mask.type() == CV_8UC1, [&] {
    return "instance_from_mask: expected CV_8UC1, found " + detail::type_text(full_mask);
  });
  Instance instance;
  instance.class_name = class_name;
  instance.score = score;
  instance.box = mask_bounds(full_mask);
  if (!instance.box.empty()) instance.mask = full_mask(instance.box) > 0;
  return instance;
}

namespace detail {

// Sets the pixels of a row to 255 where another's are not 0.
STILLPOINT_ROW_LOOP inline void set_where(const uchar* own, int n, uchar* STILLPOINT_RESTRICT all) {
  for (int x = 0; x < n; ++x) all[x] = own[x] != 0 ? uchar{255} : all[x];
}

/// Sets `mask` to 255 in the box of an instance: where its own mask is set, or everywhere.
inline void add_to_mask(const Instance& instance, cv::Mat& mask) {
  cv::Mat in_box = mask(instance.box);
  if (instance.mask.empty()) return fill_image(in_box, uchar{255});
  for (int y = 0; y < in_box.rows; ++y) set_where(instance.mask.ptr(y), in_box.cols, in_box.ptr(y));
}

}  // namespace detail

/// The instances as one mask of the whole image, CV_8UC1, 255 where one of them is; an instance
/// with a box alone fills it. The boxes must lie inside the image. O(pixels).
inline cv::Mat mask_from_instances(const std::vector<Instance>& instances, const cv::Size& size) {
  cv::Mat all = cv::Mat::zeros(size, CV_8UC1);
  for (const Instance& s : instances) detail::add_to_mask(s, all);
  return all;
}

/// Throws Error unless every instance fits the image as written at Instance. O(instances).
inline void check_segmentation(const Segmentation& segmentation, cv::Size size) {
  for (std::size_t i = 0; i < segmentation.instances.size(); ++i) {
    const Instance& s = segmentation.instances[i];
    const auto where = [&] { return "segmentation.instances[" + std::to_string(i) + "]"; };
    detail::check((s.box & cv::Rect(cv::Point(), size)) == s.box && !s.box.empty(), [&] {
      return where() + ".box: expected a non-empty box inside " + std::to_string(size.width) + "x" +
             std::to_string(size.height) + ", found x " + std::to_string(s.box.x) + " y " +
             std::to_string(s.box.y) + " width " + std::to_string(s.box.width) + " height " +
             std::to_string(s.box.height);
    });
    detail::check(s.mask.empty() || (s.mask.type() == CV_8UC1 && s.mask.size() == s.box.size()),
                  [&] {
                    return where() + ".mask: expected CV_8UC1 of the box's size " +
                           std::to_string(s.box.width) + "x" + std::to_string(s.box.height) +
                           ", found " + detail::type_text(s.mask) + " " + detail::size_text(s.mask);
                  });
  }
}

/// The same for the segmentation of a frame, which must not be stamped later than the frame, but
/// for rounding: masks of a later image, or the time at which a result arrived.
inline void check_segmentation(const Segmentation& segmentation, const RgbdFrame& frame) {
  constexpr double kRoundingS = 1e-3;
  detail::check(!(segmentation.timestamp > frame.timestamp + kRoundingS), [&] {
    return "segmentation.timestamp: expected that of the image that was segmented, at most the "
           "frame's, found " +
           std::to_string(segmentation.timestamp - frame.timestamp) + " s after it";
  });
  check_segmentation(segmentation, frame.color.size());
}

}  // namespace stillpoint
