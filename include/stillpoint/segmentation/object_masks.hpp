// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <opencv2/core.hpp>

#include "stillpoint/core/frame_context.hpp"
#include "stillpoint/core/instance.hpp"
#include "stillpoint/core/mask_pool.hpp"
#include "stillpoint/segmentation/remembered_object.hpp"

namespace stillpoint {

/// The masks of mended objects: without what is known to be static, and with what was missing.
/// Memory is used again as soon as nobody holds a mask any more.
class ObjectMasks {
 public:
  /// Clears what is known to be static from the mask of an instance with a name. O(mask).
  void trim(const FrameContext& context, Instance& s) {
    if (context.labels.empty() || s.class_name.empty() || s.mask.empty()) return;
    cv::Mat mask = masks_.take(s.box.size());
    s.mask.copyTo(mask);
    context.labels.clear_static(s.box, mask, true);
    s.mask = mask;
  }

  /// Adds an object's predicted mask to an instance that shows part of it, or writes it to one that
  /// is empty (box and mask). False if nothing of it is left in the image, or beside what is known
  /// to be static; the instance is as before then. O(mask).
  bool restore(const FrameContext& context, const RememberedObject& object, Instance& instance) {
    const bool shown = !instance.mask.empty();
    const cv::Rect predicted = object.predicted_box(context.size());
    if (predicted.empty()) return false;
    const cv::Rect area = shown ? predicted | instance.box : predicted;
    cv::Mat mask = masks_.zeros(area.size());
    object.draw_predicted(area, mask);
    context.labels.clear_static(area, mask, object.class_name.empty());
    if (shown) {
      cv::Mat part = mask(instance.box - area.tl());
      cv::bitwise_or(part, instance.mask, part);
    } else if (!context.labels.empty() && cv::countNonZero(mask) == 0) {
      return false;
    }
    instance.box = area;
    instance.mask = mask;
    return true;
  }

 private:
  detail::MaskPool masks_;
};

}  // namespace stillpoint
