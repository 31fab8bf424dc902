// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "stillpoint/core/error.hpp"
#include "stillpoint/segmentation/decode/decoder.hpp"
#include "stillpoint/segmentation/decode/fastest_det.hpp"
#include "stillpoint/segmentation/decode/mask_rcnn.hpp"
#include "stillpoint/segmentation/decode/sparse_inst.hpp"
#include "stillpoint/segmentation/decode/yolo.hpp"

namespace stillpoint {

/// One of each decoder, in the order in which they are tried.
inline std::vector<std::unique_ptr<Decoder>> all_decoders() {
  std::vector<std::unique_ptr<Decoder>> all;
  all.push_back(std::make_unique<HeadlessYoloDecoder>());
  all.push_back(std::make_unique<SparseInstDecoder>());
  all.push_back(std::make_unique<MaskRcnnDecoder>());
  all.push_back(std::make_unique<YoloDecoder>(true));
  all.push_back(std::make_unique<YoloDecoder>(false));
  all.push_back(std::make_unique<FastestDetDecoder>());
  return all;
}

/// The decoder of that name or, without a name, the first that fits the outputs. Throws Error that
/// lists what was found and what each decoder expects. `model` is named in the message.
inline std::unique_ptr<Decoder> choose_decoder(const std::string& model, const std::string& name,
                                               const std::vector<TensorView>& outputs,
                                               const cv::Size& input) {
  auto all = all_decoders();
  std::string list;
  bool known = name.empty();
  for (auto& decoder : all) {
    const bool named = name == decoder->name();
    known = known || named;
    if ((name.empty() || named) && decoder->fits(outputs, input)) return std::move(decoder);
    list += "; " + std::string(decoder->name()) + ": " + decoder->expects();
  }
  const std::string size = std::to_string(input.width) + "x" + std::to_string(input.height);
  if (!known) throw Error(model + ": there is no decoder \"" + name + "\"; there are" + list);
  throw Error(model + ": expected the outputs of a known network" +
              (name.empty() ? "" : " of the kind " + name) + ", found " + tensors_text(outputs) +
              " for an input of " + size + " (W x H)" + list +
              "; export the network so, or derive from stillpoint::Decoder");
}

}  // namespace stillpoint
