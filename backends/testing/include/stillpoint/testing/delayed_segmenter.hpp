// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "stillpoint/core/frame.hpp"
#include "stillpoint/core/instance.hpp"
#include "stillpoint/segmentation/segmenter.hpp"

namespace stillpoint {

/// What a DetectionThread gives when its segmenter takes `latency_s` per frame, but in the time of
/// the frames and not of the clock: the same results in every run, on any machine. It takes the
/// newest frame, and hands its result out with the first frame that comes `latency_s` later. The
/// first frame is waited for (DetectionThread::wait_for_result()).
class DelayedSegmenter : public Segmenter {
 public:
  /// `segmenter` must outlive this.
  DelayedSegmenter(Segmenter& segmenter, double latency_s)
      : segmenter_(segmenter), latency_s_(latency_s) {}

  Segmentation segment(const RgbdFrame& frame) override {
    Segmentation out;
    // Half a millisecond: timestamps are rounded.
    if (busy_ && (frame.timestamp < start_s_ || frame.timestamp >= start_s_ + latency_s_ - 5e-4)) {
      busy_ = false;
      std::swap(out, result_);
    }
    if (!busy_) {
      result_ = segmenter_.segment(frame);
      result_.timestamp = start_s_ = frame.timestamp;
      busy_ = true;
    }
    if (latency_s_ <= 0 || first_) {
      first_ = false;
      busy_ = false;
      std::swap(out, result_);
    }
    return out;
  }

  std::vector<std::string> classes() const override { return segmenter_.classes(); }

 private:
  Segmenter& segmenter_;
  double latency_s_;
  double start_s_ = 0;
  bool busy_ = false, first_ = true;
  Segmentation result_;
};

}  // namespace stillpoint
