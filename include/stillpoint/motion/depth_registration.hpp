// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <tuple>
#include <vector>

#include "stillpoint/core/normal_equations.hpp"
#include "stillpoint/core/rigid_motion.hpp"
#include "stillpoint/motion/depth_cells.hpp"
#include "stillpoint/motion/depth_key_view.hpp"
#include "stillpoint/motion/depth_shot.hpp"
#include "stillpoint/motion/free_space_map.hpp"
#include "stillpoint/motion/packet.hpp"
#include "stillpoint/sensor/sensor_model.hpp"

namespace stillpoint {

/// Finds the pose of a depth image against the surfaces of the last seconds, from near a predicted
/// one: Gauss-Newton steps on the differences of depth (projective ICP) with Tukey's weights.
///
/// Poses from color images are those of another moment (Kinects take depth and color up to 17 ms
/// apart, and read both out row by row), and drift. What compares depth images needs the pose of
/// the depth image itself, and this finds it to a fraction of a cell. A cell counts by the area
/// that it stands for in space, so that a person close by has no more say than the wall behind.
class DepthRegistration {
 public:
  explicit DepthRegistration(const SensorModel& sensor = {})
      : sensor_(sensor), nearest_m_(std::max(1e-3f, static_cast<float>(sensor.min_range_m))) {}

  struct Result {
    Eigen::Isometry3d T_map_depth = Eigen::Isometry3d::Identity();
    /// Share of the comparable cells whose depth agrees, 0 to 1.
    double fit = 0;
    /// By how much the rows are read out more slowly than `shot` says, seconds, and how much that
    /// is worth: one over its variance. 0 where the camera does not rotate.
    double readout_off_s = 0, readout_information = 0;
  };

  /// `shot`: the image with the predicted pose, whose standard deviations are given. `moving`: one
  /// byte per cell, not 0 = has no say; may be empty. No value where too few cells can be compared.
  /// O(cells).
  std::optional<Result> align(const DepthShot& shot, const DepthCells& cells,
                              const std::vector<std::uint8_t>& moving, const FreeSpaceMap& map,
                              double rotation_sigma, double translation_sigma_m) {
    static constexpr std::array<double, 3> kAgesS = {1.6, 0.5, 0.05};
    map.views_at(shot.timestamp, kAgesS, views_);
    take_points(cells, moving, shot);
    Result result;
    result.T_map_depth = shot.T_map_depth;
    for (int i = 0; i < kSteps; ++i) {
      // From far few agree exactly, and few points are enough.
      compare(cells, result.T_map_depth, i == 0 ? 3.0f : i == 1 ? 2.0f : 1.0f, i < 2 ? 2 : 1);
      if (sum(counts_.weighted) < kFewest) return std::nullopt;
      result.fit = sum(counts_.agreeing) / sum(counts_.compared);
      const double step = improve(shot, rotation_sigma, translation_sigma_m, result);
      if (!(step < kMostStep)) return std::nullopt;
      if (i >= 2 && step < kTinyStep) break;
    }
    return result;
  }

 private:
  using Packet = detail::Packet;
  static constexpr int kSteps = 4;
  static constexpr double kFewest = 100;                      // cells
  static constexpr double kMostStep = 0.5, kTinyStep = 1e-3;  // radians and metres
  // Neighbors err alike: so many cells tell as much as all.
  static constexpr double kIndependent = 50;
  static constexpr float kTukey = 4;         // sigmas beyond which a cell has no say
  static constexpr float kMostCountedM = 4;  // area grows no more beyond
  static constexpr float kSmoothM = 0.05f, kSmoothShare = 0.05f;  // no edge between four cells

  // Four points of the depth image; places without a point have no area.
  struct Points {
    Packet x = Packet::constant(0), y = x, z = x;  // metres
    Packet read_x = x, read_y = x, read_z = x;     // they move so with each second of the read-out
    Packet area = x;
    Packet of_sensor = x;  // standard deviation of the depth, metres
  };

  // What a view shows where four points fall: the depth of the cells around each, and where between
  // these it falls, 0 to 1.
  struct Surface {
    Packet over_left = Packet::constant(0), over_right = over_left, under_left = over_left,
           under_right = over_left;
    Packet right = over_left, down = over_left;
    Packet known = over_left;  // 1; 0: no surface there, or an edge
  };

  // How many points see a surface, agree with it, and are not too far from it.
  struct Counts {
    Packet compared = Packet::constant(0), agreeing = compared, weighted = compared;
  };

  // Every fourth cell, and of those that are measured every second, unless it moves.
  void take_points(const DepthCells& cells, const std::vector<std::uint8_t>& moving,
                   const DepthShot& shot) {
    points_.clear();
    std::size_t measured = 0, taken = 0;
    for (int y = 0; y < cells.height; ++y) {
      const float row = cells.row_share(static_cast<float>(y));
      const Eigen::Matrix3f R = shot.middle_of_row(row);
      for (int x = y % 4; x < cells.width; x += 4) {
        const std::size_t i = cells.index(x, y);
        const float z = cells.depth_m[i];
        if (!(z > 0) || measured++ % 2 != 0 || (!moving.empty() && moving[i] != 0)) continue;
        const std::size_t k = taken++ % 4;
        if (k == 0) points_.emplace_back();
        const Eigen::Vector3f p = R * Eigen::Vector3f(cells.ray_x[i] * z, cells.ray_y[i] * z, z);
        const Eigen::Vector3f read = row * shot.rad_s.cross(p);
        const float counted = std::min(z, kMostCountedM);
        Points& points = points_.back();
        points.x.set(k, p.x()), points.y.set(k, p.y()), points.z.set(k, p.z());
        points.read_x.set(k, read.x()), points.read_y.set(k, read.y());
        points.read_z.set(k, read.z()), points.area.set(k, counted * counted);
        points.of_sensor.set(k, sensor_.depth_sigma_m(z));
      }
    }
  }

  // Fills sums_ and counts_ from all points, or from four of each eight, in all views.
  void compare(const DepthCells& cells, const Eigen::Isometry3d& T_map_depth, float reach,
               std::size_t stride) {
    sums_ = {}, counts_ = Counts();
    for (const DepthKeyView* view : views_) {
      const Eigen::Isometry3f T = (view->shot.T_map_depth.inverse() * T_map_depth).cast<float>();
      for (std::size_t i = 0; i < points_.size(); i += stride)
        compare(cells, *view, T, points_[i], reach);
    }
  }

  void compare(const DepthCells& cells, const DepthKeyView& view, const Eigen::Isometry3f& T,
               const Points& p, float reach) {
    Packet x = T(0, 0) * p.x + T(0, 1) * p.y + T(0, 2) * p.z + T(0, 3);
    Packet y = T(1, 0) * p.x + T(1, 1) * p.y + T(1, 2) * p.z + T(1, 3);
    Packet z = T(2, 0) * p.x + T(2, 1) * p.y + T(2, 2) * p.z + T(2, 3);
    Packet inverse = 1 / z.max(nearest_m_);  // what is nearer falls on no cell
    auto [u, v] = cells.cell(x * inverse, y * inverse);
    // The view's row was read out while its camera rotated: it lies so far beside, per second.
    const Eigen::Vector3f& w = view.shot.rad_s;
    const Packet row = cells.row_share(v);
    const Packet turned_x = row * (w.y() * z - w.z() * y), turned_y = row * (w.z() * x - w.x() * z),
                 turned_z = row * (w.x() * y - w.y() * x);
    if (view.shot.is_skewed()) {
      const float s = view.shot.readout_s;
      x = x - s * turned_x, y = y - s * turned_y, z = z - s * turned_z;
      inverse = 1 / z.max(nearest_m_);
      std::tie(u, v) = cells.cell(x * inverse, y * inverse);
    }
    const Surface at = look_up(view, u, v, z, p.area);
    const Packet left = at.over_left + at.down * (at.under_left - at.over_left);
    const Packet right = at.over_right + at.down * (at.under_right - at.over_right);
    const Packet error = left + at.right * (right - left) - z;
    const Packet sigma = p.of_sensor + kCellSigmaM;
    const Packet far = error / (kTukey * reach * sigma), near = (1 - far * far).max(0) * at.known;
    counts_.compared += at.known;
    counts_.agreeing +=
        at.known * is_positive(static_cast<float>(sensor_.sigmas) * p.of_sensor - error.abs());
    counts_.weighted += is_positive(near);
    // How the difference changes as the point moves: along the surface's slope, and in depth.
    const Packet down = (1 - at.right) * (at.under_left - at.over_left) +
                        at.right * (at.under_right - at.over_right);
    const Packet du = cells.fx * inverse * (right - left), dv = cells.fy * inverse * down;
    const Packet dz = -(du * x + dv * y) * inverse - 1;
    const Packet jx = T(0, 0) * du + T(1, 0) * dv + T(2, 0) * dz;
    const Packet jy = T(0, 1) * du + T(1, 1) * dv + T(2, 1) * dz;
    const Packet jz = T(0, 2) * du + T(1, 2) * dv + T(2, 2) * dz;
    const Packet of_readout = jx * p.read_x + jy * p.read_y + jz * p.read_z -
                              (du * turned_x + dv * turned_y + dz * turned_z);
    sums_.add(
        near * near * p.area / (sigma * sigma),
        {jx, jy, jz, p.y * jz - p.z * jy, p.z * jx - p.x * jz, p.x * jy - p.y * jx, of_readout},
        error);
  }

  // What a view shows where four points fall; not known beside the view, too near, at an edge, and
  // of places without a point.
  Surface look_up(const DepthKeyView& view, const Packet& u, const Packet& v, const Packet& z,
                  const Packet& area) const {
    Surface s;
    const float width = static_cast<float>(view.surface_m.cols);
    const float height = static_cast<float>(view.surface_m.rows);
    for (std::size_t k = 0; k < 4; ++k) {
      if (!(u[k] >= 1 && v[k] >= 1 && u[k] < width - 2 && v[k] < height - 2 && z[k] > nearest_m_ &&
            area[k] > 0))
        continue;
      const int x = static_cast<int>(u[k]), y = static_cast<int>(v[k]);
      const float* over = view.surface_m.ptr<float>(y) + x;
      const float* under = view.surface_m.ptr<float>(y + 1) + x;
      const float least = std::min(std::min(over[0], over[1]), std::min(under[0], under[1]));
      const float most = std::max(std::max(over[0], over[1]), std::max(under[0], under[1]));
      if (!(least > 0) || most - least > kSmoothM + kSmoothShare * least) continue;
      s.over_left.set(k, over[0]), s.over_right.set(k, over[1]);
      s.under_left.set(k, under[0]), s.under_right.set(k, under[1]);
      s.right.set(k, u[k] - static_cast<float>(x)), s.down.set(k, v[k] - static_cast<float>(y));
      s.known.set(k, 1);
    }
    return s;
  }

  // One step; its size.
  double improve(const DepthShot& shot, double rotation_sigma, double translation_sigma_m,
                 Result& result) const {
    Eigen::Isometry3d& T = result.T_map_depth;
    const double per = kIndependent / (static_cast<double>(kUsualArea) * sum(counts_.weighted));
    const Eigen::Matrix<double, 7, 7> all = per * sums_.matrix();  // the lower half
    const Eigen::Matrix<double, 7, 1> right = per * sums_.right();
    Eigen::Matrix<double, 6, 6> H = all.topLeftCorner<6, 6>();
    Eigen::Matrix<double, 6, 1> g = right.head<6>();
    const Eigen::Isometry3d off = shot.T_map_depth.inverse() * T;
    const double of_t = 1 / (translation_sigma_m * translation_sigma_m);
    const double of_r = 1 / (rotation_sigma * rotation_sigma);
    H.diagonal().head<3>().array() += of_t;
    H.diagonal().tail<3>().array() += of_r;
    g.head<3>() += of_t * off.translation();
    g.tail<3>() += of_r * detail::rotation_vector(off.linear());
    const auto solved = detail::solve_normal_equations<6>(H, -g);
    if (!solved) return std::numeric_limits<double>::infinity();
    if (shot.rad_s.squaredNorm() > kLeastRadS * kLeastRadS)
      measure_readout(H, all.row(6), right[6], *solved, result);
    T = T * detail::motion_of_step(*solved);
    detail::normalize_rotation(T);
    return solved->norm();
  }

  // What of the errors a slower read-out explains beyond a step of the pose: the seventh unknown of
  // the normal equations, solved for alone.
  void measure_readout(const Eigen::Matrix<double, 6, 6>& H, const Eigen::Matrix<double, 1, 7>& row,
                       double right, const Eigen::Matrix<double, 6, 1>& step,
                       Result& result) const {
    const Eigen::Matrix<double, 6, 1> h = row.head<6>();
    const auto moved = detail::solve_normal_equations<6>(H, h);
    if (!moved) return;
    const double information = row[6] - h.dot(*moved);
    if (!(information > 0)) return;
    result.readout_information = information;
    result.readout_off_s = -(right + h.dot(step)) / information;
  }

  static constexpr float kLeastRadS = 0.1f;     // slower, rows do not lie beside each other
  static constexpr float kCellSigmaM = 0.005f;  // a cell's depth is a mean over its pixels
  static constexpr float kUsualArea = 4;        // weight of a cell 2 m away

  SensorModel sensor_;
  float nearest_m_;
  std::vector<const DepthKeyView*> views_;
  std::vector<Points> points_;
  detail::NormalPackets<7> sums_;  // a motion's six unknowns, and the read-out's time
  Counts counts_;
};

}  // namespace stillpoint
