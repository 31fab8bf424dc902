// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "stillpoint/segmentation/decode/decoder.hpp"
#include "stillpoint/segmentation/decode/detection.hpp"

namespace stillpoint {

/// FastestDet: boxes only, one cell per 16 input pixels. Default score 0.6.
class FastestDetDecoder : public Decoder {
 public:
  const char* name() const override { return "fastestdet"; }
  const char* expects() const override {
    return "one output 1x(5+C)x(H/16)x(W/16): objectness, dx, dy, w, h, C class scores";
  }
  NetworkInput input() const override {
    NetworkInput input;
    input.scale = 1 / 255.0f;
    return input;
  }
  bool fits(const std::vector<TensorView>& outputs, const cv::Size& input) const override {
    if (outputs.size() != 1) return false;
    const TensorView& t = outputs[0];
    return t.shape.size() == 4 && t.dim(0) == 1 && t.dim(1) > 5 && t.dim(2) * 16 == input.height &&
           t.dim(3) * 16 == input.width;
  }
  int classes(const std::vector<TensorView>& outputs) const override {
    return outputs[0].dim(1) - 5;
  }
  std::vector<Instance> decode(const std::vector<TensorView>& outputs, const ImagePlacement& place,
                               const std::vector<std::string>& names,
                               const DecoderSettings& settings) const override {
    const TensorView& t = outputs[0];
    const int rows = t.dim(2), columns = t.dim(3);
    const std::size_t plane = static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns);
    detail::check_not_nan(t, 0, t.size());
    const float least = settings.min_score > 0 ? settings.min_score : 0.6f;
    const float width = static_cast<float>(place.input.width);
    const float height = static_cast<float>(place.input.height);
    std::vector<Detection> found;
    for (std::size_t i = 0; i < plane; ++i) {
      const float* cell = t.data + i;
      Detection d;
      d.class_id = detail::best_class(cell + 5 * plane, plane, t.dim(1) - 5);
      const float class_score = cell[(5 + static_cast<std::size_t>(d.class_id)) * plane];
      d.score = std::pow(cell[0], 0.6f) * std::pow(class_score, 0.4f);
      if (!(d.score >= least)) continue;
      const float column = static_cast<float>(i % static_cast<std::size_t>(columns));
      const float row = static_cast<float>(i / static_cast<std::size_t>(columns));
      const float x = (column + std::tanh(cell[plane])) / static_cast<float>(columns) * width;
      const float y = (row + std::tanh(cell[2 * plane])) / static_cast<float>(rows) * height;
      const float w = detail::sigmoid(cell[3 * plane]) * width;
      const float h = detail::sigmoid(cell[4 * plane]) * height;
      d.x0 = x - 0.5f * w, d.x1 = x + 0.5f * w;
      d.y0 = y - 0.5f * h, d.y1 = y + 0.5f * h;
      d.source = i;
      found.push_back(d);
    }
    detail::suppress_overlaps(found, settings);
    std::vector<Instance> instances;
    for (const Detection& d : found)
      detail::add_box(names[static_cast<std::size_t>(d.class_id)], d.score,
                      place.to_image(d.x0, d.y0, d.x1, d.y1), instances);
    return instances;
  }
};

}  // namespace stillpoint
