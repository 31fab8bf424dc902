// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "frame_view.hpp"
#include "run_job.hpp"
#include "stillpoint/core/colored_point.hpp"
#include "stillpoint/evaluation/ghost_metrics.hpp"
#include "stillpoint/io/tum_sequence.hpp"

namespace stillpoint::cli {

/// Makes the dense map when all poses are final: a SLAM system corrects old ones at the end.
class MapMaker {
 public:
  /// Keeps the mask of about every fifth frame, packed: whole frames are read again.
  void remember(const FrameView& view);

  struct Result {
    std::vector<ColoredPoint> points;
    /// Ghosts among them; nothing where there is no truth to judge them by.
    std::optional<GhostCounts> ghosts;
  };

  /// `truth_dir`: masks_gt of a sequence with ground truth, to count ghosts by; empty: not at all.
  Result make(const TumSequence& sequence, const Trajectory& trajectory, const Trajectory& truth,
              const std::filesystem::path& truth_dir) const;

 private:
  static constexpr std::size_t kEvery = 5;
  struct Kept {
    std::size_t index = 0;
    std::vector<uchar> mask;
  };

  std::vector<Kept> kept_;
  std::size_t next_ = 0, end_ = 0;
};

/// Writes the map's file and views, as far as they are wanted. Returns what stats.json says of it.
nlohmann::ordered_json write_map(const MapMaker::Result& map, const RunOutputs& outputs);

}  // namespace stillpoint::cli
