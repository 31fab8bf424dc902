// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <string>
#include <vector>

#include "stillpoint/segmentation/decode/decoder.hpp"
#include "stillpoint/segmentation/decode/detection.hpp"

namespace stillpoint {

/// SparseInst, the network of the paper, as its exporter writes it. No boxes and no overlaps to
/// suppress: each of N masks is an object. Default score 0.3 (before the mask is weighed), mask
/// threshold 0.45.
class SparseInstDecoder : public Decoder {
 public:
  const char* name() const override { return "sparseinst"; }
  const char* expects() const override { return "scores 1xNxC and masks 1xNxHxW"; }
  NetworkInput input() const override {
    NetworkInput input;
    input.fit = NetworkInput::Fit::kTopLeft;
    // The network subtracts these means itself: padding becomes 0 in it.
    input.padding = {{103.53f, 116.28f, 123.675f}};
    return input;
  }
  bool fits(const std::vector<TensorView>& outputs, const cv::Size& input) const override {
    const TensorView *scores = find_tensor(outputs, "scores"),
                     *masks = find_tensor(outputs, "masks");
    return scores && masks && scores->shape.size() == 3 && masks->shape.size() == 4 &&
           scores->dim(0) == 1 && masks->dim(0) == 1 && scores->dim(1) == masks->dim(1) &&
           scores->dim(2) > 0 && masks->dim(2) == input.height && masks->dim(3) == input.width;
  }
  int classes(const std::vector<TensorView>& outputs) const override {
    return find_tensor(outputs, "scores")->dim(2);
  }
  std::vector<Instance> decode(const std::vector<TensorView>& outputs, const ImagePlacement& place,
                               const std::vector<std::string>& names,
                               const DecoderSettings& settings) const override {
    const TensorView &scores = *find_tensor(outputs, "scores"),
                     &masks = *find_tensor(outputs, "masks");
    const int height = masks.dim(2), width = masks.dim(3), count = scores.dim(2);
    const std::size_t plane = static_cast<std::size_t>(height) * static_cast<std::size_t>(width);
    detail::check_not_nan(scores, 0, scores.size());
    const float least = settings.min_score > 0 ? settings.min_score : 0.3f;
    const float threshold = settings.mask_threshold > 0 ? settings.mask_threshold : 0.45f;
    std::vector<Detection> found;
    for (std::size_t i = 0; i < static_cast<std::size_t>(scores.dim(1)); ++i) {
      const float* s = scores.data + i * static_cast<std::size_t>(count);
      Detection d;
      d.class_id = detail::best_class(s, 1, count);
      d.score = s[d.class_id];
      d.source = i;
      if (!(d.score > least)) continue;
      detail::check_not_nan(masks, i * plane, plane);
      if (weigh(masks.data + i * plane, width, height, threshold, d)) found.push_back(d);
    }
    detail::keep_best(found, static_cast<std::size_t>(std::max(0, settings.max_instances)));
    const detail::GridMap map = detail::input_grid(place, 1, 1);
    std::vector<Instance> instances;
    for (const Detection& d : found) {
      // One more on each side: interpolation reaches there.
      const cv::Rect box = place.to_image(d.x0 - 1, d.y0 - 1, d.x1 + 1, d.y1 + 1);
      if (box.empty()) continue;
      const cv::Mat mask = detail::threshold_soft_mask(masks.data + d.source * plane, width, height,
                                                       map, box, threshold);
      detail::add_masked(names[static_cast<std::size_t>(d.class_id)], d.score, box, mask,
                         instances);
    }
    return instances;
  }

 private:
  // Multiplies the score by the mean of the mask's own pixels and finds their box; false if there
  // are none.
  static bool weigh(const float* mask, int width, int height, float threshold, Detection& d) {
    double sum = 0;
    std::size_t n = 0;
    int x0 = width, x1 = -1, y0 = height, y1 = -1;
    for (int y = 0; y < height; ++y, mask += width)
      for (int x = 0; x < width; ++x) {
        if (!(mask[x] > threshold)) continue;
        sum += mask[x], ++n;
        x0 = std::min(x0, x), x1 = std::max(x1, x);
        y0 = std::min(y0, y), y1 = y;
      }
    if (n == 0) return false;
    d.score *= static_cast<float>(sum / static_cast<double>(n));
    d.x0 = static_cast<float>(x0), d.x1 = static_cast<float>(x1 + 1);
    d.y0 = static_cast<float>(y0), d.y1 = static_cast<float>(y1 + 1);
    return true;
  }
};

}  // namespace stillpoint
