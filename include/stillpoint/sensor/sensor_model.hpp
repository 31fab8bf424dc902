// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cmath>
#include <cstddef>
#include <string>

#include "stillpoint/core/error.hpp"

namespace stillpoint {

/// How far the measurements of an RGB-D camera can be wrong. Whoever compares two measurements asks
/// here; beyond these limits a difference means something, within them nothing is known.
///
/// The standard deviation of a depth z (metres) is sqrt(floor^2 + (slope z)^2 + (square z^2)^2):
/// a floor (quantization, ripple), a part that grows with the distance (scale, multipath of time of
/// flight cameras), and one that grows with its square (disparity: structured light, stereo).
struct SensorModel {
  /// Parts of the depth's standard deviation: metres, metres per metre, 1 / metres.
  double depth_floor_m = 0.005;
  double depth_slope = 0.002;
  double depth_square = 0.003;
  /// Share of the depth's variance that is the same in every frame (calibration, ripple, bumps), 0
  /// to 1: many measurements of one place don't make it smaller.
  double depth_systematic = 0.75;
  /// Differences within so many standard deviations mean nothing.
  double sigmas = 4;
  /// Standard deviation of the time between the color's and the depth's exposure that their stamps
  /// do not tell, seconds. Counts until the frames have told it (DelayEstimate).
  double delay_s = 0.006;
  /// Time from the first to the last row of an image (rolling shutter), seconds: how much is allowed
  /// for it. That of the depth is estimated besides (ReadoutEstimate).
  double readout_s = 0.03;
  /// Least distance that is measured, metres.
  double min_range_m = 0.3;
  /// Up to this distance nearly every surface is measured, metres: what is not is black, glossy or
  /// transparent. Only beyond it a hole in the depth may be free space.
  double max_range_m = 4;

  /// Standard deviation of a depth, metres.
  float depth_sigma_m(float z) const {
    const float a = static_cast<float>(depth_floor_m), b = static_cast<float>(depth_slope) * z,
                c = static_cast<float>(depth_square) * z * z;
    return std::sqrt(a * a + b * b + c * c);
  }
  /// Variance of 1 / z, where `inverse_depth` = 1 / z was measured; 1 / m^2. Never 0.
  double inverse_depth_variance(double inverse_depth) const {
    const double w2 = inverse_depth * inverse_depth;
    return (depth_floor_m * depth_floor_m * w2 + depth_slope * depth_slope) * w2 +
           depth_square * depth_square + 1e-8;
  }
  /// The standard deviation of each of n measurements of one place, as if they were independent:
  /// this many times that of a single one.
  double repeated(std::size_t n) const {
    return n < 2 ? 1 : std::sqrt(1 + static_cast<double>(n - 1) * depth_systematic);
  }
  /// Least difference of two depths at distance z that is not noise, metres.
  float least_step_m(float z) const { return static_cast<float>(sigmas) * depth_sigma_m(z); }

  /// Structured light: Kinect v1, Xtion. Depth noise: Khoshelham and Oude Elberink, Sensors 2012,
  /// 12(2), 1437 (1.45e-3 z^2 at random, and twice that with the systematic part, so three quarters
  /// of the variance are systematic); color and depth
  /// are taken without synchronization at 30 Hz, up to 17 ms apart, and read out row by row. Kinect
  /// for Windows is specified for 0.8 to 4 m.
  static SensorModel kinect_v1() { return {}; }
  /// Time of flight: Kinect v2, Azure Kinect. Azure's data sheet: random error at most 17 mm,
  /// systematic at most 11 mm + 0.1 % of the distance; 0.5 to 3.86 m. The shutter of the depth is
  /// global.
  static SensorModel time_of_flight() {
    SensorModel model;
    model.depth_floor_m = 0.011, model.depth_slope = 0.004, model.depth_square = 0.0005;
    model.depth_systematic = 0.3;
    model.delay_s = 0.003, model.readout_s = 0.015, model.max_range_m = 3.86;
    return model;
  }
  /// Active stereo: RealSense D4xx. Intel's tuning guide: noise z^2 * subpixel / (focal length *
  /// baseline), 0.08 px to 0.15 px with texture, 640 px, 50 mm (D435; ideal up to 3 m). Its depth
  /// has a global shutter, the color of most models has not.
  static SensorModel realsense_d400() {
    SensorModel model;
    model.depth_floor_m = 0.004, model.depth_slope = 0.004, model.depth_square = 0.004;
    model.delay_s = 0.005, model.readout_s = 0.015, model.max_range_m = 3;
    return model;
  }
  /// A rendered camera: exact stamps, global shutter.
  static SensorModel exact() {
    SensorModel model;
    model.delay_s = 0, model.readout_s = 0, model.depth_systematic = 0;
    return model;
  }

  /// Throws Error if a number makes no sense.
  void check() const {
    const auto at_least_0 = [](const char* name, double found) {
      if (!(found >= 0 && std::isfinite(found)))
        throw Error(std::string("SensorModel.") + name + ": expected at least 0, found " +
                    std::to_string(found));
    };
    at_least_0("depth_floor_m", depth_floor_m);
    at_least_0("depth_slope", depth_slope);
    at_least_0("depth_square", depth_square);
    if (!(depth_systematic >= 0 && depth_systematic <= 1))
      throw Error("SensorModel.depth_systematic: expected 0 to 1, found " +
                  std::to_string(depth_systematic));
    at_least_0("sigmas", sigmas);
    at_least_0("delay_s", delay_s);
    at_least_0("readout_s", readout_s);
    at_least_0("min_range_m", min_range_m);
    at_least_0("max_range_m", max_range_m);
  }
};

}  // namespace stillpoint
