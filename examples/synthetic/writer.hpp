// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <functional>
#include <string>

#include "stillpoint/testing/degraded_masks.hpp"
#include "synthetic/sequence.hpp"

namespace stillpoint {

/// Called after each written frame with the number of frames done so far and of all; may come from
/// any thread, one at a time.
using SyntheticProgress = std::function<void(int done, int total)>;

struct SyntheticWriterOptions {
  /// Color as JPEG (quality 95) instead of PNG.
  bool jpeg = false;
  MaskDamage damage;
};

/// What was written, for a message and for tests.
struct SyntheticSummary {
  int frames = 0;
  /// Share of the image that people (and movers) cover: mean and most.
  double mean_cover = 0, most_cover = 0;
  /// Share of the people's pixels that masks/ lost, and share of masks/ that is no person.
  double lost_share = 0, false_share = 0;
  /// Blur of the static world in pixels: mean over the frames, and of the people (by pixels).
  double camera_blur_px = 0, people_blur_px = 0;
};

/// Writes the sequence as a folder of the TUM layout: rgb/, depth/, rgb.txt, depth.txt,
/// associations.txt, groundtruth.txt (every 5 ms), camera.yaml; masks_gt/ (exact labels of all that
/// moves: people 1.., movers 101..), masks/ (people only, as a blur-stricken segmenter gives them,
/// see degrade_masks), movers_gt/ when there are movers, and blur.csv (per frame and label: pixels
/// and blur). Images are named by the timestamp. Existing files of the same names are replaced;
/// others stay. Frames are rendered with cv::parallel_for_; the files are the same for any number
/// of threads. Throws Error when something cannot be written.
SyntheticSummary write_synthetic_sequence(const std::string& folder,
                                          const SyntheticSettings& settings,
                                          const SyntheticProgress& progress = {},
                                          const SyntheticWriterOptions& options = {});

}  // namespace stillpoint
