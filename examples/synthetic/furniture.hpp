// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <vector>

#include "synthetic/light.hpp"
#include "synthetic/materials.hpp"
#include "synthetic/surface.hpp"

namespace stillpoint::synthetic {

/// A frame on the floor (or at height z), its y axis turned from the world's by `turns` quarter
/// turns and more (1 = 90 degrees to the left). Furniture shows its front toward -y of its frame.
Frame placed(double x, double y, double z, double turns = 0);

/// The same frame moved by local metres and turned further.
Frame moved(const Frame& f, Vec3 offset, double turns = 0);

/// Builds furniture into a StaticScene. Every texture is painted once and shared.
class Furnisher {
 public:
  Furnisher(StaticScene& scene, std::uint64_t seed);

  int paint(const Canvas& canvas) {
    scene_.textures.emplace_back(canvas);
    return static_cast<int>(scene_.textures.size()) - 1;
  }
  Random& random() { return random_; }
  int plaster_texture() const { return plaster_; }
  int carpet_texture() const { return carpet_; }
  int ceiling_texture() const { return ceiling_; }
  int oak_texture() const { return oak_; }
  int door_texture() const { return door_; }
  int carton_texture() { return pick(cartons_); }

  /// A box of a repeating material (`texels_per_m` > 0) or with one image per face (0).
  void box(const Frame& frame, Vec3 size, int texture, float texels_per_m = 300,
           std::array<float, 3> tint = {{1, 1, 1}}, bool hole_prone = false);

  /// A flat image whose middle lies at the frame's origin, facing -y of the frame.
  void panel(const Frame& frame, double width, double height, int texture, bool hole_prone = false,
             float glow = 0);

  /// A flat image lying at the frame's origin, seen from above.
  void sheet_on(const Frame& frame, double width, double depth, int texture);

  /// A round thing standing at the frame's origin.
  void round(const Frame& frame, double height, double radius0, double radius1, int texture,
             std::array<float, 3> tint);

  void poster_on(const Frame& f, bool wide) {
    const double width = wide ? random_.range(0.9, 1.2) : random_.range(0.5, 0.65);
    const double height = width * (wide ? 0.55 : random_.range(1.35, 1.55));
    panel(f, width, height, pick(wide ? posters_wide_ : posters_));
  }
  void photo_on(const Frame& f) {
    const double s = random_.range(0.28, 0.5);
    const double width = s * random_.range(0.9, 1.4);
    panel(f, width, s, pick(photos_));
  }

  /// A bookcase with boards and rows of books, some shelves with cartons.
  void bookcase(const Frame& f, double width, double height, double depth);

  /// A few things side by side on a surface of width x depth, at most `height` tall.
  void clutter(const Frame& f, double width, double depth, double height);

  /// A table with monitors, keyboards, papers and small things.
  void desk(const Frame& f, double width, double depth, int monitors);

  /// A chair; its seat is 0.46 m high, its sitter looks toward -y of the frame.
  void chair(const Frame& f);

  /// A closed cabinet with things on top.
  void cabinet(const Frame& f, double width, double depth, double height);

  std::array<float, 3> tint(double strength = 0.5) {
    const auto one = [&] { return static_cast<float>(1 - strength * random_() * 1.4); };
    const float r = one(), g = one();
    return {{r, g, one()}};
  }

 private:
  int pick(const std::vector<int>& from) {
    return from[static_cast<std::size_t>(random_.below(static_cast<int>(from.size())))];
  }

  StaticScene& scene_;
  Random random_;
  int plaster_, carpet_, ceiling_, oak_, dark_wood_, gray_, door_;
  std::vector<int> posters_, posters_wide_, photos_, books_, cartons_, screens_, sheets_;
};

}  // namespace stillpoint::synthetic
