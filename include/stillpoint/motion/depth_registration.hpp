// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <vector>

#include "stillpoint/core/normal_equations.hpp"
#include "stillpoint/core/rigid_motion.hpp"
#include "stillpoint/motion/depth_cells.hpp"
#include "stillpoint/motion/depth_key_view.hpp"
#include "stillpoint/motion/depth_shot.hpp"
#include "stillpoint/motion/free_space_map.hpp"
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
  explicit DepthRegistration(const SensorModel& sensor = {}) : sensor_(sensor) {}

  struct Result {
    Eigen::Isometry3d T_map_depth = Eigen::Isometry3d::Identity();
    /// Share of the comparable cells whose depth agrees, 0 to 1.
    double fit = 0;
    /// By how much the rows are read out more slowly than `shot` says, seconds, and how much that
    /// is worth: one over its variance. 0 where the camera does not rotate.
    double readout_off_s = 0, readout_information = 0;
  };

  /// `shot`: the image with the predicted pose, whose standard deviations are given. No value where
  /// too few cells can be compared. O(cells).
  std::optional<Result> align(const DepthShot& shot, const DepthCells& cells,
                              const FreeSpaceMap& map, double rotation_sigma,
                              double translation_sigma_m) {
    static constexpr std::array<double, 3> kAgesS = {1.6, 0.5, 0.05};
    map.views_at(shot.timestamp, kAgesS, views_);
    take_points(cells, shot);
    Result result;
    result.T_map_depth = shot.T_map_depth;
    for (int i = 0; i < kSteps; ++i) {
      // From far few agree exactly, and few points are enough.
      compare(cells, result.T_map_depth, i == 0 ? 3.0f : i == 1 ? 2.0f : 1.0f, i < 2 ? 2 : 1);
      if (weight_.size() < kFewest) return std::nullopt;
      result.fit = static_cast<double>(agreeing_) / static_cast<double>(compared_);
      const double step = improve(shot, rotation_sigma, translation_sigma_m, result);
      if (!(step < kMostStep)) return std::nullopt;
      if (i >= 2 && step < kTinyStep) break;
    }
    return result;
  }

 private:
  using Vector6f = Eigen::Matrix<float, 6, 1>;
  static constexpr int kSteps = 4;
  static constexpr std::size_t kFewest = 100;                 // cells
  static constexpr double kMostStep = 0.5, kTinyStep = 1e-3;  // radians and metres
  // Neighbors err alike: so many cells tell as much as all.
  static constexpr double kIndependent = 50;
  static constexpr float kTukey = 4;         // sigmas beyond which a cell has no say
  static constexpr float kMostCountedM = 4;  // area grows no more beyond
  static constexpr float kSmoothM = 0.05f, kSmoothShare = 0.05f;  // no edge between four cells

  struct Point {
    Eigen::Vector3f p, per_readout_s;  // how it moves with each second of the read-out
    float area;
  };

  // Every fourth cell, and of those that are measured every second.
  void take_points(const DepthCells& cells, const DepthShot& shot) {
    points_.clear();
    bool take = false;
    for (int y = 0; y < cells.height; ++y) {
      const float row = cells.row_share(static_cast<float>(y));
      const Eigen::Matrix3f R = shot.middle_of_row(row);
      for (int x = y % 4; x < cells.width; x += 4) {
        const std::size_t i = cells.index(x, y);
        const float z = cells.depth_m[i];
        if (!(z > 0)) continue;
        take = !take;
        if (!take) continue;
        const float counted = std::min(z, kMostCountedM);
        const Eigen::Vector3f p = R * Eigen::Vector3f(cells.ray_x[i] * z, cells.ray_y[i] * z, z);
        points_.push_back({p, row * shot.rad_s.cross(p), counted * counted});
      }
    }
  }

  // Fills error_, weight_ and slopes_ for all points in all views.
  void compare(const DepthCells& cells, const Eigen::Isometry3d& T_map_depth, float reach,
               std::size_t stride) {
    error_.clear(), weight_.clear(), slopes_.clear(), readout_slope_.clear();
    compared_ = agreeing_ = 0;
    for (const DepthKeyView* view : views_) {
      const Eigen::Isometry3d T = view->shot.T_map_depth.inverse() * T_map_depth;
      const Eigen::Matrix3f R = T.linear().cast<float>();
      const Eigen::Vector3f t = T.translation().cast<float>();
      for (std::size_t i = 0; i < points_.size(); i += stride)
        compare(cells, *view, R, t, points_[i], reach);
    }
  }

  void compare(const DepthCells& cells, const DepthKeyView& view, const Eigen::Matrix3f& R,
               const Eigen::Vector3f& t, const Point& point, float reach) {
    Eigen::Vector3f q = R * point.p + t;
    if (!(q.z() > static_cast<float>(sensor_.min_range_m))) return;
    float inverse = 1 / q.z();
    Eigen::Vector2f cell = cells.cell(q.x() * inverse, q.y() * inverse);
    // The view's row was read out while its camera rotated: it lies so far beside, per second.
    const Eigen::Vector3f turned = cells.row_share(cell.y()) * view.shot.rad_s.cross(q);
    if (view.shot.is_skewed()) {
      q -= view.shot.readout_s * turned;
      inverse = 1 / q.z();
      cell = cells.cell(q.x() * inverse, q.y() * inverse);
    }
    if (!(cell.x() >= 1 && cell.y() >= 1 && cell.x() < static_cast<float>(cells.width - 2) &&
          cell.y() < static_cast<float>(cells.height - 2)))
      return;
    const int x = static_cast<int>(cell.x()), y = static_cast<int>(cell.y());
    const float a = cell.x() - static_cast<float>(x), b = cell.y() - static_cast<float>(y);
    const float* over = view.surface_m.ptr<float>(y) + x;
    const float* under = view.surface_m.ptr<float>(y + 1) + x;
    const float least = std::min(std::min(over[0], over[1]), std::min(under[0], under[1]));
    const float most = std::max(std::max(over[0], over[1]), std::max(under[0], under[1]));
    if (!(least > 0) || most - least > kSmoothM + kSmoothShare * least) return;
    const float left = over[0] + b * (under[0] - over[0]);
    const float right = over[1] + b * (under[1] - over[1]);
    const float error = left + a * (right - left) - q.z();
    const float of_sensor = sensor_.depth_sigma_m(q.z()), sigma = of_sensor + kCellSigmaM;
    ++compared_;
    agreeing_ += std::abs(error) < static_cast<float>(sensor_.sigmas) * of_sensor;
    const float far = error / (kTukey * reach * sigma), near = 1 - far * far;
    if (!(near > 0)) return;
    // How the difference changes as the point moves: along the surface's slope, and in depth.
    const float du = cells.fx * inverse * (right - left);
    const float dv =
        cells.fy * inverse * ((1 - a) * (under[0] - over[0]) + a * (under[1] - over[1]));
    const Eigen::Vector3f slope(du, dv, -(du * q.x() + dv * q.y()) * inverse - 1);
    const Eigen::Vector3f in_camera = R.transpose() * slope;
    error_.push_back(error);
    weight_.push_back(near * near * point.area / (sigma * sigma));
    Vector6f J;
    J.head<3>() = in_camera;
    J.tail<3>() = point.p.cross(in_camera);
    slopes_.push_back(J);
    readout_slope_.push_back(in_camera.dot(point.per_readout_s) - slope.dot(turned));
  }

  // One step; its size.
  double improve(const DepthShot& shot, double rotation_sigma, double translation_sigma_m,
                 Result& result) const {
    Eigen::Isometry3d& T = result.T_map_depth;
    Eigen::Matrix<float, 6, 6> sum = Eigen::Matrix<float, 6, 6>::Zero();
    Vector6f right = Vector6f::Zero();
    for (std::size_t i = 0; i < weight_.size(); ++i) {
      const Vector6f weighted = weight_[i] * slopes_[i];
      sum.noalias() += weighted * slopes_[i].transpose();
      right.noalias() += weighted * error_[i];
    }
    const double per =
        kIndependent / (static_cast<double>(kUsualArea) * static_cast<double>(weight_.size()));
    Eigen::Matrix<double, 6, 6> H = sum.cast<double>() * per;
    Eigen::Matrix<double, 6, 1> g = right.cast<double>() * per;
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
      measure_readout(H, *solved, per, result);
    T = T * detail::motion_of_step(*solved);
    detail::normalize_rotation(T);
    return solved->norm();
  }

  // What of the errors a slower read-out explains beyond a step of the pose: the seventh unknown of
  // the normal equations, solved for alone.
  void measure_readout(const Eigen::Matrix<double, 6, 6>& H,
                       const Eigen::Matrix<double, 6, 1>& step, double per, Result& result) const {
    Vector6f shared = Vector6f::Zero();
    float square = 0, right = 0;
    for (std::size_t i = 0; i < weight_.size(); ++i) {
      const float weighted = weight_[i] * readout_slope_[i];
      shared += weighted * slopes_[i];
      square += weighted * readout_slope_[i];
      right += weighted * error_[i];
    }
    const Eigen::Matrix<double, 6, 1> h = shared.cast<double>() * per;
    const auto moved = detail::solve_normal_equations<6>(H, h);
    if (!moved) return;
    const double information = square * per - h.dot(*moved);
    if (!(information > 0)) return;
    result.readout_information = information;
    result.readout_off_s = -(right * per + h.dot(step)) / information;
  }

  static constexpr float kLeastRadS = 0.1f;     // slower, rows do not lie beside each other
  static constexpr float kCellSigmaM = 0.005f;  // a cell's depth is a mean over its pixels
  static constexpr float kUsualArea = 4;        // weight of a cell 2 m away

  SensorModel sensor_;
  std::vector<const DepthKeyView*> views_;
  std::vector<Point> points_;
  std::size_t compared_ = 0, agreeing_ = 0;
  std::vector<float> error_, weight_, readout_slope_;
  std::vector<Vector6f> slopes_;
};

}  // namespace stillpoint
