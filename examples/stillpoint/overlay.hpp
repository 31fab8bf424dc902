// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <utility>
#include <vector>

#include "stillpoint/core/camera.hpp"
#include "stillpoint/core/frame.hpp"
#include "stillpoint/core/mask.hpp"
#include "stillpoint/core/object.hpp"

namespace stillpoint::cli {

/// The frame with kept keypoints green, removed ones red, the mask's edge yellow and its inside
/// tinted, and a strip below with a legend and the timestamp. `color` is BGR or grey; an empty mask
/// is drawn as none. Returns CV_8UC3, 26 rows taller than the frame.
cv::Mat draw_overlay(const cv::Mat& color, const DynamicMask& mask,
                     const std::vector<cv::Point2f>& kept, const std::vector<cv::Point2f>& removed,
                     double timestamp);

/// Adds to an overlay each object's id and class at its box, and an arrow to where it will be in
/// half a second; none where its velocity is not known, or below 0.1 m/s.
void draw_objects(cv::Mat& overlay, const std::vector<DynamicObject>& objects,
                  const Camera& camera);

/// The way of a frame's mask in six small images: the frame, four stages with their names (each
/// against the truth: right green, missing red, too much blue), and the kept keypoints.
cv::Mat draw_stages(const RgbdFrame& frame, const cv::Mat& truth,
                    const std::vector<std::pair<std::string, cv::Mat>>& stages,
                    const DynamicMask& mask, const std::vector<cv::Point2f>& kept);

/// "data:image/jpeg;base64,..." of a file, to be used in a page that needs no other file. The
/// ending of the name gives the type; throws Error if the file cannot be read.
std::string data_uri(const std::string& file);

}  // namespace stillpoint::cli
