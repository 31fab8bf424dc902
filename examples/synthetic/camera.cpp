// SPDX-License-Identifier: BSD-2-Clause
#include "synthetic/camera.hpp"

namespace stillpoint {

SyntheticMotion synthetic_motion(const std::string& name) {
  const std::vector<std::string>& names = synthetic_motion_names();
  std::string choices;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (names[i] == name) return static_cast<SyntheticMotion>(i);
    choices += (i ? ", " : "") + names[i];
  }
  throw Error("synthetic sequence: unknown motion '" + name + "'; choose one of " + choices);
}

namespace synthetic {

Frame CameraPath::looking(Vec3 position, Vec3 ahead, double yaw_deg, double pitch_deg,
                          double roll_deg) {
  const double a = yaw_deg * kPi / 180, b = pitch_deg * kPi / 180, c = roll_deg * kPi / 180;
  Vec3 forward{ahead.x * cosine(a) - ahead.y * sine(a), ahead.x * sine(a) + ahead.y * cosine(a),
               ahead.z};
  forward = normalized(forward);
  const Vec3 right = normalized(cross(forward, {0, 0, 1}));
  forward = forward * cosine(b) + cross(right, forward) * sine(b);
  const Vec3 down = cross(forward, right);
  Frame f;
  f.x = right * cosine(c) + down * sine(c);
  f.y = down * cosine(c) - right * sine(c);
  f.z = forward, f.origin = position;
  return f;
}

Eigen::Isometry3d to_isometry(const Frame& f) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.matrix().topRows<3>() << f.x.x, f.y.x, f.z.x, f.origin.x,  //
      f.x.y, f.y.y, f.z.y, f.origin.y,                         //
      f.x.z, f.y.z, f.z.z, f.origin.z;
  return T;
}

}  // namespace synthetic
}  // namespace stillpoint
