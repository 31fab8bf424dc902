// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cstddef>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "stillpoint/core/config.hpp"
#include "stillpoint/core/normal_equations.hpp"
#include "stillpoint/core/random.hpp"
#include "stillpoint/core/rigid_motion.hpp"
#include "stillpoint/motion/corner_image.hpp"
#include "stillpoint/motion/flow.hpp"
#include "stillpoint/motion/packet.hpp"

namespace stillpoint::detail {

/// Corners that were followed, and the motion that most of their area agrees with.
class FlowConsensus {
 public:
  /// Fewer tell nothing.
  static constexpr std::size_t kMinFlows = 20;

  /// Forgets the flows; more come that are seen in `now`.
  void begin(const CornerImage& now) {
    flows_.clear();
    blocks_.clear();
    even_areas_.clear();
    fx_ = now.fx, fy_ = now.fy, cx_ = now.cx, cy_ = now.cy;
    scale_ = static_cast<float>(now.scale);
    tolerate(1);
  }

  /// Those without a say come last.
  void add(const Flow& f) {
    if (f.area > 0)
      even_areas_.push_back(f.even_area + (even_areas_.empty() ? 0 : even_areas_.back()));
    const std::size_t k = flows_.size() % 4;
    if (k == 0) blocks_.push_back(Block());
    blocks_.back().set(k, f);
    flows_.push_back(f);
  }

  /// From now on less exact agreement will do: what is blurred is found less exactly.
  void allow_blur() { tolerate(kBlurredTolerance); }
  bool allows_blur() const { return tolerance_ != 1; }

  const std::vector<Flow>& flows() const { return flows_; }

  double area() const {
    double area = 0;
    for (const Flow& f : flows_) area += static_cast<double>(f.area);
    return area;
  }

  /// Share of the area that agrees with a motion.
  double support(const Eigen::Isometry3d& T_current_last) const {
    return agreement(T_current_last, &Block::area);
  }

  /// Steps from a motion that is nearly right to the one nearby with the most support, and returns
  /// that.
  double refine(Eigen::Isometry3d& T) {
    if (voters() < kMinFlows) return 0;
    const float tolerance = tolerance_;
    tolerate(kBlurredTolerance);
    improve(T, 3);
    tolerate(tolerance);
    return improve(T, 6);
  }

  /// Turns the guess T into the motion with the most support, and returns that: steps from the
  /// guess and from `another` and, unless one of these has `enough`, from three flows at a time;
  /// then a rival may take its place.
  double search(Eigen::Isometry3d& T, Eigen::Isometry3d another, double enough) const {
    if (voters() < kMinFlows) return 0;
    const Eigen::Isometry3d guess = T;
    double best = improve(T);
    const double from_another = improve(another);
    if (from_another > best) T = another, best = from_another;
    const bool look_further = !(best > enough);
    RandomGenerator random(1);
    const auto any = [&] { return random.below(voters()); };
    // The more agree, the sooner three that are all of the world have been drawn.
    for (int i = 0; look_further && i < kHypotheses && i * best * best * best < 40; ++i) {
      std::optional<Eigen::Isometry3d> of_three = from_three(any, guess);
      if (!of_three || support(*of_three) < kPromising * best) continue;
      const double improved = improve(*of_three);
      if (improved > best) T = *of_three, best = improved;
    }
    if (look_further) T = rival(T, best, guess).value_or(T);
    return improve(T, 6);
  }

 private:
  static constexpr int kHypotheses = 100;
  static constexpr float kMaxError = 0.4f;          // fine pixels
  static constexpr float kBlurredTolerance = 2.5f;  // times kMaxError
  static constexpr double kTinyStep = 1e-5;
  static constexpr double kPromising = 0.5;
  // Of rival(): draws; the even support from which a motion has no rival, the even support that a
  // rival needs, by how much it must exceed the motion's, and how much of its support it needs.
  static constexpr int kRivals = 20;
  static constexpr double kNoRivalFrom = 0.75, kRivalNeeds = 0.6, kMoreEven = 0.06;
  static constexpr double kNearlyAsMuch = 0.85;

  // Four flows in packets; places without a flow have no area.
  struct Block {
    Packet x = Packet::constant(0), y = x, z = Packet::constant(1);  // in space before
    Packet u = x, v = x, depth = x, depth_tolerance = x, area = x, even_area = x;

    void set(std::size_t k, const Flow& f) {
      x.set(k, f.from.x()), y.set(k, f.from.y()), z.set(k, f.from.z());
      u.set(k, f.flat_u), v.set(k, f.flat_v), depth.set(k, f.depth_m), area.set(k, f.area);
      depth_tolerance.set(k, f.depth_m > 0 ? f.depth_tolerance_m : kHuge);
      even_area.set(k, f.even_area);
    }
  };

  struct Motion {
    Eigen::Matrix3f R;
    Eigen::Vector3f t;
    explicit Motion(const Eigen::Isometry3d& T)
        : R(T.linear().cast<float>()), t(T.translation().cast<float>()) {}
  };

  // How a motion explains a block: place in space over z, z, the errors in pixels, and 1 where the
  // corner is seen just there, falling to 0 at the greatest error.
  struct View {
    Packet x, y, z, eu, ev, nearness;
  };

  struct Normal {
    Eigen::Matrix<double, 6, 6> H = Eigen::Matrix<double, 6, 6>::Zero();  // lower half
    Eigen::Matrix<double, 6, 1> g = Eigen::Matrix<double, 6, 1>::Zero();
    std::size_t count = 0;
  };

  void tolerate(float tolerance) {
    tolerance_ = tolerance;
    const float max_error_px = tolerance * kMaxError * scale_;
    per_square_ = 1 / (max_error_px * max_error_px);
  }

  STILLPOINT_ALWAYS_INLINE View look(const Block& b, const Motion& m) const {
    View s;
    // What came too close is nowhere near its corner.
    s.z = (m.R(2, 0) * b.x + m.R(2, 1) * b.y + m.R(2, 2) * b.z + m.t[2])
              .max(CornerImage::kLeastDepthM);
    const Packet inverse = 1 / s.z;
    s.x = (m.R(0, 0) * b.x + m.R(0, 1) * b.y + m.R(0, 2) * b.z + m.t[0]) * inverse;
    s.y = (m.R(1, 0) * b.x + m.R(1, 1) * b.y + m.R(1, 2) * b.z + m.t[1]) * inverse;
    s.eu = fx_ * s.x + cx_ - b.u;
    s.ev = fy_ * s.y + cy_ - b.v;
    s.nearness = (1 - (s.eu * s.eu + s.ev * s.ev) * per_square_).max(0.0f);
    return s;
  }

  // Flows with a say.
  std::size_t voters() const { return even_areas_.size(); }

  // Share of one of the areas of the blocks that agrees with a motion.
  double agreement(const Eigen::Isometry3d& T_current_last, Packet Block::*area) const {
    const Motion move(T_current_last);
    Packet agree = Packet::constant(0), all = Packet::constant(0);
    for (const Block& b : blocks_) {
      const View seen = look(b, move);
      // 0 where a depth that is known speaks against it.
      const Packet excess = (b.depth - seen.z).abs() - b.depth_tolerance;
      agree += b.*area * seen.nearness * (1 - is_positive(excess));
      all += b.*area;
    }
    const double total = sum(all);
    return total > 0 ? sum(agree) / total : 0;
  }

  // A printed carton close by may have more corners than the room behind it, and a wall far away
  // hardly contradicts it. So another motion is taken that has clearly more support where corners
  // share the say of their part of the image, if it has nearly as much plain support. A few corners
  // far away would have much say then, and fit any motion: at least kMinFlows must agree.
  std::optional<Eigen::Isometry3d> rival(const Eigen::Isometry3d& T, double support_of_T,
                                         const Eigen::Isometry3d& guess) const {
    double most = agreement(T, &Block::even_area);
    if (most > kNoRivalFrom) return std::nullopt;
    most = std::max(kRivalNeeds, most + kMoreEven);
    RandomGenerator random(2);
    const auto by_even_area = [&] {
      const float drawn = static_cast<float>(random.uniform()) * even_areas_.back();
      const auto at = std::upper_bound(even_areas_.begin(), even_areas_.end() - 1, drawn);
      return static_cast<std::size_t>(at - even_areas_.begin());
    };
    std::optional<Eigen::Isometry3d> found;
    for (int i = 0; i < kRivals; ++i) {
      std::optional<Eigen::Isometry3d> of_three = from_three(by_even_area, guess);
      if (!of_three || agreement(*of_three, &Block::even_area) < kPromising * most) continue;
      if (improve(*of_three) < kNearlyAsMuch * support_of_T) continue;
      const double even = agreement(*of_three, &Block::even_area);
      if (even > most && agreeing(*of_three).count >= kMinFlows) found = of_three, most = even;
    }
    return found;
  }

  // The motion that three flows agree with: exact, by steps from the guess. `draw` gives one.
  template <class Draw>
  std::optional<Eigen::Isometry3d> from_three(const Draw& draw, Eigen::Isometry3d T) const {
    std::array<const Flow*, 3> three;
    for (const Flow*& f : three) f = &flows_[draw()];
    for (int i = 0; i < 3; ++i) {
      Normal normal;
      for (const Flow* f : three) add_to(normal, *f, T);
      if (normal.count < 3 || !step(normal, T)) return std::nullopt;
    }
    return T;
  }

  // Up to `steps` steps towards those that agree; the support then.
  double improve(Eigen::Isometry3d& T, int steps = 2) const {
    for (int i = 0; i < steps; ++i) {
      const Normal normal = agreeing(T);
      if (normal.count < kMinFlows / 2) return 0;
      const std::optional<double> size = step(normal, T);
      if (!size) return 0;
      if (*size < kTinyStep) break;
    }
    return support(T);
  }

  // All flows within the greatest error of a motion, the nearer the more.
  Normal agreeing(const Eigen::Isometry3d& T) const {
    const Motion move(T);
    const float fx = fx_, fy = fy_;
    NormalPackets<6> sums;
    Packet count = Packet::constant(0);
    for (const Block& b : blocks_) {
      const View s = look(b, move);
      const Packet weight = b.area * s.nearness * s.nearness, inverse = 1 / s.z;
      count += is_positive(weight);
      sums.add(weight,
               {fx * inverse, Packet::constant(0), -fx * inverse * s.x, -fx * s.x * s.y,
                fx * (1 + s.x * s.x), -fx * s.y},
               s.eu,
               {Packet::constant(0), fy * inverse, -fy * inverse * s.y, -fy * (1 + s.y * s.y),
                fy * s.x * s.y, fy * s.x},
               s.ev);
    }
    return {sums.matrix(), sums.right(), static_cast<std::size_t>(sum(count) + 0.5)};
  }

  // One flow, however far off.
  void add_to(Normal& normal, const Flow& f, const Eigen::Isometry3d& T) const {
    const Eigen::Vector3d q = T * f.from.cast<double>();
    if (q.z() < CornerImage::kLeastDepthM) return;
    const double z = q.z(), x = q.x() / z, y = q.y() / z;
    const double fx = fx_, fy = fy_;
    const Eigen::Vector2d e(fx * x + cx_ - f.flat_u, fy * y + cy_ - f.flat_v);
    const double ju[6] = {fx / z, 0, -fx * x / z, -fx * x * y, fx * (1 + x * x), -fx * y};
    const double jv[6] = {0, fy / z, -fy * y / z, -fy * (1 + y * y), fy * x * y, fy * x};
    const double weight = f.area;
    const double a0 = weight * ju[0], b1 = weight * jv[1];
    normal.H(0, 0) += a0 * ju[0], normal.g(0) += a0 * e.x();
    normal.H(1, 1) += b1 * jv[1], normal.g(1) += b1 * e.y();
    for (int i = 2; i < 6; ++i) {
      const double a = weight * ju[i], b = weight * jv[i];
      normal.H(i, 0) += a * ju[0], normal.H(i, 1) += b * jv[1];
      for (int j = 2; j <= i; ++j) normal.H(i, j) += a * ju[j] + b * jv[j];
      normal.g(i) += a * e.x() + b * e.y();
    }
    ++normal.count;
  }

  // Its size, metres and radians; none if there is no solution.
  static std::optional<double> step(const Normal& normal, Eigen::Isometry3d& T) {
    const auto solved = solve_normal_equations<6>(normal.H, -normal.g);
    if (!solved || solved->norm() > 1) return std::nullopt;
    T = motion_of_step(*solved) * T;
    normalize_rotation(T);
    return solved->norm();
  }

  // Of the image where the flows are seen.
  float fx_ = 1, fy_ = 1, cx_ = 0, cy_ = 0, scale_ = 1;
  float tolerance_ = 1;   // times kMaxError
  float per_square_ = 1;  // 1 over the square of the greatest error, pixels
  std::vector<Flow> flows_;
  std::vector<Block> blocks_;      // the same, four in a packet
  std::vector<float> even_areas_;  // of each flow with a say and all before it
};

}  // namespace stillpoint::detail
