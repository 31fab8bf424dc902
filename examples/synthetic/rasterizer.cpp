// SPDX-License-Identifier: BSD-2-Clause
#include "synthetic/rasterizer.hpp"

namespace stillpoint::synthetic {

void Rasterizer::draw(const StaticScene& fixed, const MovingThings& moving,
                      const Frame& camera_frame, double shift_x, double shift_y) {
  fixed_ = &fixed, moving_ = &moving, frame_ = camera_frame;
  shift_x_ = shift_x - camera_.cx, shift_y_ = shift_y - camera_.cy;
  std::fill(inverse_depth_.begin(), inverse_depth_.end(), 0.02f);
  std::fill(surface_.begin(), surface_.end(), kNothing);
  first_part_ = static_cast<int>(fixed.quads.size() + moving.quads.size());
  planes_.resize(static_cast<std::size_t>(first_part_));
  rounds_.resize(fixed.parts.size() + moving.parts.size());
  for (int i = 0; i < first_part_; ++i) draw_quad(i);
  for (int i = 0; i < static_cast<int>(rounds_.size()); ++i) draw_part(i);
}

void Rasterizer::draw_quad(int id) {
  const Quad& q = quad(id);
  const Vec3 p = frame_.to_local(q.corner);
  const Vec3 u{dot(q.edge_u, frame_.x), dot(q.edge_u, frame_.y), dot(q.edge_u, frame_.z)};
  const Vec3 v{dot(q.edge_v, frame_.x), dot(q.edge_v, frame_.y), dot(q.edge_v, frame_.z)};
  const Vec3 n = cross(v, u);
  const double d = dot(n, p);
  if (d >= 0) return;  // seen from behind
  double low = camera_.height, high = -1, left = camera_.width, right = -1;
  bool clipped = false;
  for (const Vec3 c : {p, p + u, p + v, p + u + v}) {
    if (c.z < 0.05) {
      clipped = true;
      continue;
    }
    const double px = camera_.fx * c.x / c.z - shift_x_, py = camera_.fy * c.y / c.z - shift_y_;
    low = std::min(low, py), high = std::max(high, py);
    left = std::min(left, px), right = std::max(right, px);
  }
  if (p.z < 0.05 && (p + u).z < 0.05 && (p + v).z < 0.05 && (p + u + v).z < 0.05) return;
  if (clipped) low = 0, high = camera_.height - 1, left = 0, right = camera_.width - 1;
  if (right < 0 || left > camera_.width - 1 || high < 0 || low > camera_.height - 1) return;
  Plane& plane = planes_[static_cast<std::size_t>(id)];
  plane.inverse_depth = along(n * (1 / d));
  const auto coordinate = [&](Vec3 edge) {
    const Vec3 e = edge * (1 / dot(edge, edge));
    Linear f = along(e);
    const double offset = dot(e, p);
    f.x -= offset * plane.inverse_depth.x, f.y -= offset * plane.inverse_depth.y;
    f.c -= offset * plane.inverse_depth.c;
    return f;
  };
  plane.u = coordinate(u), plane.v = coordinate(v);
  const int y0 = std::max(0, static_cast<int>(low) - 1);
  const int y1 = std::min(camera_.height - 1, static_cast<int>(high) + 1);
  for (int y = y0; y <= y1; ++y) draw_quad_row(plane, id, y);
}

void Rasterizer::draw_quad_row(const Plane& plane, int id, int y) {
  const Linear& w = plane.inverse_depth;
  double a = 0, b = camera_.width - 1;
  const auto keep = [&](double slope, double value) {  // slope * x + value >= 0
    if (slope > 0)
      a = std::max(a, -value / slope - 1e-6);
    else if (slope < 0)
      b = std::min(b, -value / slope + 1e-6);
    else if (value < 0)
      b = -1;
  };
  const double wy = w.y * y + w.c, uy = plane.u.y * y + plane.u.c;
  const double vy = plane.v.y * y + plane.v.c;
  keep(plane.u.x, uy), keep(w.x - plane.u.x, wy - uy);
  keep(plane.v.x, vy), keep(w.x - plane.v.x, wy - vy);
  keep(w.x, wy - 0.02);
  if (!(a <= b)) return;
  const int xa = static_cast<int>(a) + (a > static_cast<int>(a) ? 1 : 0);
  const int xb = static_cast<int>(b);
  float* depth = inverse_depth_.data() + index(0, y);
  int* ids = surface_.data() + index(0, y);
  const auto slope = static_cast<float>(w.x), offset = static_cast<float>(wy);
  for (int x = xa; x <= xb; ++x) {
    const float value = offset + slope * static_cast<float>(x);
    const bool nearer = value > depth[x];
    depth[x] = nearer ? value : depth[x];
    ids[x] = nearer ? id : ids[x];
  }
}

Rasterizer::Box Rasterizer::bounds(Vec3 c, double r) const {
  const auto most = [&](double x, bool upper) {  // of x / z over the ball's cube
    return upper == (x > 0) ? x / (c.z - r) : x / (c.z + r);
  };
  return {most(c.x - r, false) * camera_.fx - shift_x_ - 1,
          most(c.x + r, true) * camera_.fx - shift_x_ + 1,
          most(c.y - r, false) * camera_.fy - shift_y_ - 1,
          most(c.y + r, true) * camera_.fy - shift_y_ + 1};
}

void Rasterizer::span(const Box& a, const Box& b, int y, int& x0, int& x1) const {
  double left = 1e9, right = -1e9;
  const auto take = [&](double l, double r) {
    left = std::min(left, l), right = std::max(right, r);
  };
  for (const Box* box : {&a, &b})
    if (y >= box->top && y <= box->bottom) take(box->left, box->right);
  const auto between = [&](double ya, double yb) {  // the lines between like corners
    const double d = yb - ya, w = d < 1e-9 && d > -1e-9 ? -1 : (y - ya) / d;
    if (w >= 0 && w <= 1) take(a.left + (b.left - a.left) * w, a.right + (b.right - a.right) * w);
  };
  between(a.top, b.top), between(a.bottom, b.bottom);
  x0 = clipped(left, camera_.width);
  x1 = right < 0 ? -1 : std::min(x1, clipped(right, camera_.width));
}

void Rasterizer::draw_part(int number) {
  const RoundPart& part = this->part(first_part_ + number);
  Round& round = rounds_[static_cast<std::size_t>(number)];
  const Vec3 a = frame_.to_local(part.frame.origin);
  const Vec3 b = frame_.to_local(part.frame.to_world({0, 0, part.length}));
  const double widest = std::max({1.0, part.stretch_x, part.stretch_y});
  const double ra = part.radius0 * widest, rb = part.radius1 * widest;
  if (a.z + ra < 0.1 && b.z + rb < 0.1) return;
  const bool bounded = a.z - ra > 0.1 && b.z - rb > 0.1;
  const Box end0 = bounded ? bounds(a, ra) : Box{}, end1 = bounded ? bounds(b, rb) : Box{};
  int y0 = 0, y1 = camera_.height - 1;
  if (bounded) {
    y0 = clipped(std::min(end0.top, end1.top), camera_.height);
    y1 = std::min(y1, clipped(std::max(end0.bottom, end1.bottom), camera_.height));
  }
  const Vec3 axes[3] = {part.frame.x * (1 / part.stretch_x), part.frame.y * (1 / part.stretch_y),
                        part.frame.z};
  round.depth0 = std::max(0.1, (a.z + b.z) / 2);
  for (int i = 0; i < 3; ++i) {
    const Vec3 axis{dot(axes[i], frame_.x), dot(axes[i], frame_.y), dot(axes[i], frame_.z)};
    round.direction[i] = along(axis);
    const Linear& d = round.direction[i];
    round.start[i] = {d.x * round.depth0, d.y * round.depth0, d.c * round.depth0 - dot(axis, a)};
  }
  round.sine = (part.radius0 - part.radius1) / part.length;
  round.cosine2 = 1 - round.sine * round.sine;
  for (int y = y0; y <= y1; ++y) {
    int x0 = 0, x1 = camera_.width - 1;
    if (bounded) span(end0, end1, y, x0, x1);
    if (x0 <= x1) draw_part_row(part, round, first_part_ + number, y, x0, x1);
  }
}

void Rasterizer::draw_part_row(const RoundPart& part, const Round& round, int id, int y, int x0,
                               int x1) {
  const auto radius0 = static_cast<float>(part.radius0);
  const auto radius1 = static_cast<float>(part.radius1);
  const auto length = static_cast<float>(part.length), s = static_cast<float>(round.sine);
  const auto c2 = static_cast<float>(round.cosine2), base = static_cast<float>(round.depth0);
  const float z_low = radius0 * s, z_high = length + radius1 * s;
  float o0[3], ox[3], d0[3], dx[3];
  for (int i = 0; i < 3; ++i) {
    o0[i] = static_cast<float>(round.start[i].y * y + round.start[i].c);
    d0[i] = static_cast<float>(round.direction[i].y * y + round.direction[i].c);
    ox[i] = static_cast<float>(round.start[i].x);
    dx[i] = static_cast<float>(round.direction[i].x);
  }
  float* depth = inverse_depth_.data() + index(0, y);
  int* ids = surface_.data() + index(0, y);
  for (int x = x0; x <= x1; ++x) {
    const auto px = static_cast<float>(x);
    const float p = o0[0] + ox[0] * px, q = o0[1] + ox[1] * px, r = o0[2] + ox[2] * px;
    const float dp = d0[0] + dx[0] * px, dq = d0[1] + dx[1] * px, dr = d0[2] + dx[2] * px;
    // The cone between the spheres: c2 (x^2 + y^2) = (radius0 - s z)^2.
    const float flat = dp * dp + dq * dq, flat_b = p * dp + q * dq, flat_c = p * p + q * q;
    const float g = radius0 - s * r;
    const float ca = c2 * flat - s * s * dr * dr, cb = c2 * flat_b + s * dr * g;
    const float cc = c2 * flat_c - g * g, root = cb * cb - ca * cc;
    float t = std::numeric_limits<float>::max();
    if (root > 0 && ca > 0) {
      const float hit = (-cb - std::sqrt(root)) / ca, z = r + hit * dr;
      if (z >= z_low && z <= z_high) t = hit;
    }
    if (t == std::numeric_limits<float>::max()) {  // the end spheres
      const float sa = flat + dr * dr;
      const auto sphere = [&](float centre, float radius) {
        const float rz = r - centre, sb = flat_b + rz * dr;
        const float under = sb * sb - sa * (flat_c + rz * rz - radius * radius);
        if (under > 0) t = std::min(t, (-sb - std::sqrt(under)) / sa);
      };
      sphere(0, radius0), sphere(length, radius1);
      if (t == std::numeric_limits<float>::max()) continue;
    }
    const float z = base + t;
    if (!(z > 0.1f)) continue;
    const float value = 1 / z;
    if (value > depth[x]) depth[x] = value, ids[x] = id;
  }
}

}  // namespace stillpoint::synthetic
