// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <string>
#include <vector>

#include "stillpoint/core/frame.hpp"
#include "stillpoint/core/instance.hpp"

namespace stillpoint {

/// The seam to a network, a detector or a folder of masks.
///
/// Implement one function. Return `available = false` when there is no result for this frame;
/// `available = true` with no instances when nobody is in view. Boxes lie inside the image, masks
/// are CV_8UC1 of their box's size with 255 = object (see Instance). It may throw: the front end
/// goes on with predicted masks and says kSegmenterFailed. Called from one thread at a time.
class Segmenter {
 public:
  virtual ~Segmenter() = default;
  virtual Segmentation segment(const RgbdFrame& frame) = 0;
  /// Names of the classes that it can report; empty: not known. FrontEnd refuses a dynamic class
  /// that is not among them.
  virtual std::vector<std::string> classes() const { return {}; }
};

}  // namespace stillpoint
