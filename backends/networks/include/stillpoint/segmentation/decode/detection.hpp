// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <opencv2/core.hpp>
#include <string>
#include <utility>
#include <vector>

#include "stillpoint/core/error.hpp"
#include "stillpoint/core/instance.hpp"
#include "stillpoint/segmentation/decode/decoder.hpp"
#include "stillpoint/segmentation/decode/network_input.hpp"
#include "stillpoint/segmentation/decode/tensor_view.hpp"

namespace stillpoint {

/// A candidate of a decoder: box in input pixels, and where in the outputs it stands.
struct Detection {
  float x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  float score = 0;
  int class_id = 0;
  std::size_t source = 0;
};

namespace detail {

inline float sigmoid(float v) { return 1 / (1 + std::exp(-v)); }

/// Throws Error if one of n numbers is NaN: such a network says nothing, and taking that for
/// "nobody is here" would be worse than an error. O(n).
inline void check_not_nan(const std::string& output, const float* numbers, std::size_t n) {
  // NaN is the only number that differs from itself; a sum of flags is quick.
  std::size_t bad = 0;
  for (std::size_t i = 0; i < n; ++i) bad += numbers[i] != numbers[i];
  check(bad == 0, [&] {
    return "output \"" + output + "\" of the network: expected numbers, found " +
           std::to_string(bad) + " NaN of " + std::to_string(n) +
           "; the weights are broken, or 16-bit floats overflow: run it with 32-bit floats";
  });
}
inline void check_not_nan(const TensorView& tensor, std::size_t first, std::size_t n) {
  check_not_nan(tensor.name, tensor.data + first, n);
}

/// Of n class scores, `step` apart, the highest; the first of equal ones.
inline int best_class(const float* scores, std::size_t step, int n) {
  int best = 0;
  for (int c = 1; c < n; ++c)
    if (scores[static_cast<std::size_t>(c) * step] > scores[static_cast<std::size_t>(best) * step])
      best = c;
  return best;
}

/// Sorts by score (of equal ones the earlier output first) and keeps the first `most`.
inline void keep_best(std::vector<Detection>& detections, std::size_t most) {
  const auto better = [](const Detection& a, const Detection& b) {
    return a.score != b.score ? a.score > b.score : a.source < b.source;
  };
  std::sort(detections.begin(), detections.end(), better);
  if (detections.size() > most) detections.resize(most);
}

inline float overlap(const Detection& a, const Detection& b) {
  const float w = std::min(a.x1, b.x1) - std::max(a.x0, b.x0);
  const float h = std::min(a.y1, b.y1) - std::max(a.y0, b.y0);
  if (!(w > 0 && h > 0)) return 0;
  const float both = w * h;
  return both / ((a.x1 - a.x0) * (a.y1 - a.y0) + (b.x1 - b.x0) * (b.y1 - b.y0) - both);
}

/// Non-maximum suppression within each class; leaves the detections sorted by score. O(n^2) in
/// those over the threshold, of which at most 1,000 are looked at.
inline void suppress_overlaps(std::vector<Detection>& detections, const DecoderSettings& settings) {
  keep_best(detections, 1000);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < detections.size(); ++i) {
    bool free = true;
    for (std::size_t j = 0; j < kept && free; ++j)
      free = detections[j].class_id != detections[i].class_id ||
             !(overlap(detections[j], detections[i]) > settings.max_overlap);
    if (free) detections[kept++] = detections[i];
  }
  detections.resize(std::min(kept, static_cast<std::size_t>(std::max(0, settings.max_instances))));
}

/// Maps the centre of image pixel x to a place in a grid of soft values: scale * x + offset.
struct GridMap {
  double scale_x, offset_x, scale_y, offset_y;
};

/// The grid with cells of `step` input pixels that covers the whole input.
inline GridMap input_grid(const ImagePlacement& place, double step_x, double step_y) {
  return {place.scale_x / step_x, (0.5 * place.scale_x + place.offset_x) / step_x - 0.5,
          place.scale_y / step_y, (0.5 * place.scale_y + place.offset_y) / step_y - 0.5};
}

/// Writes 255 where the soft values (width x height cells), bilinear and continued beyond their
/// rim, are over `threshold` at the pixels of `box`. O(box).
inline cv::Mat threshold_soft_mask(const float* soft, int width, int height, const GridMap& map,
                                   const cv::Rect& box, float threshold) {
  struct Tap {
    int first, second;
    float share;
  };
  const auto tap = [](double at, int n) {
    const double inside = std::min(n - 1.0, std::max(0.0, at));
    const int first = static_cast<int>(inside);
    return Tap{first, std::min(n - 1, first + 1), static_cast<float>(inside - first)};
  };
  std::vector<Tap> columns(static_cast<std::size_t>(box.width));
  for (int x = 0; x < box.width; ++x)
    columns[static_cast<std::size_t>(x)] = tap(map.scale_x * (box.x + x) + map.offset_x, width);
  cv::Mat mask(box.size(), CV_8UC1);
  std::vector<float> row(static_cast<std::size_t>(width));
  for (int y = 0; y < box.height; ++y) {
    const Tap t = tap(map.scale_y * (box.y + y) + map.offset_y, height);
    const float* a = soft + static_cast<std::ptrdiff_t>(t.first) * width;
    const float* b = soft + static_cast<std::ptrdiff_t>(t.second) * width;
    for (int x = columns.front().first; x <= columns.back().second; ++x)
      row[static_cast<std::size_t>(x)] = a[x] + t.share * (b[x] - a[x]);
    uchar* to = mask.ptr<uchar>(y);
    for (int x = 0; x < box.width; ++x) {
      const Tap& c = columns[static_cast<std::size_t>(x)];
      const float first = row[static_cast<std::size_t>(c.first)];
      const float value = first + c.share * (row[static_cast<std::size_t>(c.second)] - first);
      to[x] = value > threshold ? 255 : 0;
    }
  }
  return mask;
}

/// Adds an instance whose mask covers `box`, cut to what the mask shows; nothing if that is empty.
inline void add_masked(const std::string& class_name, float score, const cv::Rect& box,
                       const cv::Mat& mask, std::vector<Instance>& instances) {
  const cv::Rect used = mask_bounds(mask);
  if (used.empty()) return;
  Instance instance;
  instance.class_name = class_name;
  instance.score = std::min(1.0f, score);
  instance.box = used + box.tl();
  instance.mask = used.size() == mask.size() ? mask : mask(used).clone();
  instances.push_back(std::move(instance));
}

/// Adds a bare box; nothing if it lies outside the image.
inline void add_box(const std::string& class_name, float score, const cv::Rect& box,
                    std::vector<Instance>& instances) {
  if (box.empty()) return;
  Instance instance;
  instance.class_name = class_name;
  instance.score = std::min(1.0f, score);
  instance.box = box;
  instances.push_back(std::move(instance));
}

}  // namespace detail
}  // namespace stillpoint
