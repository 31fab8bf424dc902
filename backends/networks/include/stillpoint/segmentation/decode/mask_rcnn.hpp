// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "stillpoint/segmentation/decode/decoder.hpp"
#include "stillpoint/segmentation/decode/detection.hpp"

namespace stillpoint {

/// Mask R-CNN as the TensorFlow graphs for OpenCV have it: boxes in shares of the input, one soft
/// mask per box and class. Default score 0.5, mask threshold 0.5.
class MaskRcnnDecoder : public Decoder {
 public:
  const char* name() const override { return "mask_rcnn"; }
  const char* expects() const override {
    return "detection_out_final 1x1xNx7 (image, class, score, left, top, right, bottom) and "
           "detection_masks NxCxmxm";
  }
  NetworkInput input() const override {
    NetworkInput input;
    input.rgb = true;
    return input;
  }
  bool fits(const std::vector<TensorView>& outputs, const cv::Size&) const override {
    const TensorView* boxes = find_tensor(outputs, "detection_out_final");
    const TensorView* masks = find_tensor(outputs, "detection_masks");
    return boxes && masks && boxes->shape.size() == 4 && boxes->dim(3) == 7 &&
           masks->shape.size() == 4 && masks->dim(1) > 0 && masks->dim(2) > 0 &&
           masks->dim(3) > 0 && masks->dim(0) >= boxes->dim(2);
  }
  int classes(const std::vector<TensorView>& outputs) const override {
    return find_tensor(outputs, "detection_masks")->dim(1);
  }
  std::vector<Instance> decode(const std::vector<TensorView>& outputs, const ImagePlacement& place,
                               const std::vector<std::string>& names,
                               const DecoderSettings& settings) const override {
    const TensorView& boxes = *find_tensor(outputs, "detection_out_final");
    const TensorView& masks = *find_tensor(outputs, "detection_masks");
    const std::size_t count = static_cast<std::size_t>(boxes.dim(2));
    const std::size_t class_count = static_cast<std::size_t>(masks.dim(1));
    const int height = masks.dim(2), width = masks.dim(3);
    const std::size_t plane = static_cast<std::size_t>(height) * static_cast<std::size_t>(width);
    detail::check_not_nan(boxes, 0, boxes.size());
    const float least = settings.min_score > 0 ? settings.min_score : 0.5f;
    const float threshold = settings.mask_threshold > 0 ? settings.mask_threshold : 0.5f;
    std::vector<Detection> found;
    for (std::size_t i = 0; i < count; ++i) {
      const float* b = boxes.data + 7 * i;
      if (!(b[2] >= least) || !(b[1] >= 0 && b[1] < static_cast<float>(class_count))) continue;
      Detection d;
      d.class_id = static_cast<int>(b[1]);
      d.score = b[2];
      d.x0 = b[3] * static_cast<float>(place.input.width);
      d.y0 = b[4] * static_cast<float>(place.input.height);
      d.x1 = b[5] * static_cast<float>(place.input.width);
      d.y1 = b[6] * static_cast<float>(place.input.height);
      d.source = i;
      found.push_back(d);
    }
    // The graph has suppressed overlaps already.
    detail::keep_best(found, static_cast<std::size_t>(std::max(0, settings.max_instances)));
    std::vector<Instance> instances;
    for (const Detection& d : found) {
      const cv::Rect box = place.to_image(d.x0, d.y0, d.x1, d.y1);
      if (box.empty()) continue;
      // The grid covers the box as the network gave it, also where it reaches out of the image.
      const double step_x = (static_cast<double>(d.x1) - d.x0) / width;
      const double step_y = (static_cast<double>(d.y1) - d.y0) / height;
      detail::GridMap map = detail::input_grid(place, step_x, step_y);
      map.offset_x -= d.x0 / step_x, map.offset_y -= d.y0 / step_y;
      const float* soft =
          masks.data + (d.source * class_count + static_cast<std::size_t>(d.class_id)) * plane;
      detail::check_not_nan(masks.name, soft, plane);
      const std::string& name = names[static_cast<std::size_t>(d.class_id)];
      detail::add_masked(name, d.score, box,
                         detail::threshold_soft_mask(soft, width, height, map, box, threshold),
                         instances);
    }
    return instances;
  }
};

}  // namespace stillpoint
