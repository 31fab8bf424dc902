// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <stillpoint/stillpoint.hpp>
#include <vector>

int count_kept(const std::vector<cv::Point2f>& keypoints, const stillpoint::DynamicMask& mask);
