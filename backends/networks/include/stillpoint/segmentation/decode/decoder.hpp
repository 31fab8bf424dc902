// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <string>
#include <vector>

#include "stillpoint/core/instance.hpp"
#include "stillpoint/segmentation/decode/network_input.hpp"
#include "stillpoint/segmentation/decode/tensor_view.hpp"

namespace stillpoint {

/// What a decoder keeps. 0: the decoder's own default, which its class comment names.
struct DecoderSettings {
  /// Least score, 0 to 1.
  float min_score = 0;
  /// From which soft value on a pixel is the object's, 0 to 1.
  float mask_threshold = 0;
  /// Of two boxes of one class that overlap more (intersection over union), the weaker goes.
  float max_overlap = 0.5f;
  /// At most so many objects, those with the highest scores.
  int max_instances = 100;
};

/// Turns a network's outputs into instances; the same for every runtime.
class Decoder {
 public:
  virtual ~Decoder() = default;
  /// By which the user may choose it.
  virtual const char* name() const = 0;
  /// The outputs that it reads, for messages.
  virtual const char* expects() const = 0;
  /// How the network wants its image.
  virtual NetworkInput input() const = 0;
  /// True if a network with that input size and these outputs is one of its kind.
  virtual bool fits(const std::vector<TensorView>& outputs, const cv::Size& input) const = 0;
  /// Number of classes in outputs that fit.
  virtual int classes(const std::vector<TensorView>& outputs) const = 0;
  /// Decodes outputs that fit. `names` has one name per class. Boxes and masks are as written at
  /// Instance, for the placed image; masks are empty for detectors of boxes. Sorted by score.
  /// Throws Error if scores are NaN.
  virtual std::vector<Instance> decode(const std::vector<TensorView>& outputs,
                                       const ImagePlacement& place,
                                       const std::vector<std::string>& names,
                                       const DecoderSettings& settings) const = 0;
};

}  // namespace stillpoint
