// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <vector>

#include "stillpoint/core/camera.hpp"
#include "synthetic/surface.hpp"

namespace stillpoint::synthetic {

/// Finds the nearest surface of each pixel. Rectangles and round parts are met exactly (no
/// triangles), each inside its bounds on the image. One object per thread; a few ns per pixel and
/// layer.
///
/// Camera frames: x right, y down, z forward.
class Rasterizer {
 public:
  /// A surface number of no surface.
  static constexpr int kNothing = -1;

  explicit Rasterizer(const Camera& camera)
      : camera_(camera),
        inverse_depth_(static_cast<std::size_t>(camera.width) *
                       static_cast<std::size_t>(camera.height)),
        surface_(inverse_depth_.size()) {}

  /// Finds the nearest surface of each pixel. `shift_x`, `shift_y` move the ray inside its pixel.
  /// `fixed` and `moving` must live until the shading.
  void draw(const StaticScene& fixed, const MovingThings& moving, const Frame& camera_frame,
            double shift_x, double shift_y);

  /// A function that is linear in the pixel.
  struct Linear {
    double x = 0, y = 0, c = 0;
    double at(double px, double py) const { return x * px + y * py + c; }
  };
  /// A quad on the image: inverse depth, and its two coordinates (0 to 1) times inverse depth.
  struct Plane {
    Linear inverse_depth, u, v;
  };
  /// A round part in its own stretched frame: camera ray p(t) = start + t * direction with
  /// depth = t + depth0; start and direction are linear in the pixel.
  struct Round {
    Linear start[3], direction[3];
    double depth0 = 0, sine = 0, cosine2 = 1;
  };
  const Plane& plane(int surface) const { return planes_[static_cast<std::size_t>(surface)]; }
  const Round& round(int surface) const {
    return rounds_[static_cast<std::size_t>(surface - first_part_)];
  }
  const Camera& camera() const { return camera_; }
  const StaticScene& fixed() const { return *fixed_; }
  const MovingThings& moving() const { return *moving_; }
  const int* surface_row(int y) const { return surface_.data() + index(0, y); }
  const float* inverse_depth_row(int y) const { return inverse_depth_.data() + index(0, y); }
  int surface_at(int x, int y) const { return surface_[index(x, y)]; }
  /// Depth along the optical axis in metres; 0 where nothing is met.
  float depth_at(int x, int y) const {
    return surface_at(x, y) == kNothing ? 0 : 1 / inverse_depth_[index(x, y)];
  }
  bool is_part(int surface) const { return surface >= first_part_; }
  const Quad& quad(int surface) const {
    const auto i = static_cast<std::size_t>(surface);
    const std::size_t n = fixed_->quads.size();
    return i < n ? fixed_->quads[i] : moving_->quads[i - n];
  }
  const RoundPart& part(int surface) const {
    const auto i = static_cast<std::size_t>(surface - first_part_);
    const std::size_t n = fixed_->parts.size();
    return i < n ? fixed_->parts[i] : moving_->parts[i - n];
  }
  /// Position of a surface among the moving quads or parts; -1 when it stands still.
  int moving_index(int surface) const {
    return surface >= first_part_
               ? std::max(-1, surface - first_part_ - static_cast<int>(fixed_->parts.size()))
               : std::max(-1, surface - static_cast<int>(fixed_->quads.size()));
  }

 private:
  std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(camera_.width) +
           static_cast<std::size_t>(x);
  }
  /// The linear function n . ray for a direction n of camera coordinates.
  Linear along(Vec3 n) const {
    Linear f;
    f.x = n.x / camera_.fx, f.y = n.y / camera_.fy;
    f.c = n.z + f.x * shift_x_ + f.y * shift_y_;
    return f;
  }

  void draw_quad(int id);
  void draw_quad_row(const Plane& plane, int id, int y);

  /// Bounds on the image, in pixels.
  struct Box {
    double left = 0, right = 0, top = 0, bottom = 0;
  };
  /// Bounds of a ball that lies before the camera, a pixel wider.
  Box bounds(Vec3 c, double r) const;
  static int clipped(double value, int limit) {
    return static_cast<int>(std::min<double>(limit, std::max(0.0, value)));
  }
  /// Columns x0..x1 of the convex hull of two boxes in row y; x0 > x1: none.
  void span(const Box& a, const Box& b, int y, int& x0, int& x1) const;

  void draw_part(int number);
  void draw_part_row(const RoundPart& part, const Round& round, int id, int y, int x0, int x1);

  Camera camera_;
  Frame frame_;
  double shift_x_ = 0, shift_y_ = 0;
  const StaticScene* fixed_ = nullptr;
  const MovingThings* moving_ = nullptr;
  int first_part_ = 0;
  std::vector<float> inverse_depth_;
  std::vector<int> surface_;
  std::vector<Plane> planes_;
  std::vector<Round> rounds_;
};

}  // namespace stillpoint::synthetic
