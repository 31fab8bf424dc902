// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <stillpoint/core/mask.hpp>
#include <stillpoint/keypoints/probabilistic_keypoint_filter.hpp>
#include <stillpoint/version.hpp>
#include <vector>

int count_kept(const std::vector<cv::Point2f>& keypoints, const stillpoint::DynamicMask& mask);
