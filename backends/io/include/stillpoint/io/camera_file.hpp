// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cmath>
#include <filesystem>
#include <initializer_list>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "stillpoint/core/camera.hpp"
#include "stillpoint/io/text_file.hpp"

namespace stillpoint {
namespace detail {

/// The scalars of a YAML file by dotted name ("Camera.fx", also when written as `Camera:` with an
/// indented `fx:` below it), with their lines. Sequences, matrices and headers are skipped. Read
/// here and not by cv::FileStorage, which refuses files without a `%YAML:1.0` line and gives no
/// line numbers.
class YamlScalars {
 public:
  struct Value {
    std::string text;
    int line = 0;
  };

  explicit YamlScalars(const std::string& bytes) {
    std::vector<std::pair<std::size_t, std::string>> parents;  // indent, dotted prefix
    int number = 0;
    std::size_t begin = bytes.compare(0, 3, "\xEF\xBB\xBF") == 0 ? 3 : 0;
    for (; begin < bytes.size(); ++number) {
      const std::size_t end = std::min(bytes.find('\n', begin), bytes.size());
      add(bytes.substr(begin, end - begin), number + 1, parents);
      begin = end + 1;
    }
  }

  /// The first of these names that the file has; nothing if it has none of them.
  const Value* find(std::initializer_list<const char*> names) const {
    for (const char* name : names) {
      const auto it = values_.find(name);
      if (it != values_.end()) return &it->second;
    }
    return nullptr;
  }

 private:
  void add(const std::string& line, int number,
           std::vector<std::pair<std::size_t, std::string>>& parents) {
    const std::size_t indent = line.find_first_not_of(" \t\r");
    if (indent == std::string::npos || line[indent] == '#' || line[indent] == '%' ||
        line.compare(indent, 3, "---") == 0)
      return;
    // A key ends at the first colon that is followed by white space or by the end.
    std::size_t colon = line.find(':', indent);
    while (colon != std::string::npos && colon + 1 < line.size() && line[colon + 1] != ' ' &&
           line[colon + 1] != '\t' && line[colon + 1] != '\r')
      colon = line.find(':', colon + 1);
    if (colon == std::string::npos) return;
    while (!parents.empty() && parents.back().first >= indent) parents.pop_back();
    std::string key = unquoted(trimmed(line.substr(indent, colon - indent)));
    if (!parents.empty()) key = parents.back().second + "." + key;
    std::string value = line.substr(colon + 1);
    const std::size_t comment = value.find(" #");
    value = trimmed(value.substr(0, comment));
    if (!value.empty() && value[0] == '#') value.clear();
    if (value.empty()) {
      if (parents.size() < 8) parents.emplace_back(indent, key);
    } else {
      values_.emplace(key, Value{unquoted(value), number});
    }
  }

  static std::string unquoted(const std::string& s) {
    const bool quotes =
        s.size() >= 2 && (s.front() == '"' || s.front() == '\'') && s.back() == s.front();
    return quotes ? s.substr(1, s.size() - 2) : s;
  }

  std::map<std::string, Value> values_;
};

}  // namespace detail

namespace detail {

/// Values of a camera file by any of their names, the first of which messages use.
class CameraFileReader {
 public:
  using Names = std::initializer_list<const char*>;

  explicit CameraFileReader(const std::filesystem::path& path)
      : file_("camera file " + path.string()), yaml_(read_file(path, "camera file")) {}

  /// Refuses a rational lens: its k1 to k3 mean nothing alone.
  void check_lens() const {
    for (const Names& names : {Names{"Camera.k4", "Camera1.k4"}, Names{"Camera.k5", "Camera1.k5"},
                               Names{"Camera.k6", "Camera1.k6"}}) {
      const double k = number(names).value_or(0);
      check(k == 0, [&] {
        return file_ + ": " + *names.begin() + ": expected a lens of k1, k2, p1, p2, k3, found " +
               std::to_string(k) + " of a rational model; undistort the images beforehand";
      });
    }
  }

  std::optional<double> number(Names names) const {
    const auto* value = yaml_.find(names);
    if (!value) return std::nullopt;
    const auto parsed = parse_number(value->text);
    check(parsed.has_value(), [&] {
      return file_ + ", line " + std::to_string(value->line) + ": expected a number for " +
             *names.begin() + ", found " + quoted(value->text);
    });
    return parsed;
  }

  /// `mend`: what to write, for the message.
  double required(Names names, bool positive, const char* mend) const {
    const auto value = number(names);
    check(value.has_value(), [&] {
      return file_ + ": expected " + *names.begin() + ", found no such line; add " + mend;
    });
    check(!positive || *value > 0, [&] {
      return file_ + ": expected a positive " + *names.begin() + ", found " +
             std::to_string(*value) + "; write " + mend;
    });
    return *value;
  }

  int pixels(Names names) const {
    const double value = number(names).value_or(0);
    check(value >= 0 && value <= 100000 && value == std::floor(value), [&] {
      return file_ + ": expected a whole number of pixels for " + *names.begin() + ", found " +
             std::to_string(value);
    });
    return static_cast<int>(value);
  }

  void check_model() const {
    const auto* model = yaml_.find({"Camera.type", "Camera.model"});
    if (!model) return;
    const auto& text = model->text;
    check(text == "PinHole" || text == "Rectified" || text == "perspective" || text == "Pinhole",
          [&] {
            return file_ + ", line " + std::to_string(model->line) +
                   ": expected a pinhole camera (PinHole, Rectified, perspective), found " +
                   quoted(text) + "; undistort the images first";
          });
  }

  const std::string& file() const { return file_; }

 private:
  std::string file_;
  YamlScalars yaml_;
};

}  // namespace detail

/// Reads a camera from an ORB-SLAM style YAML file.
///
/// Names: `Camera.fx`, `fy`, `cx`, `cy`, `k1`, `k2`, `p1`, `p2`, `k3`, `width`, `height`, `fps`;
/// `DepthMapFactor` (units of a 16-bit depth image per metre); `exposure_ms`. Also ORB_SLAM3's
/// `Camera1.fx`, `RGBD.DepthMapFactor`, and stella_vslam's nested `Camera:` with `cols`, `rows`,
/// `depthmap_factor`. The `%YAML:1.0` line is optional. Focal lengths, principal point and depth
/// factor must be there; a size that is not given stays 0, distortion 0. A rational lens (k4, k5,
/// k6) is refused. Throws Error naming file, line, what was expected and what was found.
inline Camera load_camera(const std::filesystem::path& path) {
  const detail::CameraFileReader reader(path);
  reader.check_model();
  Camera camera;
  camera.fx = reader.required({"Camera.fx", "Camera1.fx"}, true, "the focal length in pixels");
  camera.fy = reader.required({"Camera.fy", "Camera1.fy"}, true, "the focal length in pixels");
  camera.cx = reader.required({"Camera.cx", "Camera1.cx"}, false, "the principal point in pixels");
  camera.cy = reader.required({"Camera.cy", "Camera1.cy"}, false, "the principal point in pixels");
  camera.k1 = reader.number({"Camera.k1", "Camera1.k1"}).value_or(0);
  camera.k2 = reader.number({"Camera.k2", "Camera1.k2"}).value_or(0);
  camera.p1 = reader.number({"Camera.p1", "Camera1.p1"}).value_or(0);
  camera.p2 = reader.number({"Camera.p2", "Camera1.p2"}).value_or(0);
  camera.k3 = reader.number({"Camera.k3", "Camera1.k3"}).value_or(0);
  reader.check_lens();
  camera.width = reader.pixels({"Camera.width", "Camera.cols"});
  camera.height = reader.pixels({"Camera.height", "Camera.rows"});
  camera.fps = reader.number({"Camera.fps"}).value_or(30);
  detail::check(camera.fps > 0, [&] {
    return reader.file() + ": expected a positive Camera.fps, found " + std::to_string(camera.fps);
  });
  camera.depth_units_per_m =
      reader.required({"DepthMapFactor", "RGBD.DepthMapFactor", "Camera.depthmap_factor",
                       "depthmap_factor", "Camera.DepthMapFactor"},
                      true, "DepthMapFactor: 5000 (TUM, Bonn) or 1000 (depth in millimetres)");
  const double exposure_ms = reader.number({"exposure_ms", "Camera.exposure_ms"}).value_or(0);
  detail::check(exposure_ms >= 0, [&] {
    return reader.file() + ": expected exposure_ms not negative, found " +
           std::to_string(exposure_ms);
  });
  camera.exposure_s = exposure_ms / 1000;
  return camera;
}

/// The built-in camera of a data set: "fr1", "fr2", "fr3" (TUM RGB-D) or "bonn". Any other name
/// throws Error with the list.
inline Camera camera_by_name(const std::string& name) {
  if (name == "fr1") return Camera::tum_fr1();
  if (name == "fr2") return Camera::tum_fr2();
  if (name == "fr3") return Camera::tum_fr3();
  if (name == "bonn") return Camera::bonn();
  throw Error("camera: expected one of fr1, fr2, fr3, bonn, found " + detail::quoted(name));
}

/// A built-in camera by its name, else a camera file by its path. Throws Error listing the choices
/// if `name_or_path` is neither.
inline Camera camera_from(const std::string& name_or_path) {
  for (const char* name : {"fr1", "fr2", "fr3", "bonn"})
    if (name_or_path == name) return camera_by_name(name_or_path);
  std::error_code ignored;
  detail::check(std::filesystem::exists(name_or_path, ignored), [&] {
    return "camera: expected fr1, fr2, fr3, bonn or an ORB-SLAM style YAML file, found " +
           detail::quoted(name_or_path) + ", which is no name and no file";
  });
  return load_camera(name_or_path);
}

}  // namespace stillpoint
