// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <vector>

#include "synthetic/body.hpp"
#include "synthetic/path.hpp"
#include "synthetic/room.hpp"

namespace stillpoint::synthetic {

/// Most people that the lanes hold without touching each other.
constexpr int kMostPeople = 20;

/// People of the sequence: on which lane each walks, how fast, in what clothes. Lanes are closed
/// ways that touch neither furniture nor each other; all on one lane walk in the same direction at
/// the same speed. Each person is a function of time alone.
class People {
 public:
  /// Paints the clothes into `scene`. `near_lane_free`: a mover has the lane nearest to the camera.
  /// `near_lane_backwards`: people cross close before the camera from right to left.
  People(StaticScene& scene, const RoomPlan& plan, int count, bool seated, bool carried_object,
         bool near_lane_free, bool near_lane_backwards, std::uint64_t seed);

  int count() const { return static_cast<int>(people_.size()); }

  /// Appends all people as they are at time `t_s`, labelled 1, 2, ...
  void append(double t_s, const std::vector<Texture>& textures, MovingThings& out) const;

 private:
  struct Lane {
    RoundedRectangle way;
    double slowest, fastest;
    int capacity;
  };
  struct Person {
    RoundedRectangle way{0, 1, 0, 1, 0.2};
    double speed = 1, start_m = 0, step_phase = 0, phase = 0;
    /// How much slower, and where on the way.
    double slowing = 0, slowest_m = 0;
    bool backwards = false, carries = false;
    int seat = -1;
    Outfit outfit;
  };

  static RoundedRectangle::Place place(const Person& p, double s) {
    RoundedRectangle::Place at = p.way.at(p.start_m + (p.backwards ? -s : s));
    if (p.backwards) at.direction = -at.direction;
    return at;
  }
  /// Metres walked since the start. On the near lane people are slowest in the middle of the view
  /// and catch up behind.
  static double way_walked(const Person& p, double t);
  /// Direction of the way, averaged over the body's turning.
  static Vec3 heading(const Person& p, double s) {
    Vec3 d;
    for (int i = -2; i <= 2; ++i) d = d + place(p, s + 0.09 * i).direction;
    return normalized(d);
  }

  /// The upper body: `sway` are left-right, forward and turning of the chest.
  static void trunk(const Person& p, Pose& pose, double turn, double lean);

  static Pose walking(const Person& p, double t);

  /// Puts a foot: it stands still on the ground for 62 % of the cycle and then swings to the next
  /// place, so that nobody slides.
  static void foot(const Person& p, double cycle, double stride, double s, int i, Pose& pose);

  Pose sitting(const Person& p, double t) const;

  std::vector<Frame> seats_;
  std::vector<Person> people_;
};

}  // namespace stillpoint::synthetic
