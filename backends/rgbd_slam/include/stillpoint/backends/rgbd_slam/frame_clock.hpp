// SPDX-License-Identifier: BSD-2-Clause
#pragma once

namespace stillpoint::rgbd_slam {

/// Seconds that have passed, by the timestamps of a tracker's frames: what it waits for comes after
/// the same time, whatever the camera's rate.
///
/// A frame whose timestamp is not after the last one's counts as 1/30 s: a host without timestamps,
/// or one whose clock was set back, still gets its keyframes.
class FrameClock {
 public:
  /// To be called once for each frame.
  void advance(double timestamp) {
    if (started_) now_s_ += timestamp > last_s_ ? timestamp - last_s_ : 1.0 / 30;
    started_ = true;
    last_s_ = timestamp;
  }

  double now_s() const { return now_s_; }

  /// Whether `elapsed_s` is `wanted_s`, but for the jitter of timestamps: less than a frame at 90
  /// Hz.
  static bool reached(double elapsed_s, double wanted_s) { return elapsed_s > wanted_s - 0.01; }
  bool reached_since(double then_s, double wanted_s) const {
    return reached(now_s_ - then_s, wanted_s);
  }

 private:
  double now_s_ = 0, last_s_ = 0;
  bool started_ = false;
};

}  // namespace stillpoint::rgbd_slam
