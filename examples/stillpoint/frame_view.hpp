// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <optional>
#include <vector>

#include "stillpoint/front_end.hpp"
#include "stillpoint/io/run_sequence.hpp"

namespace stillpoint::cli {

/// Wall-clock times of one frame, milliseconds. Reading and writing files is not in them, save the
/// masks that the `mask_files` segmenter reads.
struct StageTimes {
  double segmentation = 0, motion = 0, compensation = 0, depth = 0, probability = 0;
  double extraction = 0, tracking = 0;
  /// From the frame's arrival to its pose.
  double total = 0;
};

/// A frame that ran through, for those who record it: what the tracker made of it, and the front
/// end, if there is one. Valid until the next frame.
class FrameView {
 public:
  /// `front_end`: null where it is off.
  FrameView(const TrackedFrame& tracked, const FrontEnd* front_end)
      : tracked_(tracked), front_end_(front_end) {}

  const RgbdFrame& frame() const { return tracked_.frame; }
  std::size_t index() const { return tracked_.index; }
  const DynamicMask& mask() const { return tracked_.mask; }
  const std::vector<cv::KeyPoint>& keypoints() const { return tracked_.keypoints; }
  const Selection& selection() const { return tracked_.selection; }
  const std::optional<Eigen::Isometry3d>& pose() const { return tracked_.T_world_camera; }
  bool is_tracked() const { return pose().has_value(); }
  bool uses_front_end() const { return front_end_ != nullptr; }
  const FrontEnd& front_end() const { return *front_end_; }
  const FrameStats& stats() const { return front_end_->stats(); }

  StageTimes times() const {
    StageTimes times;
    if (front_end_) {
      times.segmentation = stats().segmentation_ms;
      times.motion = stats().motion_ms;
      times.compensation = stats().compensation_ms;
      times.depth = stats().depth_ms;
      times.probability = stats().probability_ms;
    }
    times.extraction = tracked_.extraction_ms;
    times.tracking = tracked_.tracking_ms;
    times.total = tracked_.total_ms;
    return times;
  }

 private:
  const TrackedFrame& tracked_;
  const FrontEnd* front_end_;
};

}  // namespace stillpoint::cli
