// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <string>

#include "run_job.hpp"

namespace stillpoint::cli {

/// What `stillpoint mask` is asked for. `run.sequence`: a folder in TUM layout, or of images.
struct MaskSettings {
  RunSettings run;
  std::filesystem::path out;
  std::string format = "stillpoint";
  /// Depth images of a folder of images; empty: none.
  std::filesystem::path depth;
  /// Where depth without dynamic pixels goes; empty: nowhere.
  std::filesystem::path masked_depth;
  /// CSV of the objects of each frame (see io/objects_file.hpp); empty: none.
  std::filesystem::path objects;
  /// Images per second of a folder of images; 0: the camera file's, else 30.
  double fps = 0;
  /// The segmenter's masks as they are, boxes filled by depth.
  bool network_only = false;
};

/// Writes a mask for each image. Files that an earlier, unfinished run of the same settings wrote
/// stay; their frames run again, since what is carried along depends on them. `progress(done,
/// total)` is called after each frame, `note(text)` for what the user should know. Returns four
/// lines of statistics. Throws Error for bad input, and for `out` of other settings.
std::string run_mask_job(const MaskSettings& settings,
                         const std::function<void(std::size_t done, std::size_t total)>& progress,
                         const std::function<void(const std::string& note)>& note);

}  // namespace stillpoint::cli
