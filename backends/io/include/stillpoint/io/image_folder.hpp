// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cctype>
#include <cstddef>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "stillpoint/core/camera.hpp"
#include "stillpoint/core/error.hpp"
#include "stillpoint/io/text_file.hpp"
#include "stillpoint/io/tum_sequence.hpp"

namespace stillpoint {

struct ImageFolderSettings {
  std::optional<Camera> camera;
  /// Folder of 16-bit depth images named like the color images (ending apart); empty: no depth.
  std::filesystem::path depth = {};
  /// Images per second, where the names are no timestamps.
  double fps = 30;
};

namespace detail {

/// a2 before a10: numbers in names count as numbers.
inline bool natural_less(const std::string& a, const std::string& b) {
  const auto digit = [](char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; };
  std::size_t i = 0, j = 0;
  while (i < a.size() && j < b.size()) {
    if (!digit(a[i]) || !digit(b[j])) {
      if (a[i] != b[j]) return a[i] < b[j];
      ++i, ++j;
      continue;
    }
    const auto number = [&](const std::string& s, std::size_t& at) {
      while (at < s.size() && s[at] == '0') ++at;
      const std::size_t begin = at;
      while (at < s.size() && digit(s[at])) ++at;
      return s.substr(begin, at - begin);
    };
    const std::string m = number(a, i), n = number(b, j);
    if (m.size() != n.size()) return m.size() < n.size();
    if (m != n) return m < n;
  }
  return a.size() - i < b.size() - j || (i == a.size() && j == b.size() && a < b);
}

/// Takes timestamps from the names, if all are different numbers with a decimal point; trailing
/// zeros may be missing.
inline bool read_times(std::vector<SequenceEntry>& entries) {
  std::set<double> times;
  for (SequenceEntry& entry : entries) {
    const auto time = parse_number(entry.stem);
    if (!time || *time < 0 || entry.stem.find('.') == std::string::npos ||
        !times.insert(*time).second)
      return false;
    entry.timestamp = *time;
  }
  return true;
}

inline bool is_image(const std::filesystem::path& file) {
  std::string ending = file.extension().string();
  for (char& c : ending) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return ending == ".png" || ending == ".jpg" || ending == ".jpeg";
}

/// The images (PNG, JPEG) of a folder by their stem.
inline std::map<std::string, std::filesystem::path> images_by_stem(
    const std::filesystem::path& folder) {
  std::error_code ignored;
  check(std::filesystem::is_directory(folder, ignored), [&] {
    return "image folder " + folder.string() + ": expected a folder, found " +
           (std::filesystem::exists(folder, ignored) ? "a file" : "no such folder; check the path");
  });
  std::map<std::string, std::filesystem::path> images;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (!is_image(entry.path())) continue;
    const std::string stem = entry.path().stem().string();
    const auto placed = images.emplace(stem, entry.path());
    check(placed.second, [&] {
      return "image folder " + folder.string() + ": expected one image called " + stem +
             ", found " + placed.first->second.filename().string() + " and " +
             entry.path().filename().string();
    });
  }
  return images;
}

}  // namespace detail

/// The images of a folder as a sequence, by name (numbers in names count as numbers). Names that
/// are numbers with a decimal point, no two alike, are timestamps in seconds; others are `fps`
/// apart. Images without a depth image are taken without depth. Throws Error if a folder is
/// missing, there is no image, or two images have one stem. O(n log n) in the number of files.
inline TumSequence image_folder(const std::filesystem::path& folder,
                                const ImageFolderSettings& settings = {}) {
  detail::check(settings.fps > 0, [&] {
    return "ImageFolderSettings.fps: expected a positive number, found " +
           std::to_string(settings.fps);
  });
  const auto images = detail::images_by_stem(folder);
  detail::check(!images.empty(), [&] {
    return "image folder " + folder.string() + ": expected PNG or JPEG images, found none";
  });
  const auto depth = settings.depth.empty() ? std::map<std::string, std::filesystem::path>()
                                            : detail::images_by_stem(settings.depth);
  std::vector<SequenceEntry> entries;
  for (const auto& [stem, path] : images) {
    SequenceEntry entry;
    entry.color_path = path;
    entry.stem = stem;
    if (const auto found = depth.find(stem); found != depth.end()) entry.depth_path = found->second;
    entries.push_back(std::move(entry));
  }
  const bool named_by_time = detail::read_times(entries);
  std::sort(entries.begin(), entries.end(), [=](const SequenceEntry& a, const SequenceEntry& b) {
    return named_by_time ? a.timestamp < b.timestamp : detail::natural_less(a.stem, b.stem);
  });
  for (std::size_t i = 0; i < entries.size(); ++i) {
    if (!named_by_time) entries[i].timestamp = static_cast<double>(i) / settings.fps;
    entries[i].depth_timestamp = entries[i].timestamp;
  }
  return TumSequence(folder, std::move(entries), settings.camera);
}

}  // namespace stillpoint
