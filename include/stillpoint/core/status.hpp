// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace stillpoint {

/// What happened to a frame, as bits; 0 = everything as it should be.
enum FrameStatus : std::uint32_t {
  kOk = 0,
  kNoSegmentation = 1u << 0,   ///< no result for this frame: the masks are predictions
  kNeverSegmented = 1u << 1,   ///< no result at all so far: masked is what the motion check found
  kMaskStale = 1u << 2,        ///< a result too old, or an object unseen for too long: dropped
  kRestored = 1u << 3,         ///< at least one missed or partly missed object was restored
  kMaskTooLarge = 1u << 4,     ///< mask over the settable share of the image
  kNoDepth = 1u << 5,          ///< no depth image, or no valid value in it
  kNoKeypoints = 1u << 6,      ///< the host gave no keypoint
  kKeypointFloor = 1u << 7,    ///< too few static keypoints: the least dynamic ones were kept too
  kSegmenterFailed = 1u << 8,  ///< the segmenter threw; its message is in FrameStats
  kTimestampOrder = 1u << 9,   ///< timestamp not after the last one: history was forgotten
  kPoseRefused = 1u << 10,     ///< a pose of the host's is not finite, no rigid motion, or leaps
  kObjectDoubted = 1u << 11,   ///< an object that suddenly covered much of the image was left out
};

/// Names of the bits that are set, for logs and statistics.
inline std::vector<std::string> status_names(std::uint32_t status) {
  static const char* const names[] = {"no_segmentation", "never_segmented", "mask_stale",
                                      "restored",        "mask_too_large",  "no_depth",
                                      "no_keypoints",    "keypoint_floor",  "segmenter_failed",
                                      "timestamp_order", "pose_refused",    "object_doubted"};
  std::vector<std::string> set;
  for (unsigned i = 0; i < sizeof(names) / sizeof(names[0]); ++i)
    if (status & (1u << i)) set.push_back(names[i]);
  return set;
}

}  // namespace stillpoint
