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
namespace detail {

/// Input of the YOLO family: RGB, 0 to 1, letterboxed with 114.
inline NetworkInput yolo_input() {
  NetworkInput input;
  input.fit = NetworkInput::Fit::kLetterbox;
  input.rgb = true;
  input.scale = 1 / 255.0f;
  input.padding = {{114, 114, 114}};
  return input;
}

/// Masks as products of coefficients and prototypes (1 x P x H/4 x W/4).
class PrototypeMasks {
 public:
  PrototypeMasks(const TensorView& prototypes, const ImagePlacement& place)
      : prototypes_(prototypes), place_(place) {}

  /// Adds the detection with its mask inside its box; coefficients lie `step` apart. O(P x cells of
  /// the box + pixels of the box).
  void add(const Detection& d, const float* coefficients, std::size_t step, float threshold,
           const std::string& class_name, std::vector<Instance>& instances) {
    const float corners[] = {d.x0, d.y0, d.x1, d.y1};
    check_not_nan("box", corners, 4);
    const cv::Rect box = place_.to_image(d.x0, d.y0, d.x1, d.y1);
    if (box.empty()) return;
    const int count = prototypes_.dim(1), height = prototypes_.dim(2), width = prototypes_.dim(3);
    const std::size_t plane = static_cast<std::size_t>(height) * static_cast<std::size_t>(width);
    const double step_x = static_cast<double>(place_.input.width) / width;
    const double step_y = static_cast<double>(place_.input.height) / height;
    // The cells around the box, with the neighbors that interpolation looks at.
    const auto cell = [](double at, int n) {
      return static_cast<int>(std::min(n - 1.0, std::max(0.0, std::floor(at))));
    };
    const GridMap map = input_grid(place_, step_x, step_y);
    const int x0 = cell(map.scale_x * box.x + map.offset_x, width);
    const int x1 = cell(map.scale_x * (box.x + box.width) + map.offset_x + 1, width);
    const int y0 = cell(map.scale_y * box.y + map.offset_y, height);
    const int y1 = cell(map.scale_y * (box.y + box.height) + map.offset_y + 1, height);
    soft_.assign(static_cast<std::size_t>((x1 - x0 + 1) * (y1 - y0 + 1)), 0.0f);
    for (int p = 0; p < count; ++p) {
      const float c = coefficients[static_cast<std::size_t>(p) * step];
      float* to = soft_.data();
      for (int y = y0; y <= y1; ++y) {
        const float* in = prototypes_.data + static_cast<std::size_t>(p) * plane +
                          static_cast<std::ptrdiff_t>(y) * width;
        for (int x = x0; x <= x1; ++x) *to++ += c * in[x];
      }
    }
    check_not_nan(prototypes_.name, soft_.data(), soft_.size());
    for (float& v : soft_) v = sigmoid(v);
    const GridMap local = {map.scale_x, map.offset_x - x0, map.scale_y, map.offset_y - y0};
    const cv::Mat mask =
        threshold_soft_mask(soft_.data(), x1 - x0 + 1, y1 - y0 + 1, local, box, threshold);
    add_masked(class_name, d.score, box, mask, instances);
  }

 private:
  const TensorView& prototypes_;
  const ImagePlacement& place_;
  std::vector<float> soft_;
};

inline bool are_prototypes(const TensorView& t, const cv::Size& input) {
  return t.shape.size() == 4 && t.dim(0) == 1 && t.dim(1) > 0 && t.dim(2) * 4 == input.height &&
         t.dim(3) * 4 == input.width;
}

/// Cells of all three strides together.
inline int yolo_anchors(const cv::Size& input) {
  int n = 0;
  for (const int stride : {8, 16, 32}) n += (input.width / stride) * (input.height / stride);
  return n;
}

}  // namespace detail

/// YOLO detection and segmentation in their standard export. Boxes of YOLOv8 and 11 are
/// 1 x (4 + C [+ P]) x A; those of YOLOv5 and 7, with objectness, 1 x A x (5 + C). Default score
/// 0.25, mask threshold 0.5.
class YoloDecoder : public Decoder {
 public:
  /// `masks`: with prototypes (the -seg models), else boxes only.
  explicit YoloDecoder(bool masks) : masks_(masks) {}

  const char* name() const override { return masks_ ? "yolo_seg" : "yolo"; }
  const char* expects() const override {
    return masks_ ? "1x(4+C+P)xA (centre, size, C class scores, P coefficients) and prototypes "
                    "1xPx(H/4)x(W/4), A = cells of strides 8, 16, 32"
                  : "one output 1x(4+C)xA (centre, size, C class scores) or 1xAx(5+C) (with "
                    "objectness), A = cells of strides 8, 16, 32";
  }
  NetworkInput input() const override { return detail::yolo_input(); }

  bool fits(const std::vector<TensorView>& outputs, const cv::Size& input) const override {
    const TensorView* boxes = boxes_of(outputs);
    const TensorView* prototypes = prototypes_of(outputs);
    if (!boxes || outputs.size() != (masks_ ? 2u : 1u)) return false;
    const int anchors = detail::yolo_anchors(input);
    if (masks_)
      return prototypes && detail::are_prototypes(*prototypes, input) && boxes->dim(2) == anchors &&
             boxes->dim(1) > 4 + prototypes->dim(1);
    return (boxes->dim(2) == anchors && boxes->dim(1) > 4) ||
           (boxes->dim(1) == 3 * anchors && boxes->dim(2) > 5);
  }
  int classes(const std::vector<TensorView>& outputs) const override {
    const TensorView& boxes = *boxes_of(outputs);
    if (masks_) return boxes.dim(1) - 4 - prototypes_of(outputs)->dim(1);
    return with_objectness(boxes) ? boxes.dim(2) - 5 : boxes.dim(1) - 4;
  }

  std::vector<Instance> decode(const std::vector<TensorView>& outputs, const ImagePlacement& place,
                               const std::vector<std::string>& names,
                               const DecoderSettings& settings) const override {
    const TensorView& boxes = *boxes_of(outputs);
    const bool objectness = !masks_ && with_objectness(boxes);
    const int class_count = classes(outputs);
    const std::size_t anchors = static_cast<std::size_t>(boxes.dim(objectness ? 1 : 2));
    const std::size_t values = static_cast<std::size_t>(boxes.dim(objectness ? 2 : 1));
    // Value v of anchor i stands at i * next + v * step.
    const std::size_t step = objectness ? 1 : anchors, next = objectness ? values : 1;
    detail::check_not_nan(boxes, 0, boxes.size());
    const float least = settings.min_score > 0 ? settings.min_score : 0.25f;
    std::vector<Detection> found;
    for (std::size_t i = 0; i < anchors; ++i) {
      const float* v = boxes.data + i * next;
      const std::size_t first = objectness ? 5 : 4;
      Detection d;
      d.class_id = detail::best_class(v + first * step, step, class_count);
      d.score = v[(first + static_cast<std::size_t>(d.class_id)) * step];
      if (objectness) d.score *= v[4];
      if (!(d.score >= least)) continue;
      const float half_w = 0.5f * v[2 * step], half_h = 0.5f * v[3 * step];
      d.x0 = v[0] - half_w, d.x1 = v[0] + half_w;
      d.y0 = v[step] - half_h, d.y1 = v[step] + half_h;
      d.source = i;
      found.push_back(d);
    }
    detail::suppress_overlaps(found, settings);
    std::vector<Instance> instances;
    if (!masks_) {
      for (const Detection& d : found)
        detail::add_box(names[static_cast<std::size_t>(d.class_id)], d.score,
                        place.to_image(d.x0, d.y0, d.x1, d.y1), instances);
      return instances;
    }
    const float threshold = settings.mask_threshold > 0 ? settings.mask_threshold : 0.5f;
    detail::PrototypeMasks masks(*prototypes_of(outputs), place);
    const std::size_t coefficients = static_cast<std::size_t>(4 + class_count);
    for (const Detection& d : found)
      masks.add(d, boxes.data + d.source + coefficients * anchors, anchors, threshold,
                names[static_cast<std::size_t>(d.class_id)], instances);
    return instances;
  }

 private:
  // By the shape, not by the name: exporters name them output0 and output1, or by numbers.
  static const TensorView* boxes_of(const std::vector<TensorView>& outputs) {
    for (const TensorView& t : outputs)
      if (t.shape.size() == 3 && t.dim(0) == 1) return &t;
    return nullptr;
  }
  static const TensorView* prototypes_of(const std::vector<TensorView>& outputs) {
    for (const TensorView& t : outputs)
      if (t.shape.size() == 4) return &t;
    return nullptr;
  }
  // There are always more anchors than values.
  static bool with_objectness(const TensorView& boxes) { return boxes.dim(1) > boxes.dim(2); }

  bool masks_;
};

/// YOLOv8-seg and YOLO11-seg cut off before the last operations, which OpenCV before 4.7 cannot
/// run: per stride s of 8, 16, 32 the distances of the box's sides over 16 bins, class logits and
/// mask coefficients. Default score 0.25, mask threshold 0.5.
class HeadlessYoloDecoder : public Decoder {
 public:
  const char* name() const override { return "yolo_seg_headless"; }
  const char* expects() const override {
    return "box8, box16, box32 1x(4*B)xhxw, cls8.. 1xCxhxw, coef8.. 1xPxhxw with h = H/8.., and "
           "proto 1xPx(H/4)x(W/4)";
  }
  NetworkInput input() const override { return detail::yolo_input(); }

  bool fits(const std::vector<TensorView>& outputs, const cv::Size& input) const override {
    const TensorView* proto = find_tensor(outputs, "proto");
    const TensorView* first = find_tensor(outputs, "cls8");
    if (!proto || !first || !detail::are_prototypes(*proto, input)) return false;
    for (const int stride : {8, 16, 32}) {
      const Level level(outputs, stride);
      if (!level.box || !level.cls || !level.coef) return false;
      for (const TensorView* t : {level.box, level.cls, level.coef})
        if (t->shape.size() != 4 || t->dim(0) != 1 || t->dim(2) * stride != input.height ||
            t->dim(3) * stride != input.width)
          return false;
      if (level.box->dim(1) < 8 || level.box->dim(1) % 4 != 0 || level.cls->dim(1) < 1 ||
          level.cls->dim(1) != first->dim(1) || level.coef->dim(1) != proto->dim(1))
        return false;
    }
    return true;
  }
  int classes(const std::vector<TensorView>& outputs) const override {
    return find_tensor(outputs, "cls8")->dim(1);
  }

  std::vector<Instance> decode(const std::vector<TensorView>& outputs, const ImagePlacement& place,
                               const std::vector<std::string>& names,
                               const DecoderSettings& settings) const override {
    const float least = settings.min_score > 0 ? settings.min_score : 0.25f;
    const float least_logit = std::log(least / std::max(1e-6f, 1 - least));
    std::vector<Detection> found;
    for (const int stride : {8, 16, 32}) collect(outputs, stride, least_logit, found);
    detail::suppress_overlaps(found, settings);
    const float threshold = settings.mask_threshold > 0 ? settings.mask_threshold : 0.5f;
    detail::PrototypeMasks masks(*find_tensor(outputs, "proto"), place);
    std::vector<Instance> instances;
    for (const Detection& d : found) {
      const int stride = static_cast<int>(d.source & 63);
      const TensorView& coef = *Level(outputs, stride).coef;
      const std::size_t plane = static_cast<std::size_t>(coef.dim(2) * coef.dim(3));
      masks.add(d, coef.data + (d.source >> 6), plane, threshold,
                names[static_cast<std::size_t>(d.class_id)], instances);
    }
    return instances;
  }

 private:
  struct Level {
    Level(const std::vector<TensorView>& outputs, int stride)
        : box(find_tensor(outputs, "box" + std::to_string(stride))),
          cls(find_tensor(outputs, "cls" + std::to_string(stride))),
          coef(find_tensor(outputs, "coef" + std::to_string(stride))) {}
    const TensorView *box, *cls, *coef;
  };

  // The expected distance over the bins, in strides.
  static float distance(const float* bins, std::size_t step, int count) {
    float highest = bins[0];
    for (int b = 1; b < count; ++b)
      highest = std::max(highest, bins[static_cast<std::size_t>(b) * step]);
    float sum = 0, weighted = 0;
    for (int b = 0; b < count; ++b) {
      const float e = std::exp(bins[static_cast<std::size_t>(b) * step] - highest);
      sum += e, weighted += static_cast<float>(b) * e;
    }
    return weighted / sum;
  }

  static void collect(const std::vector<TensorView>& outputs, int stride, float least_logit,
                      std::vector<Detection>& found) {
    const Level level(outputs, stride);
    const int columns = level.cls->dim(3), class_count = level.cls->dim(1);
    const std::size_t plane =
        static_cast<std::size_t>(level.cls->dim(2)) * static_cast<std::size_t>(columns);
    detail::check_not_nan(*level.cls, 0, level.cls->size());
    // Plane by plane: a step of a whole plane per class would miss the cache each time.
    std::vector<float> best(level.cls->data, level.cls->data + plane);
    std::vector<int> best_class(plane, 0);
    for (int c = 1; c < class_count; ++c) {
      const float* scores = level.cls->data + static_cast<std::size_t>(c) * plane;
      for (std::size_t i = 0; i < plane; ++i)
        if (scores[i] > best[i]) best[i] = scores[i], best_class[i] = c;
    }
    const int bins = level.box->dim(1) / 4;
    const std::size_t side = static_cast<std::size_t>(bins) * plane;
    const float s = static_cast<float>(stride);
    for (std::size_t i = 0; i < plane; ++i) {
      if (!(best[i] >= least_logit)) continue;
      const float x = static_cast<float>(i % static_cast<std::size_t>(columns)) + 0.5f;
      const float y = static_cast<float>(i / static_cast<std::size_t>(columns)) + 0.5f;
      const float* box = level.box->data + i;
      Detection d;
      d.x0 = (x - distance(box, plane, bins)) * s;
      d.y0 = (y - distance(box + side, plane, bins)) * s;
      d.x1 = (x + distance(box + 2 * side, plane, bins)) * s;
      d.y1 = (y + distance(box + 3 * side, plane, bins)) * s;
      d.score = detail::sigmoid(best[i]);
      d.class_id = best_class[i];
      d.source = (i << 6) | static_cast<std::size_t>(stride);
      found.push_back(d);
    }
  }
};

}  // namespace stillpoint
