// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <opencv2/core.hpp>
#include <vector>

#include "stillpoint/core/fill_image.hpp"

namespace stillpoint {
namespace detail {

/// Memory for masks that is used again as soon as nobody holds them any more: who keeps a mask,
/// keeps it as it is.
class MaskPool {
 public:
  /// A mask of unknown content, CV_8UC1, continuous. O(masks that are held).
  cv::Mat take(const cv::Size& size) {
    const int n = size.area();
    if (n > capacity_) capacity_ = n + n / 2;  // masks grow from frame to frame
    cv::Mat* free = nullptr;
    for (cv::Mat& slot : slots_)
      if (!held_elsewhere(slot)) {
        free = &slot;
        break;
      }
    if (!free) {
      // Masks that somebody collects are his.
      if (slots_.size() >= kMostSlots) slots_.clear();
      slots_.emplace_back();
      free = &slots_.back();
    }
    if (free->cols < capacity_) *free = cv::Mat(1, capacity_, CV_8UC1);
    return free->colRange(0, n).reshape(1, size.height);
  }

  /// The same, set to 0.
  cv::Mat zeros(const cv::Size& size) {
    cv::Mat mask = take(size);
    fill_image(mask, uchar{0});
    return mask;
  }

  /// Whether another cv::Mat shares the memory of this one.
  static bool held_elsewhere(const cv::Mat& mat) {
    if (!mat.u) return false;
    // Another thread may be letting it go.
#ifdef __GNUC__
    return __atomic_load_n(&mat.u->refcount, __ATOMIC_ACQUIRE) > 1;
#else
    return static_cast<const volatile int&>(mat.u->refcount) > 1;
#endif
  }

 private:
  static constexpr std::size_t kMostSlots = 64;

  std::vector<cv::Mat> slots_;
  int capacity_ = 0;  // of each slot, pixels
};

/// Copies `from` into `to`, into new memory if somebody else holds that of `to`.
inline void copy_apart(const cv::Mat& from, cv::Mat& to) {
  if (MaskPool::held_elsewhere(to)) to.release();
  from.copyTo(to);
}

}  // namespace detail
}  // namespace stillpoint
