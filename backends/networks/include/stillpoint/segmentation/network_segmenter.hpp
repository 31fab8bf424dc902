// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <utility>
#include <vector>

#include "stillpoint/core/error.hpp"
#include "stillpoint/core/frame.hpp"
#include "stillpoint/core/instance.hpp"
#include "stillpoint/segmentation/decode/class_names.hpp"
#include "stillpoint/segmentation/decode/decoder.hpp"
#include "stillpoint/segmentation/decode/decoders.hpp"
#include "stillpoint/segmentation/decode/network_input.hpp"
#include "stillpoint/segmentation/decode/tensor_view.hpp"
#include "stillpoint/segmentation/segmenter.hpp"

namespace stillpoint {

/// What runs a network: the one thing that differs between OpenCV, LibTorch, ONNX Runtime...
class NetworkRuntime {
 public:
  virtual ~NetworkRuntime() = default;
  /// For messages: which program, which file.
  virtual std::string name() const = 0;
  /// The input size (W x H) that the model was made for; a length is 0 where it is open.
  virtual cv::Size input_size() const = 0;
  /// Runs the network on `input`, 1 x 3 x H x W floats. The outputs stay valid until the next call.
  /// Throws Error.
  virtual std::vector<TensorView> run(const std::vector<float>& input, const cv::Size& size) = 0;
};

struct NetworkSegmenterSettings {
  /// A decoder's name; empty: recognised from the network's outputs.
  std::string decoder;
  /// One name per class of the network; empty: COCO's.
  std::vector<std::string> class_names;
  /// W x H that the image is fitted into, both or neither. Empty: the model's own. Where it is open
  /// in both, the image's, at most 640 on the longer side; in one, the length that keeps the
  /// image's proportions, at most four times the fixed one; rounded up to multiples of 32.
  cv::Size input_size;
  DecoderSettings decoding;

  /// Throws Error if a setting makes no sense.
  void check() const {
    const auto fail = [](const char* name, const char* expected, double found) {
      throw Error(std::string("NetworkSegmenterSettings.") + name + ": expected " + expected +
                  ", found " + std::to_string(found));
    };
    const DecoderSettings& d = decoding;
    if (!(d.min_score >= 0 && d.min_score < 1)) fail("min_score", "0 to 1", d.min_score);
    if (!(d.mask_threshold >= 0 && d.mask_threshold < 1))
      fail("mask_threshold", "0 to 1", d.mask_threshold);
    if (!(d.max_overlap >= 0 && d.max_overlap <= 1)) fail("max_overlap", "0 to 1", d.max_overlap);
    if (d.max_instances < 1) fail("max_instances", "at least 1", d.max_instances);
    for (const int length : {input_size.width, input_size.height})
      if (length < 0 || length > 8192) fail("input_size", "0 to 8192", length);
    if ((input_size.width == 0) != (input_size.height == 0))
      throw Error(
          "NetworkSegmenterSettings.input_size: expected both width and height, or neither "
          "(the model's own), found " +
          std::to_string(input_size.width) + "x" + std::to_string(input_size.height) +
          " (W x H); give the " + (input_size.width == 0 ? "width" : "height") + ", too");
  }
};

/// A network as a Segmenter: fits the image into the input, runs it, decodes its outputs.
///
/// The constructor runs the network once on a grey image: what cannot work is said there. Reports
/// the objects of all classes; which of them are dynamic is a setting of FrontEnd. Not thread-safe.
class NetworkSegmenter : public Segmenter {
 public:
  using Settings = NetworkSegmenterSettings;

  /// Throws Error if the model does not run, no decoder fits its outputs, or there is not one name
  /// per class.
  explicit NetworkSegmenter(std::unique_ptr<NetworkRuntime> runtime, const Settings& settings = {})
      : runtime_(std::move(runtime)), settings_(settings) {
    settings_.check();
    const cv::Size fixed = runtime_->input_size(), wanted = settings_.input_size;
    const auto text = [](const cv::Size& s) {
      const auto length = [](int n) { return n > 0 ? std::to_string(n) : std::string("?"); };
      return length(s.width) + "x" + length(s.height);
    };
    const auto agree = [](int length, int other) { return length == 0 || other == length; };
    if (wanted.area() > 0 &&
        !(agree(fixed.width, wanted.width) && agree(fixed.height, wanted.height)))
      throw Error(runtime_->name() + ": expected the input size that the model was made for, " +
                  text(fixed) + ", found NetworkSegmenterSettings.input_size " + text(wanted) +
                  "; leave it out, or export the model with another");
    size_ = wanted.area() > 0 ? wanted : fixed;
    const cv::Size trial = complete_input_size(size_, cv::Size(320, 320));
    const std::vector<float> grey(3 * static_cast<std::size_t>(trial.area()), 0.5f);
    const std::vector<TensorView> outputs = runtime_->run(grey, trial);
    decoder_ = choose_decoder(runtime_->name(), settings_.decoder, outputs, trial);
    name_classes(decoder_->classes(outputs));
  }

  /// Segments a frame's color image. Throws Error if the network fails or gives NaN.
  Segmentation segment(const RgbdFrame& frame) override {
    check_frame(frame);
    const cv::Size size = complete_input_size(size_, frame.color.size());
    const NetworkInput input = decoder_->input();
    const ImagePlacement place = place_image(frame.color.size(), size, input.fit);
    const std::vector<TensorView> outputs =
        runtime_->run(preparer_.prepare(frame.color, input, place), size);
    detail::check(decoder_->fits(outputs, size) && decoder_->classes(outputs) == class_count_, [&] {
      return runtime_->name() + ": expected outputs as on the first run (" + decoder_->expects() +
             "), found " + tensors_text(outputs);
    });
    Segmentation result;
    result.instances = decoder_->decode(outputs, place, settings_.class_names, settings_.decoding);
    result.timestamp = frame.timestamp;
    result.available = true;
    return result;
  }

  std::vector<std::string> classes() const override { return settings_.class_names; }
  /// The decoder that fits, e.g. "yolo_seg".
  std::string decoder() const { return decoder_->name(); }

 private:
  void name_classes(int count) {
    class_count_ = count;
    std::vector<std::string>& names = settings_.class_names;
    if (names.empty() && count == 80) names = coco_class_names();
    if (names.empty() && count == 90) names = coco_annotation_names();
    if (names.size() != static_cast<std::size_t>(count))
      throw Error(runtime_->name() + ": expected one name for each of the network's " +
                  std::to_string(count) + " classes, found " +
                  (names.empty() ? "none (only 80 and 90 classes are taken for COCO's)"
                                 : std::to_string(names.size())) +
                  "; set NetworkSegmenterSettings.class_names");
    if (std::count(names.begin(), names.end(), "") > 0)
      throw Error(runtime_->name() +
                  ": expected a name for each class, found an empty one; an object without a name "
                  "counts as found by its motion");
  }

  std::unique_ptr<NetworkRuntime> runtime_;
  Settings settings_;
  cv::Size size_;  // a length is 0 where the image decides
  std::unique_ptr<Decoder> decoder_;
  int class_count_ = 0;
  InputPreparer preparer_;
};

}  // namespace stillpoint
