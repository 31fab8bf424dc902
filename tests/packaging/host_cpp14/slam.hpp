// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <opencv2/core.hpp>
#include <vector>

/// The host's library: the keypoints of a grid over 320 x 240, less what the hook removes.
std::vector<cv::KeyPoint> extract(double timestamp, cv::Mat& descriptors);
