// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <locale>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "stillpoint/core/object.hpp"
#include "stillpoint/io/text_file.hpp"

namespace stillpoint {

// A file of objects is CSV (RFC 4180): a header, and a line for each object of each frame; fields
// are empty where something is not known.
//
// timestamp             of the frame, seconds
// id, class, score      class is empty for an object that was found by its motion alone
// x, y, width, height   box, pixels
// predicted             1: missed in this frame, carried here from earlier ones
// tracked_s, unseen_s   seconds since first and last seen
// depth_m               median depth
// camera_x ... _vz      centroid of the visible surface (metres) and velocity against the static
//                       world (m/s), along the camera's axes
// sigma_x ... _vz       standard deviations of these
// world_x ... _vz       the same in the world of the poses that the host told

/// First line of a file of objects.
inline std::string objects_csv_header() {
  return "timestamp,id,class,score,x,y,width,height,predicted,tracked_s,unseen_s,depth_m,"
         "camera_x,camera_y,camera_z,camera_vx,camera_vy,camera_vz,"
         "sigma_x,sigma_y,sigma_z,sigma_vx,sigma_vy,sigma_vz,"
         "world_x,world_y,world_z,world_vx,world_vy,world_vz\n";
}

namespace detail {

/// A field of a CSV file, in quotes if it needs them.
inline std::string csv_field(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

/// The fields of a line of CSV.
inline std::vector<std::string> csv_fields(const std::string& line) {
  std::vector<std::string> fields(1);
  bool quoted = false;
  for (std::size_t i = 0; i < line.size(); ++i) {
    const char c = line[i];
    if (quoted && c == '"' && i + 1 < line.size() && line[i + 1] == '"')
      fields.back() += line[++i];
    else if (c == '"')
      quoted = !quoted;
    else if (c == ',' && !quoted)
      fields.emplace_back();
    else
      fields.back() += c;
  }
  return fields;
}

}  // namespace detail

/// The lines of a frame's objects: timestamps with 6 decimals, places and velocities with 4.
inline std::string objects_csv(double timestamp, const std::vector<DynamicObject>& objects) {
  std::ostringstream out;
  out.imbue(std::locale::classic());
  out.setf(std::ios::fixed);
  out.precision(4);
  const auto numbers = [&](const Eigen::Matrix<double, 6, 1>& v) {
    for (int i = 0; i < 6; ++i) out << ',' << (std::abs(v[i]) < 5e-5 ? 0.0 : v[i]);
  };
  const auto state = [&](const std::optional<ObjectState>& s) {
    if (!s) return void(out << ",,,,,,");
    Eigen::Matrix<double, 6, 1> v;
    v << s->centroid_m, s->velocity_m_s;
    numbers(v);
  };
  for (const DynamicObject& object : objects) {
    out.precision(6);
    out << timestamp << ',' << object.id << ',' << detail::csv_field(object.class_name) << ',';
    out.precision(4);
    out << object.score << ',' << object.box.x << ',' << object.box.y << ',' << object.box.width
        << ',' << object.box.height << ',' << object.predicted << ',' << object.tracked_s << ','
        << object.unseen_s << ',';
    if (object.depth_m > 0) out << object.depth_m;
    state(object.in_camera);
    if (object.in_camera)
      numbers(object.in_camera->covariance.diagonal().cwiseSqrt());
    else
      out << ",,,,,,";
    state(object.in_world);
    out << '\n';
  }
  return out.str();
}

/// The objects of a frame.
struct ObjectsOfFrame {
  double timestamp = 0;
  std::vector<DynamicObject> objects;
};

/// Reads a file of objects; masks are not in it, and of covariances the diagonal. Frames without an
/// object are not in it either. Throws Error naming the line that is none. O(bytes).
inline std::vector<ObjectsOfFrame> read_objects(const std::filesystem::path& path) {
  constexpr std::size_t kFields = 30;
  const std::string file = "objects file " + path.string();
  const auto lines = detail::text_lines(read_file(path, "objects file"));
  detail::check(!lines.empty() && lines[0].text + "\n" == objects_csv_header(), [&] {
    return file + ": expected the header " + detail::quoted(objects_csv_header()) + ", found " +
           (lines.empty() ? "an empty file" : detail::quoted(lines[0].text));
  });
  std::vector<ObjectsOfFrame> frames;
  for (std::size_t n = 1; n < lines.size(); ++n) {
    const std::string where = file + ", line " + std::to_string(lines[n].number);
    const std::vector<std::string> fields = detail::csv_fields(lines[n].text);
    detail::check(fields.size() == kFields, [&] {
      return where + ": expected " + std::to_string(kFields) + " fields, found " +
             std::to_string(fields.size());
    });
    const auto number = [&](std::size_t i) {
      const auto value = detail::parse_number(fields[i]);
      detail::check(value.has_value(), [&] {
        return where + ": expected a number as field " + std::to_string(i + 1) + ", found " +
               detail::quoted(fields[i]);
      });
      return *value;
    };
    const auto whole = [&](std::size_t i) { return static_cast<int>(number(i)); };
    const auto state = [&](std::size_t first) -> std::optional<ObjectState> {
      if (fields[first].empty()) return std::nullopt;
      ObjectState s;
      for (std::size_t i = 0; i < 3; ++i) {
        const auto k = static_cast<Eigen::Index>(i);
        s.centroid_m[k] = number(first + i), s.velocity_m_s[k] = number(first + 3 + i);
      }
      return s;
    };
    const double timestamp = detail::parse_timestamp(fields[0], where);
    if (frames.empty() || frames.back().timestamp != timestamp) frames.push_back({timestamp, {}});
    DynamicObject o;
    o.id = whole(1), o.class_name = fields[2], o.score = static_cast<float>(number(3));
    o.box = {whole(4), whole(5), whole(6), whole(7)};
    o.predicted = number(8) != 0, o.tracked_s = number(9), o.unseen_s = number(10);
    o.depth_m = fields[11].empty() ? 0 : static_cast<float>(number(11));
    o.in_camera = state(12), o.in_world = state(24);
    if (o.in_camera && !fields[18].empty())
      for (std::size_t i = 0; i < 6; ++i) {
        const auto k = static_cast<Eigen::Index>(i);
        o.in_camera->covariance(k, k) = number(18 + i) * number(18 + i);
      }
    frames.back().objects.push_back(o);
  }
  return frames;
}

}  // namespace stillpoint
