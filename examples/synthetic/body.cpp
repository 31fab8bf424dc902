// SPDX-License-Identifier: BSD-2-Clause
#include "synthetic/body.hpp"

namespace stillpoint::synthetic {

Vec3 bend_joint(Vec3 from, Vec3& to, double upper, double lower, Vec3 side) {
  Vec3 d = to - from;
  double reach = norm(d);
  const double longest = (upper + lower) * 0.998;
  if (reach > longest) to = from + d * (longest / reach), d = to - from, reach = longest;
  const double along = (upper * upper - lower * lower + reach * reach) / (2 * reach);
  const double out = std::sqrt(std::max(0.0, upper * upper - along * along));
  const Vec3 axis = d * (1 / reach);
  return from + axis * along + normalized(side - axis * dot(side, axis)) * out;
}

void Body::build(const Pose& pose) {
  const double k = outfit_.height_m / 1.75, w = k * outfit_.width;
  const Vec3 up{0, 0, 1};
  // Trunk: belly and chest, shoulders, pelvis, neck, head.
  limb(pose.pelvis + up * (0.02 * k), pose.chest, pose.chest_facing, 0.115 * w, 0.125 * w, 0.86,
       1.34, outfit_.shirt, kTorso, {0, 0, 512, 256});
  const Vec3 left = cross(up, pose.chest_facing);
  limb(pose.shoulder[0] - left * (0.02 * k), pose.shoulder[1] + left * (0.02 * k), up, 0.072 * k,
       0.072 * k, 1, 1.05, outfit_.shirt, kTorso, {0, 0, 256, 180});
  limb(pose.chest - up * (0.05 * k), pose.chest + up * (0.05 * k), pose.chest_facing, 0.135 * w,
       0.10 * w, 0.84, 1.3, outfit_.shirt, kTorso, {0, 0, 512, 110});
  limb(pose.pelvis - up * (0.09 * k), pose.pelvis + up * (0.03 * k), pose.facing, 0.118 * w,
       0.12 * w, 0.92, 1.28, outfit_.trousers, kTorso, {0, 0, 512, 100});
  limb(pose.chest + up * (0.08 * k), pose.head - up * (0.04 * k), pose.head_facing, 0.056 * k,
       0.052 * k, 1, 1, outfit_.skin, kHead, {0, 0, 128, 48});
  limb(pose.head - up * (0.045 * k) + pose.head_facing * (0.012 * k), pose.head + up * (0.04 * k),
       pose.head_facing, 0.074 * k, 0.088 * k, 1.12, 0.94, outfit_.face, kHead, {0, 0, 256, 256});
  for (int i = 0; i < 2; ++i) {
    const Limb arm = i == 0 ? kLeftArm : kRightArm, leg = i == 0 ? kLeftLeg : kRightLeg;
    const int sleeve = outfit_.long_sleeves ? outfit_.shirt : outfit_.skin;
    const float shift = i == 0 ? 20.0f : 290.0f;
    limb(pose.shoulder[i], pose.elbow[i], pose.chest_facing, 0.062 * w, 0.046 * w, 1, 1,
         outfit_.shirt, arm, {shift, 30, 180, 170});
    limb(pose.elbow[i], pose.wrist[i], pose.chest_facing, 0.045 * w, 0.034 * w, 1, 1, sleeve, arm,
         {shift + 60, 10, 150, 140});
    const Vec3 hand = normalized(pose.wrist[i] - pose.elbow[i]);
    limb(pose.wrist[i] + hand * (0.02 * k), pose.wrist[i] + hand * (0.11 * k), pose.chest_facing,
         0.036 * k, 0.028 * k, 1, 0.6, outfit_.skin, arm, {0, 0, 100, 100});
    limb(pose.hip[i], pose.knee[i], pose.facing, 0.092 * w, 0.064 * w, 1, 1, outfit_.trousers, leg,
         {shift, 0, 280, 250});
    limb(pose.knee[i], pose.ankle[i], pose.facing, 0.062 * w, 0.044 * w, 1, 1, outfit_.trousers,
         leg, {shift + 40, 20, 210, 230});
    const Vec3 toe = pose.toe_direction[i];
    const Vec3 sole = normalized(cross(cross(toe, up), toe)) * (-0.048 * k);
    limb(pose.ankle[i] + sole - toe * (0.045 * k), pose.ankle[i] + sole + toe * (0.155 * k), up,
         0.046 * k, 0.036 * k, 1, 0.95, outfit_.leather, leg, {0, 0, 128, 128});
    const Vec3 foot = pose.ankle[i] + toe * (0.05 * k);
    out_.shadows.push_back({foot.x, foot.y, 0.24, 0.55 * clamp01(1.25 - 2.5 * foot.z)});
  }
  out_.shadows.push_back({pose.pelvis.x, pose.pelvis.y, 0.62, 0.42});
  if (pose.carries) carton(pose);
}

void Body::limb(Vec3 from, Vec3 to, Vec3 front, double r0, double r1, double deep, double wide,
                int texture, Limb limb, TexturePart part) {
  RoundPart p;
  p.length = norm(to - from);
  if (p.length < 1e-3) return;
  r0 = std::min(r0, r1 + 0.95 * p.length), r1 = std::min(r1, r0 + 0.95 * p.length);
  p.frame.z = (to - from) * (1 / p.length);
  const Vec3 side = front - p.frame.z * dot(front, p.frame.z);
  p.frame.x =
      norm(side) > 0.05 ? normalized(side) : normalized(Vec3{0, 0, 1} - p.frame.z * p.frame.z.z);
  p.frame.y = cross(p.frame.z, p.frame.x), p.frame.origin = from;
  p.radius0 = r0, p.radius1 = r1, p.stretch_x = deep, p.stretch_y = wide;
  p.texture = texture, p.label = label_, p.limb = limb;
  p.texel_u = part.u, p.texel_v = part.v;
  p.texels_around = part.around, p.texels_along = part.along;
  out_.parts.push_back(p);
}

void Body::carton(const Pose& pose) {
  Frame f;
  f.y = pose.chest_facing, f.x = cross(f.y, f.z);
  f.origin = (pose.wrist[0] + pose.wrist[1]) * 0.5 + f.y * 0.10 - f.z * 0.17;
  Quad pattern;
  pattern.label = label_;
  append_box(out_.quads, f, {0.46, 0.34, 0.36}, outfit_.carton, textures_, 0, pattern);
}

}  // namespace stillpoint::synthetic
