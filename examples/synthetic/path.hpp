// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "synthetic/math.hpp"

namespace stillpoint::synthetic {

/// A closed way on the floor: a rectangle with round corners, run through counterclockwise.
class RoundedRectangle {
 public:
  RoundedRectangle(double x0, double x1, double y0, double y1, double radius_m)
      : x0_(x0), x1_(x1), y0_(y0), y1_(y1), r_(radius_m) {}

  double length() const { return 2 * (straight_x() + straight_y()) + 2 * kPi * r_; }

  /// Point and direction after `s` metres from the lower left end of the lower side.
  struct Place {
    Vec3 position, direction;
  };
  Place at(double s) const {
    s -= length() * std::floor(s / length());
    const double quarter = kPi * r_ / 2;
    const double sides[4] = {straight_x(), straight_y(), straight_x(), straight_y()};
    const Vec3 starts[4] = {
        {x0_ + r_, y0_, 0}, {x1_, y0_ + r_, 0}, {x1_ - r_, y1_, 0}, {x0_, y1_ - r_, 0}};
    const Vec3 directions[4] = {{1, 0, 0}, {0, 1, 0}, {-1, 0, 0}, {0, -1, 0}};
    for (int i = 0; i < 4; ++i) {
      if (s < sides[i] || (i == 3 && s - sides[i] >= quarter))
        return {starts[i] + directions[i] * s, directions[i]};
      s -= sides[i];
      if (s < quarter) {
        const double a = s / r_;
        const Vec3 ahead = directions[i], left{-ahead.y, ahead.x, 0};
        const Vec3 start = starts[i] + ahead * sides[i];
        return {start + ahead * (r_ * sine(a)) + left * (r_ * (1 - cosine(a))),
                ahead * cosine(a) + left * sine(a)};
      }
      s -= quarter;
    }
    return {starts[0], directions[0]};
  }

 private:
  double straight_x() const { return x1_ - x0_ - 2 * r_; }
  double straight_y() const { return y1_ - y0_ - 2 * r_; }

  double x0_, x1_, y0_, y1_, r_;
};

}  // namespace stillpoint::synthetic
