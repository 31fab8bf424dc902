// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "stillpoint/io/mask_folder.hpp"
#include "stillpoint/io/tum_sequence.hpp"
#include "stillpoint/segmentation/segmenter.hpp"

namespace stillpoint {

/// A frame's timestamp (seconds) and the stem of its color file ("123.456" of rgb/123.456.jpg).
struct FrameName {
  double timestamp = 0;
  std::string stem;
};

/// The names of a sequence's frames.
inline std::vector<FrameName> frame_names(const TumSequence& sequence) {
  std::vector<FrameName> names;
  names.reserve(sequence.size());
  for (const SequenceEntry& e : sequence.entries()) names.push_back({e.timestamp, e.stem});
  return names;
}

/// A folder of masks that some network wrote before, as a Segmenter.
///
/// One 8-bit gray PNG per frame, named by the color file's stem: rgb/123.456.jpg -> 123.456.png.
/// 0 = background, k = instance k; an image with only 0 and 255 is split into connected parts. An
/// empty (all 0) image: segmented, nobody seen. A missing file: no result for that frame, so its
/// masks are predicted from earlier ones; a segmenter at 4 Hz is such a folder. Masks are read one
/// at a time, when asked for.
class MaskFilesSegmenter : public Segmenter {
 public:
  struct Settings {
    /// Class of every instance.
    std::string class_name = "person";
    /// Smaller connected parts of a 0/255 image are specks and dropped.
    int min_area_px = 50;
    /// A frame belongs to the name whose timestamp is at most this far from its own.
    double max_difference_s = 0.005;
  };

  /// Opens a folder for the frames of a sequence. Throws Error if the folder does not exist, or if
  /// not one of its files has the name of a frame. O(n log n) in frames and files.
  MaskFilesSegmenter(const std::filesystem::path& folder, std::vector<FrameName> frames)
      : MaskFilesSegmenter(folder, std::move(frames), Settings()) {}
  MaskFilesSegmenter(const std::filesystem::path& folder, std::vector<FrameName> frames,
                     Settings settings)
      : folder_(folder), settings_(std::move(settings)) {
    const std::set<std::string> stems = png_stems();
    for (FrameName& frame : frames) {
      detail::check(std::isfinite(frame.timestamp), [&] {
        return "MaskFilesSegmenter: expected timestamps in seconds, found " +
               std::to_string(frame.timestamp) + " for " + frame.stem;
      });
      const bool present = stems.count(frame.stem) > 0;
      present_ += present;
      frames_.push_back({frame.timestamp, std::move(frame.stem), present});
    }
    detail::check(present_ > 0, [&] {
      return "mask folder " + folder_.string() + ": expected PNGs named by the color files, " +
             (frames_.empty() ? std::string("but no frame was named")
                              : "e.g. " + frames_.front().stem + ".png") +
             ", found " + std::to_string(stems.size()) + " PNGs of other names" +
             (stems.empty() ? "" : ", e.g. " + *stems.begin() + ".png") +
             "; name each mask by the stem of its color file";
    });
    sort();
  }

  /// Opens a folder whose files are named by timestamps in seconds ("1341846313.592026.png"),
  /// without a list of frames. Throws Error if the folder does not exist or no PNG is named by a
  /// number.
  explicit MaskFilesSegmenter(const std::filesystem::path& folder)
      : MaskFilesSegmenter(folder, Settings()) {}
  MaskFilesSegmenter(const std::filesystem::path& folder, Settings settings)
      : folder_(folder), settings_(std::move(settings)) {
    const std::set<std::string> stems = png_stems();
    for (const std::string& stem : stems)
      if (const auto time = detail::parse_number(stem)) frames_.push_back({*time, stem, true});
    present_ = frames_.size();
    detail::check(present_ > 0, [&] {
      return "mask folder " + folder_.string() +
             ": expected PNGs named by timestamps in seconds, found " +
             std::to_string(stems.size()) + " PNGs of other names" +
             (stems.empty() ? "" : ", e.g. " + *stems.begin() + ".png") +
             "; rename them, or give the list of frames with their file stems";
    });
    sort();
  }

  /// Files have no class names: everything in them is of the one in the settings.
  std::vector<std::string> classes() const override { return {settings_.class_name}; }

  /// Number of frames that have a mask file.
  std::size_t masks() const { return present_; }

  /// Reads the frame's mask. `available` is false when the frame has no file. Throws Error if the
  /// file is truncated, not 8 bits in one channel, or not of the color image's size. O(pixels).
  Segmentation segment(const RgbdFrame& frame) override {
    detail::check(std::isfinite(frame.timestamp), [&] {
      return "frame.timestamp: expected seconds, found " + std::to_string(frame.timestamp);
    });
    Segmentation result;
    result.timestamp = frame.timestamp;
    const Entry* entry = nearest(frame.timestamp);
    if (!entry || !entry->present ||
        std::abs(entry->timestamp - frame.timestamp) > settings_.max_difference_s)
      return result;
    const cv::Mat labels = read_labels(mask_path(folder_, entry->stem), frame.color.size());
    result.instances = instances_from_labels(labels, settings_.class_name, settings_.min_area_px);
    result.available = true;
    return result;
  }

 private:
  struct Entry {
    double timestamp;
    std::string stem;
    bool present;
  };

  std::set<std::string> png_stems() const {
    std::error_code error;
    std::set<std::string> stems;
    for (std::filesystem::directory_iterator it(folder_, error), end; !error && it != end;
         it.increment(error))
      if (it->path().extension() == ".png") stems.insert(it->path().stem().string());
    detail::check(!error, [&] {
      return "mask folder " + folder_.string() +
             ": expected a readable folder, found: " + error.message() + "; check the path";
    });
    return stems;
  }

  void sort() {
    std::stable_sort(frames_.begin(), frames_.end(),
                     [](const Entry& a, const Entry& b) { return a.timestamp < b.timestamp; });
  }

  const Entry* nearest(double time) const {
    auto after = std::lower_bound(frames_.begin(), frames_.end(), time,
                                  [](const Entry& e, double t) { return e.timestamp < t; });
    if (after == frames_.end()) return frames_.empty() ? nullptr : &frames_.back();
    if (after == frames_.begin()) return &*after;
    const auto before = after - 1;
    return time - before->timestamp < after->timestamp - time ? &*before : &*after;
  }

  std::filesystem::path folder_;
  Settings settings_;
  std::vector<Entry> frames_;
  std::size_t present_ = 0;
};

}  // namespace stillpoint
