// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "synthetic/clothes.hpp"
#include "synthetic/surface.hpp"

namespace stillpoint::synthetic {

/// How a person looks.
struct Outfit {
  int shirt = 0, trousers = 0, face = 0, skin = 0, leather = 0, carton = 0;
  double height_m = 1.75, width = 1;
  bool long_sleeves = true;
};

/// Where a person's joints are, metres in the world. `facing` is level.
struct Pose {
  Vec3 facing{0, 1, 0};
  Vec3 pelvis, chest, head;
  /// Left, right.
  Vec3 shoulder[2], elbow[2], wrist[2], hip[2], knee[2], ankle[2], toe_direction[2];
  Vec3 chest_facing{0, 1, 0}, head_facing{0, 1, 0};
  bool carries = false;
};

/// A joint between `from` and `to` with bones of the given lengths, bent toward `side`. When `to`
/// is out of reach it is drawn nearer.
Vec3 bend_joint(Vec3 from, Vec3& to, double upper, double lower, Vec3 side);

/// Turns a pose into round parts (and the quads of a carried carton) with the person's label.
class Body {
 public:
  Body(const Outfit& outfit, std::uint8_t label, const std::vector<Texture>& textures,
       MovingThings& out)
      : outfit_(outfit), label_(label), textures_(textures), out_(out) {}

  void build(const Pose& pose);

 private:
  struct TexturePart {
    float u, v, around, along;
  };

  void limb(Vec3 from, Vec3 to, Vec3 front, double r0, double r1, double deep, double wide,
            int texture, Limb limb, TexturePart part);

  void carton(const Pose& pose);

  const Outfit& outfit_;
  std::uint8_t label_;
  const std::vector<Texture>& textures_;
  MovingThings& out_;
};

}  // namespace stillpoint::synthetic
