// SPDX-License-Identifier: BSD-2-Clause
#include "synthetic/people.hpp"

namespace stillpoint::synthetic {

People::People(StaticScene& scene, const RoomPlan& plan, int count, bool seated,
               bool carried_object, bool near_lane_free, bool near_lane_backwards,
               std::uint64_t seed)
    : seats_(plan.seats) {
  const Lane lanes[] = {
      {{-1.5, 0.5, -1.85, -1.15, 0.35}, 0.60, 0.80, 2},  // at 1.05 to 1.75 m from the camera
      {{-1.9, 1.9, 0.0, 1.55, 0.45}, 0.80, 1.20, 6},     // around the island
      {{2.5, 3.0, -2.2, 2.2, 0.25}, 0.60, 1.00, 4},      // right
      {{-3.0, -2.5, -2.2, 2.2, 0.25}, 0.60, 1.00, 4},    // left; passes behind the partition
      {{-2.1, 2.1, 2.1, 2.65, 0.27}, 0.90, 1.40, 4}};    // at the far side
  // Who comes first walks where most is seen of him.
  const int order[] = {0, 0, 1, 4, 1, 1, 4, 2, 1, 3, 1, 4, 2, 1, 3, 4, 2, 3, 2, 3};
  const int order_without_near[] = {1, 1, 4, 1, 4, 1, 2, 3, 1, 4, 1, 2, 3, 4, 2, 3, 2, 3};
  int taken[5] = {0, 0, 0, 0, 0}, total[5] = {0, 0, 0, 0, 0};
  const auto lane_of = [&](int i) { return near_lane_free ? order_without_near[i] : order[i]; };
  for (int i = 0; i < count; ++i) ++total[lane_of(i)];
  for (int i = 0; i < count; ++i) {
    Random random(hash(seed, 0x9e091e, static_cast<std::uint64_t>(i)));
    const int which = lane_of(i);
    Random lane_random(hash(seed, 0x1a4e, static_cast<std::uint64_t>(which)));
    Person p;
    p.way = lanes[which].way;
    p.speed = lane_random.range(lanes[which].slowest, lanes[which].fastest);
    p.backwards = lane_random.below(2) != 0;
    if (which == 0) {
      p.backwards = near_lane_backwards;
      p.slowing = 0.08, p.slowest_m = 0.65;
    }
    // On the near lane the first two follow each other closely, so that they cross together, and
    // the crossing comes soon.
    const double start =
        which == 0 ? (p.backwards ? 0.36 : 0.0) + lane_random.range(0.0, 0.1) : lane_random();
    const double behind = which == 0 ? 0.33 : 1.0 / total[which];
    p.start_m = p.way.length() * (start + behind * taken[which]++);
    p.step_phase = random(), p.phase = 10 * random();
    p.seat = seated && i < static_cast<int>(seats_.size()) ? i : -1;
    if (seated) p.speed = 0;
    p.carries = carried_object && i % 2 == 0 && p.seat < 0;
    p.outfit.height_m = 1.75 * random.range(0.94, 1.06), p.outfit.width = random.range(0.92, 1.12);
    p.outfit.long_sleeves = random.below(2) != 0;
    const auto paint = [&](const Canvas& canvas) {
      scene.textures.emplace_back(canvas);
      return static_cast<int>(scene.textures.size()) - 1;
    };
    const std::uint64_t tone = random.bits();  // face and hands have the same skin
    p.outfit.shirt = paint(cloth(random.bits(), false));
    p.outfit.trousers = paint(cloth(random.bits(), true));
    p.outfit.face = paint(face(tone)), p.outfit.skin = paint(skin(tone));
    p.outfit.leather = paint(leather(random.bits()));
    p.outfit.carton = plan.carton_texture;
    people_.push_back(p);
  }
}

void People::append(double t_s, const std::vector<Texture>& textures, MovingThings& out) const {
  for (int i = 0; i < count(); ++i) {
    const Person& p = people_[static_cast<std::size_t>(i)];
    Body body(p.outfit, static_cast<std::uint8_t>(i + 1), textures, out);
    body.build(p.seat >= 0 ? sitting(p, t_s) : walking(p, t_s));
  }
}

double People::way_walked(const Person& p, double t) {
  const double s = p.speed * t;
  if (p.slowing == 0) return s;
  const double length = p.way.length();
  const auto shift = [&](double at) {
    return p.slowing * length * sine(2 * kPi * (at - p.slowest_m) / length);
  };
  const double sign = p.backwards ? -1 : 1;
  return sign * (sign * s - shift(p.start_m + sign * s) + shift(p.start_m));
}

void People::trunk(const Person& p, Pose& pose, double turn, double lean) {
  const double k = p.outfit.height_m / 1.75;
  const Vec3 up{0, 0, 1}, left = cross(up, pose.facing);
  pose.chest_facing = normalized(pose.facing + left * turn);
  const Vec3 across = cross(up, pose.chest_facing);
  pose.chest = pose.pelvis + up * (0.38 * k) + pose.facing * (lean * 0.38 * k);
  pose.head = pose.chest + up * (0.29 * k) + pose.facing * ((0.02 + 0.2 * lean) * k);
  for (int i = 0; i < 2; ++i) {
    const double side = i == 0 ? 1 : -1;
    pose.shoulder[i] = pose.chest + up * (0.065 * k) + across * (side * 0.185 * k * p.outfit.width);
    pose.hip[i] = pose.pelvis - up * (0.04 * k) + left * (side * 0.092 * k);
  }
}

Pose People::walking(const Person& p, double t) {
  const double k = p.outfit.height_m / 1.75;
  const double stride = (0.5 + 0.68 * p.speed) * k;  // two steps
  const double s = way_walked(p, t), cycle = s / stride + p.step_phase;
  const Vec3 up{0, 0, 1};
  Pose pose;
  pose.facing = heading(p, s);
  const Vec3 left = cross(up, pose.facing);
  const double swing = p.speed > 0 ? sine(2 * kPi * cycle) : 0;
  const double still = p.speed > 0 ? 0 : sine(2 * kPi * (t / 4.3 + p.phase));
  const double bob = p.speed > 0 ? -0.023 * cosine(4 * kPi * (cycle - 0.06)) : 0.002 * still;
  pose.pelvis = place(p, s).position + up * ((0.968 + bob) * k) +
                left * (k * (0.018 * swing + 0.012 * still));
  const double arm = cosine(2 * kPi * cycle);  // 1: left foot in front
  trunk(p, pose, 0.10 * arm + 0.02 * still, 0.05 + 0.03 * p.speed + 0.01 * still);
  pose.head_facing = normalized(pose.facing + left * (0.25 * sine(2 * kPi * (t / 5.1 + p.phase))));
  for (int i = 0; i < 2; ++i) foot(p, cycle + (i == 0 ? 0.0 : 0.5), stride, s, i, pose);
  for (int i = 0; i < 2; ++i) {
    const double side = i == 0 ? 1 : -1;
    pose.knee[i] = bend_joint(pose.hip[i], pose.ankle[i], 0.45 * k, 0.43 * k,
                              pose.facing + left * (0.08 * side));
    if (p.carries) {
      pose.carries = true;
      const Vec3 right_hand = pose.chest - up * (0.2 * k) + pose.chest_facing * (0.33 * k);
      pose.wrist[i] = right_hand + cross(up, pose.chest_facing) * (side * 0.2) + up * (0.01 * arm);
    } else {
      const double angle = p.speed > 0 ? -side * arm * (0.28 + 0.22 * p.speed) : 0.06 * still;
      const double elbow = 0.25 + 0.3 * clamp01(angle + 0.2);
      const Vec3 out = left * (side * 0.10);
      const Vec3 upper = normalized(pose.facing * sine(angle) - up * cosine(angle) + out);
      const Vec3 lower =
          normalized(pose.facing * sine(angle + elbow) - up * cosine(angle + elbow) + out * 0.4);
      pose.elbow[i] = pose.shoulder[i] + upper * (0.29 * k);
      pose.wrist[i] = pose.elbow[i] + lower * (0.25 * k);
      continue;
    }
    pose.elbow[i] =
        bend_joint(pose.shoulder[i], pose.wrist[i], 0.29 * k, 0.25 * k, left * (side * 0.6) - up);
  }
  pose.carries = p.carries;
  return pose;
}

void People::foot(const Person& p, double cycle, double stride, double s, int i, Pose& pose) {
  const double k = p.outfit.height_m / 1.75, side = i == 0 ? 1 : -1, stance = 0.62;
  const double whole = std::floor(cycle), phase = cycle - whole;
  // Where along the way the body is in the middle of this stance.
  const double middle = s + (stance / 2 - phase) * (p.speed > 0 ? stride : 0);
  const auto print = [&](double at, Vec3& direction) {
    direction = heading(p, at);
    return place(p, at).position + cross(Vec3{0, 0, 1}, direction) * (side * 0.085 * k);
  };
  Vec3 direction;
  Vec3 ground = print(middle, direction);
  double lift = 0, pitch = 0;  // height of the ankle above its place; toe down positive
  if (p.speed > 0) {
    if (phase > stance) {
      const double swing = (phase - stance) / (1 - stance), w = smooth_step(swing);
      Vec3 next_direction;
      const Vec3 next = print(middle + stride, next_direction);
      ground = mix(ground, next, w), direction = normalized(mix(direction, next_direction, w));
      lift = 0.10 * (1 - swing) * (1 - swing) * (1 + 2 * swing) + 0.05 * sine(kPi * swing);
      pitch = 0.75 * (1 - smooth_step(swing * 1.3)) - 0.35 * smooth_step(swing * 1.6 - 0.6);
    } else {
      const double heel = smooth_step((phase - 0.36) / (stance - 0.36));
      lift = 0.10 * heel, pitch = 0.75 * heel;
      if (phase < 0.08) pitch = -0.35 * (1 - smooth_step(phase / 0.08));
      ground = ground + direction * (0.04 * heel);
    }
  }
  pose.ankle[i] = ground + Vec3{0, 0, (0.088 + lift) * k};
  pose.toe_direction[i] = direction * cosine(pitch) - Vec3{0, 0, sine(pitch)};
}

Pose People::sitting(const Person& p, double t) const {
  const double k = p.outfit.height_m / 1.75;
  const Frame& seat = seats_[static_cast<std::size_t>(p.seat)];
  const Vec3 up{0, 0, 1};
  const auto slow = [&](double period, double shift) {
    return sine(2 * kPi * (t / period + p.phase + shift));
  };
  Pose pose;
  pose.facing = -seat.y;
  const Vec3 left = cross(up, pose.facing);
  pose.pelvis = seat.origin - pose.facing * 0.05 + up * 0.58;
  trunk(p, pose, 0.05 * slow(4.7, 0), -0.04 + 0.03 * slow(6.1, 0.2));
  pose.head_facing = normalized(pose.facing + left * (0.35 * slow(5.3, 0.4)));
  for (int i = 0; i < 2; ++i) {
    const double side = i == 0 ? 1 : -1;
    pose.ankle[i] = seat.origin + pose.facing * (0.40 * k + 0.05 * side) + left * (side * 0.12) +
                    up * (0.088 * k);
    pose.toe_direction[i] = normalized(pose.facing + left * (0.2 * side));
    pose.knee[i] = bend_joint(pose.hip[i], pose.ankle[i], 0.45 * k, 0.43 * k,
                              pose.facing + up * 0.8 + left * (0.1 * side));
    const double gesture = i == 0 ? 0.05 * slow(2.9, 0.1) : 0.03 * slow(3.7, 0.6);
    pose.wrist[i] =
        pose.pelvis + pose.facing * (0.34 * k) + left * (side * 0.13) + up * (0.12 + gesture);
    pose.elbow[i] = bend_joint(pose.shoulder[i], pose.wrist[i], 0.29 * k, 0.25 * k,
                               left * (side * 0.5) - up - pose.facing * 0.5);
  }
  return pose;
}

}  // namespace stillpoint::synthetic
