// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "stillpoint/core/error.hpp"
#include "synthetic/path.hpp"

namespace stillpoint {

/// Camera motions after the TUM fr3 sequences, and a loop.
enum class SyntheticMotion {
  kXyz,         ///< along the three axes, +-0.3 m, hardly any rotation
  kHalfsphere,  ///< on a half sphere of 1 m diameter, looking at the island
  kStatic,      ///< held by hand: a tremor of a few millimetres
  kRpy,         ///< roll, pitch and yaw, up to 60 degrees a second
  kLoop         ///< once around the room, 25.9 m, at 0.8 m/s, and 1.3 m beyond the start
};

inline const std::vector<std::string>& synthetic_motion_names() {
  static const std::vector<std::string> names{"xyz", "halfsphere", "static", "rpy", "loop"};
  return names;
}

/// The motion of that name. Throws Error, naming the choices, for another.
SyntheticMotion synthetic_motion(const std::string& name);

namespace synthetic {

/// Where the camera is at any time, from the motion and the seed alone. World: z up, metres.
class CameraPath {
 public:
  CameraPath(SyntheticMotion motion, std::uint64_t seed) : motion_(motion) {
    for (int i = 0; i < kPhases; ++i)
      phase_[i] = uniform(hash(seed, 0xca3, static_cast<std::uint64_t>(i)));
  }

  static RoundedRectangle loop() { return {-3.8, 3.8, -2.9, 3.3, 1.0}; }
  static constexpr double kLoopSpeed = 0.8;
  /// Time of the whole loop and of the part that is seen twice.
  static double loop_duration_s() { return (loop().length() + 1.3) / kLoopSpeed; }

  /// The camera's frame at time `t_s` after the start: x right, y down, z forward.
  Frame at(double t_s) const {
    const double t = t_s;
    Vec3 p{0, -2.9, 1.36};
    Vec3 ahead{0, 1, 0};
    double yaw = 0, pitch = -7.5,
           roll = 0;  // degrees from `ahead`: left, up and clockwise positive
    switch (motion_) {
      case SyntheticMotion::kXyz:
        p.x += 0.3 * active(t, 0) * wave(t, 2.9, 0);
        p.z += 0.22 * active(t, 1) * wave(t, 2.6, 1);
        p.y += 0.3 * active(t, 2) * wave(t, 3.1, 2);
        yaw += 1.5 * wave(t, 3.7, 3), pitch += 1.2 * wave(t, 2.9, 4), roll += 1.0 * wave(t, 4.3, 5);
        break;
      case SyntheticMotion::kHalfsphere: {
        const double azimuth = 65 * wave(t, 6.4, 0) * kPi / 180;
        const double height = (20 + 32 * wave(t, 4.2, 1)) * kPi / 180;
        p = p + Vec3{0.5 * sine(azimuth) * cosine(height),
                     0.3 - 0.5 * cosine(azimuth) * cosine(height), 0.5 * sine(height) - 0.15};
        const Vec3 target{0.1 * wave(t, 5.1, 2), 0.4, 0.95};
        ahead = target - p, pitch = 0;
        roll += 3 * wave(t, 3.9, 3);
        break;
      }
      case SyntheticMotion::kStatic:
        break;
      case SyntheticMotion::kRpy:
        p.x += 0.05 * wave(t, 3.3, 0), p.y += 0.04 * wave(t, 4.1, 1), p.z += 0.04 * wave(t, 2.7, 2);
        roll += 17 * active(t, 0) * wave(t, 2.3, 3);
        pitch += 11 * active(t, 1) * wave(t, 1.9, 4) + 2;
        yaw += 23 * active(t, 2) * wave(t, 2.5, 5) + 3 * wave(t, 5.3, 6);
        break;
      case SyntheticMotion::kLoop: {
        const RoundedRectangle way = loop();
        const double start = 2.8;  // the middle of the side where the other motions are
        const RoundedRectangle::Place place = way.at(start + kLoopSpeed * t);
        p.x = place.position.x, p.y = place.position.y;
        p.z += 0.04 * wave(t, 3.1, 0) + 0.012 * wave(t, 0.9, 1);
        // Looks ahead and a third to the left, into the room; the direction is smoothed.
        ahead = {};
        for (int i = -8; i <= 8; ++i)
          ahead = ahead + way.at(start + kLoopSpeed * t + 0.35 + 0.12 * i).direction;
        yaw += 38 + 4 * wave(t, 5.7, 2);
        pitch += 2.5 * wave(t, 4.7, 3), roll += 1.5 * wave(t, 3.3, 4);
        break;
      }
    }
    p.x += 0.0022 * wave(t, 0.41, 7) + 0.0030 * wave(t, 1.27, 8);
    p.y += 0.0020 * wave(t, 0.37, 9) + 0.0030 * wave(t, 1.43, 10);
    p.z += 0.0022 * wave(t, 0.33, 11) + 0.0030 * wave(t, 1.13, 12);
    yaw += 0.12 * wave(t, 0.43, 13) + 0.2 * wave(t, 1.7, 14);
    pitch += 0.12 * wave(t, 0.35, 15) + 0.2 * wave(t, 1.5, 16);
    roll += 0.10 * wave(t, 0.39, 17) + 0.2 * wave(t, 1.9, 18);
    return looking(p, ahead, yaw, pitch, roll);
  }

 private:
  static constexpr int kPhases = 20;

  /// A sine of the given period; the phase depends on the seed.
  double wave(double t, double period_s, int which) const {
    return sine(2 * kPi * (t / period_s + phase_[which]));
  }
  /// How much of a motion along axis 0, 1 or 2 is made now: each has its turn every 7.5 s.
  double active(double t, int axis) const {
    const double c = cosine(2 * kPi * (t / 7.5 - axis / 3.0 - 0.18 + 0.08 * phase_[19]));
    return 0.18 + 0.82 * smooth_step(0.5 + 0.75 * c);
  }
  static Frame looking(Vec3 position, Vec3 ahead, double yaw_deg, double pitch_deg,
                       double roll_deg);

  SyntheticMotion motion_;
  double phase_[kPhases];
};

/// The same frame as T_world_camera.
Eigen::Isometry3d to_isometry(const Frame& f);

}  // namespace synthetic
}  // namespace stillpoint
