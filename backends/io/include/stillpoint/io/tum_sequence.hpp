// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "stillpoint/core/camera.hpp"
#include "stillpoint/core/frame.hpp"
#include "stillpoint/evaluation/associate.hpp"
#include "stillpoint/io/camera_file.hpp"
#include "stillpoint/io/image_file.hpp"
#include "stillpoint/io/text_file.hpp"
#include "stillpoint/io/trajectory_file.hpp"

namespace stillpoint {

/// A line of rgb.txt or depth.txt.
struct ListedFile {
  /// Seconds.
  double timestamp = 0;
  /// As written in the list, relative to the sequence's folder.
  std::string file;
};

/// Reads rgb.txt or depth.txt: lines of `timestamp filename`, `#` begins a comment line. Throws
/// Error naming the line: no file name, NaN or negative timestamp, timestamps out of order, or one
/// timestamp of two files. A line that says the same as the one before adds nothing: exporters
/// repeat a depth image that serves two color images. O(bytes).
inline std::vector<ListedFile> read_file_list(const std::filesystem::path& path) {
  const std::string list = "file list " + path.string();
  std::vector<ListedFile> files;
  int last_line = 0;
  for (const detail::TextLine& line : detail::text_lines(read_file(path, "file list"))) {
    const std::string where = list + ", line " + std::to_string(line.number);
    const std::size_t end = line.text.find_first_of(" \t");
    detail::check(end != std::string::npos, [&] {
      return where + ": expected `timestamp filename`, found " + detail::quoted(line.text);
    });
    ListedFile entry{detail::parse_timestamp(line.text.substr(0, end), where),
                     detail::trimmed(line.text.substr(end))};
    const bool again = !files.empty() && files.back().timestamp == entry.timestamp &&
                       files.back().file == entry.file;
    if (again) continue;
    if (!files.empty())
      detail::check_after(files.back().timestamp, last_line, entry.timestamp, line.number, list);
    files.push_back(std::move(entry));
    last_line = line.number;
  }
  return files;
}

/// A color image and the depth image that belongs to it.
struct SequenceEntry {
  /// Of the color image, seconds.
  double timestamp = 0;
  /// Of the depth image, seconds.
  double depth_timestamp = 0;
  std::filesystem::path color_path;
  /// Empty: no depth.
  std::filesystem::path depth_path;
  /// The color file's name without folder and ending; masks and overlays are named by it.
  std::string stem;
};

/// Reads an associations file: lines of `timestamp color_file timestamp depth_file`, as
/// associate.py rgb.txt depth.txt writes them (depth first is accepted if the folders are called
/// depth/ and rgb/). Paths are taken relative to `folder`. Throws Error naming the line, as
/// read_file_list().
inline std::vector<SequenceEntry> read_associations(const std::filesystem::path& path,
                                                    const std::filesystem::path& folder) {
  const std::string list = "associations file " + path.string();
  std::vector<SequenceEntry> entries;
  int last_line = 0;
  for (const detail::TextLine& line : detail::text_lines(read_file(path, "associations file"))) {
    const std::string where = list + ", line " + std::to_string(line.number);
    std::vector<std::string> words = detail::words(line.text);
    detail::check(words.size() == 4, [&] {
      return where + ": expected `timestamp color_file timestamp depth_file`, found " +
             detail::quoted(line.text);
    });
    if (words[1].compare(0, 6, "depth/") == 0 && words[3].compare(0, 4, "rgb/") == 0) {
      std::swap(words[0], words[2]);
      std::swap(words[1], words[3]);
    }
    SequenceEntry entry;
    entry.timestamp = detail::parse_timestamp(words[0], where);
    entry.depth_timestamp = detail::parse_timestamp(words[2], where);
    detail::check(std::abs(entry.depth_timestamp - entry.timestamp) <= kMostDepthOffsetS, [&] {
      return where + ": expected color and depth at most " + std::to_string(kMostDepthOffsetS) +
             " s apart, found " + words[0] + " and " + words[2];
    });
    entry.color_path = folder / words[1];
    entry.depth_path = folder / words[3];
    entry.stem = entry.color_path.stem().string();
    if (!entries.empty())
      detail::check_after(entries.back().timestamp, last_line, entry.timestamp, line.number, list);
    entries.push_back(std::move(entry));
    last_line = line.number;
  }
  return entries;
}

/// An RGB-D sequence in the layout of the TUM benchmark and the Bonn data set: a folder with
/// rgb.txt, depth.txt and the images they name; groundtruth.txt and camera.yaml may be there.
///
/// Images are read one at a time by load(); the object itself holds file names only. load() may
/// be called from several threads.
class TumSequence {
 public:
  struct Settings {
    /// Color and depth images are paired when less than this apart, nearest pair first, each
    /// used once (see associate()).
    double max_difference_s = 0.02;
    /// An associations file that is used instead of rgb.txt and depth.txt. Empty: the two lists are
    /// used, and only where one of them is missing the folder's own associations.txt.
    std::filesystem::path associations;
    /// Used instead of the folder's camera.yaml.
    std::optional<Camera> camera;
    /// False: a folder without depth.txt and associations is a sequence of color images.
    bool depth_required = true;
  };

  /// Opens a folder. Images that are listed but not on the disk are left out and counted (parts
  /// of a sequence are often passed around with the whole lists). Throws Error if the folder or a
  /// list is missing or broken, or if no entry is left. O(n log n) in the length of the lists.
  explicit TumSequence(std::filesystem::path folder) : TumSequence(std::move(folder), Settings()) {}
  TumSequence(std::filesystem::path folder, Settings settings)
      : folder_(std::move(folder)), settings_(std::move(settings)) {
    namespace fs = std::filesystem;
    std::error_code ignored;
    detail::check(fs::is_directory(folder_, ignored), [&] {
      return "sequence " + folder_.string() + ": expected a folder with rgb.txt, found " +
             (fs::exists(folder_, ignored) ? "a file" : "no such folder; check the path");
    });
    const fs::path own_associations = folder_ / "associations.txt";
    const bool lists = fs::exists(folder_ / "rgb.txt", ignored) &&
                       (fs::exists(folder_ / "depth.txt", ignored) || !settings_.depth_required);
    if (!settings_.associations.empty()) {
      source_ = settings_.associations;
      entries_ = read_associations(source_, folder_);
    } else if (!lists && fs::exists(own_associations, ignored)) {
      source_ = own_associations;
      entries_ = read_associations(source_, folder_);
    } else {
      source_ = folder_ / "rgb.txt";
      open_lists();
    }
    detail::check(!entries_.empty() || without_depth_ > 0, [&] {
      return "sequence " + folder_.string() + ": expected at least one image in " +
             source_.string() + ", found none; is it the right folder?";
    });
    detail::check(!entries_.empty(), [&] {
      return "sequence " + folder_.string() + ": expected color and depth timestamps less than " +
             std::to_string(settings_.max_difference_s) +
             " s apart, found no such pair; are rgb.txt and depth.txt of one recording and one "
             "clock? An "
             "associations.txt in place of depth.txt says what belongs together";
    });
    leave_out_missing();
    if (settings_.camera)
      camera_ = settings_.camera;
    else if (fs::exists(folder_ / "camera.yaml", ignored))
      camera_ = load_camera(folder_ / "camera.yaml");
  }

  /// A sequence of images that the caller lists, ascending in time.
  TumSequence(std::filesystem::path folder, std::vector<SequenceEntry> entries,
              std::optional<Camera> camera)
      : folder_(std::move(folder)), entries_(std::move(entries)), camera_(std::move(camera)) {}

  std::size_t size() const { return entries_.size(); }
  const SequenceEntry& entry(std::size_t i) const { return entries_.at(i); }
  const std::vector<SequenceEntry>& entries() const { return entries_; }
  const std::filesystem::path& folder() const { return folder_; }
  /// Listed color images without a depth image near enough; they are left out.
  std::size_t without_depth() const { return without_depth_; }
  /// Pairs of which an image is not on the disk; they are left out.
  std::size_t missing_images() const { return missing_images_; }
  /// Old name; gone in the next version.
  [[deprecated("use missing_images()")]] std::size_t missing_pictures() const {
    return missing_images_;
  }

  /// From the settings or the folder's camera.yaml; nothing if there is neither.
  const std::optional<Camera>& camera() const { return camera_; }

  /// Timestamps of all entries, seconds.
  std::vector<double> timestamps() const {
    std::vector<double> times;
    times.reserve(entries_.size());
    for (const SequenceEntry& e : entries_) times.push_back(e.timestamp);
    return times;
  }

  /// Reads the images of entry `i` (below size()). Depth units are the camera's, 5000 per metre
  /// if there is no camera. Throws Error if an image is broken or of the wrong type, or if color,
  /// depth and camera file differ in size.
  RgbdFrame load(std::size_t i) const {
    detail::check(i < entries_.size(), [&] {
      return "sequence " + folder_.string() + ": expected an entry below " +
             std::to_string(entries_.size()) + ", found " + std::to_string(i);
    });
    const SequenceEntry& e = entries_[i];
    RgbdFrame frame;
    frame.timestamp = e.timestamp;
    if (camera_) frame.depth_units_per_m = camera_->depth_units_per_m;
    frame.color = read_color(e.color_path);
    detail::check(!camera_ || camera_->width == 0 || camera_->height == 0 ||
                      frame.color.size() == cv::Size(camera_->width, camera_->height),
                  [&] {
                    return "color image " + e.color_path.string() + ": expected the camera's " +
                           std::to_string(camera_->width) + "x" + std::to_string(camera_->height) +
                           ", found " + detail::size_text(frame.color) +
                           "; is it the right camera file?";
                  });
    if (e.depth_path.empty()) return frame;
    frame.depth = read_depth(e.depth_path);
    frame.depth_timestamp = e.depth_timestamp;
    detail::check(frame.depth.size() == frame.color.size(), [&] {
      return "depth image " + e.depth_path.string() + ": expected the color image's size " +
             detail::size_text(frame.color) + ", found " + detail::size_text(frame.depth) +
             "; register depth to color first";
    });
    return frame;
  }

  bool has_groundtruth() const {
    std::error_code ignored;
    return std::filesystem::exists(folder_ / "groundtruth.txt", ignored);
  }
  /// Reads groundtruth.txt; throws Error as read_trajectory().
  Trajectory groundtruth() const { return read_trajectory(folder_ / "groundtruth.txt"); }

 private:
  void open_lists() {
    const std::vector<ListedFile> color = read_file_list(folder_ / "rgb.txt");
    std::error_code ignored;
    const bool has_depth = std::filesystem::exists(folder_ / "depth.txt", ignored);
    const auto entry_of = [this](const ListedFile& listed) {
      SequenceEntry e;
      e.timestamp = e.depth_timestamp = listed.timestamp;
      e.color_path = folder_ / listed.file;
      e.stem = e.color_path.stem().string();
      return e;
    };
    if (!has_depth && !settings_.depth_required) {
      for (const ListedFile& listed : color) entries_.push_back(entry_of(listed));
      return;
    }
    const std::vector<ListedFile> depth = read_file_list(folder_ / "depth.txt");
    std::vector<double> color_times, depth_times;
    for (const ListedFile& f : color) color_times.push_back(f.timestamp);
    for (const ListedFile& f : depth) depth_times.push_back(f.timestamp);
    for (const TimestampPair& pair :
         associate(color_times, depth_times, settings_.max_difference_s)) {
      SequenceEntry e = entry_of(color[pair.first]);
      e.depth_timestamp = depth[pair.second].timestamp;
      e.depth_path = folder_ / depth[pair.second].file;
      entries_.push_back(std::move(e));
    }
    without_depth_ = color.size() - entries_.size();
  }

  void leave_out_missing() {
    std::filesystem::path first_missing;
    const auto missing = [&](const SequenceEntry& e) {
      std::error_code ignored;
      for (const auto* path : {&e.color_path, &e.depth_path}) {
        if (path->empty() || std::filesystem::exists(*path, ignored)) continue;
        if (first_missing.empty()) first_missing = *path;
        return true;
      }
      return false;
    };
    std::vector<SequenceEntry> present;
    for (SequenceEntry& e : entries_)
      if (!missing(e)) present.push_back(std::move(e));
    missing_images_ = entries_.size() - present.size();
    detail::check(!present.empty(), [&] {
      return "sequence " + folder_.string() + ": expected the images that " + source_.string() +
             " names, found none of " + std::to_string(entries_.size()) + " pairs, e.g. no " +
             first_missing.string();
    });
    entries_ = std::move(present);
  }

  std::filesystem::path folder_;
  Settings settings_;
  std::filesystem::path source_;
  std::vector<SequenceEntry> entries_;
  std::optional<Camera> camera_;
  std::size_t without_depth_ = 0, missing_images_ = 0;
};

}  // namespace stillpoint
