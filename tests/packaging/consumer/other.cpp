// SPDX-License-Identifier: BSD-2-Clause
#include "other.hpp"

int count_kept(const std::vector<cv::Point2f>& keypoints, const stillpoint::DynamicMask& mask) {
  stillpoint::KeypointFilterSettings settings;
  settings.min_kept = 0;
  stillpoint::ProbabilisticKeypointFilter<> filter(settings);
  return static_cast<int>(filter.filter(keypoints, mask).kept.size());
}
