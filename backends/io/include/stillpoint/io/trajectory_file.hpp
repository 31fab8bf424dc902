// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <locale>
#include <sstream>
#include <string>
#include <vector>

#include "stillpoint/core/trajectory.hpp"
#include "stillpoint/io/text_file.hpp"

namespace stillpoint {

/// Reads a trajectory in TUM format: lines of `timestamp tx ty tz qx qy qz qw` (seconds, metres,
/// rotation camera to world), separated by spaces, `#` begins a comment line.
///
/// Quaternions are normalised. A file without a pose gives an empty trajectory. Throws Error naming
/// the line: not eight numbers, NaN or infinite, negative timestamp, zero quaternion, timestamps
/// out of order or repeated. O(bytes).
inline Trajectory read_trajectory(const std::filesystem::path& path) {
  const std::string file = "trajectory file " + path.string();
  Trajectory trajectory;
  int last_line = 0;
  for (const detail::TextLine& line : detail::text_lines(read_file(path, "trajectory file"))) {
    const auto where = [&] { return file + ", line " + std::to_string(line.number); };
    const std::vector<std::string> words = detail::words(line.text);
    detail::check(words.size() == 8, [&] {
      return where() + ": expected 8 numbers (timestamp tx ty tz qx qy qz qw), found " +
             std::to_string(words.size()) + " words: " + detail::quoted(line.text) +
             (line.text.find(',') != std::string::npos ? "; separate by spaces, not commas" : "");
    });
    StampedPose pose;
    pose.timestamp = detail::parse_timestamp(words[0], where());
    if (!trajectory.empty())
      detail::check_after(trajectory.back().timestamp, last_line, pose.timestamp, line.number,
                          file);
    std::array<double, 7> v{};
    for (std::size_t i = 0; i < 7; ++i) {
      const auto value = detail::parse_number(words[i + 1]);
      detail::check(value.has_value(), [&] {
        return where() + ": expected a finite number as word " + std::to_string(i + 2) +
               ", found " + detail::quoted(words[i + 1]) + "; leave lost frames out of the file";
      });
      v[i] = *value;
    }
    Eigen::Quaterniond q(v[6], v[3], v[4], v[5]);
    const double largest = q.coeffs().cwiseAbs().maxCoeff();
    detail::check(largest > 1e-6, [&] {
      return where() + ": expected a unit quaternion qx qy qz qw, found one of length zero";
    });
    q.coeffs() /= largest;  // so that the squares in normalize() cannot overflow
    q.normalize();
    pose.T_world_camera.linear() = q.toRotationMatrix();
    pose.T_world_camera.translation() = Eigen::Vector3d(v[0], v[1], v[2]);
    trajectory.push_back(pose);
    last_line = line.number;
  }
  return trajectory;
}

/// The text of a trajectory in TUM format: timestamps with 6 decimals, the rest with 9, qw not
/// negative. Throws Error if timestamps are negative, NaN or not ascending, or if a pose is not
/// finite.
inline std::string trajectory_text(const Trajectory& trajectory) {
  std::ostringstream out;
  out.imbue(std::locale::classic());
  out.setf(std::ios::fixed);
  for (std::size_t i = 0; i < trajectory.size(); ++i) {
    const StampedPose& pose = trajectory[i];
    const auto where = [i] { return "trajectory[" + std::to_string(i) + "]"; };
    detail::check(std::isfinite(pose.timestamp) && pose.timestamp >= 0, [&] {
      return where() + ".timestamp: expected seconds, not negative, found " +
             std::to_string(pose.timestamp);
    });
    detail::check(i == 0 || pose.timestamp > trajectory[i - 1].timestamp, [&] {
      return where() + ".timestamp: expected one after " +
             detail::seconds_text(trajectory[i - 1].timestamp) + ", found " +
             detail::seconds_text(pose.timestamp);
    });
    detail::check(pose.T_world_camera.matrix().allFinite(), [&] {
      return where() + ".T_world_camera: expected finite numbers, found NaN or infinity";
    });
    Eigen::Quaterniond q(pose.T_world_camera.linear());
    q.normalize();
    if (q.w() < 0) q.coeffs() *= -1;
    const Eigen::Vector3d t = pose.T_world_camera.translation();
    out.precision(6);
    out << pose.timestamp;
    out.precision(9);
    for (double v : {t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()})
      out << ' ' << (std::abs(v) < 5e-10 ? 0.0 : v);  // never "-0.000000000"
    out << '\n';
  }
  return out.str();
}

/// Writes a trajectory in TUM format. Throws Error as trajectory_text() does, and if the file
/// cannot be written.
inline void write_trajectory(const std::filesystem::path& path, const Trajectory& trajectory) {
  write_file(path, trajectory_text(trajectory), "trajectory file");
}

}  // namespace stillpoint
