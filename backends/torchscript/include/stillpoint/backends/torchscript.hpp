// SPDX-License-Identifier: BSD-2-Clause
#pragma once

// First: without it, clang++ -std=c++20 refuses the next one (LibTorch 1.13).
#include <ATen/core/ivalue.h>
#include <torch/csrc/api/include/torch/version.h>
#include <torch/script.h>

#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "stillpoint/core/error.hpp"
#include "stillpoint/segmentation/network_segmenter.hpp"

namespace stillpoint {

struct TorchScriptSettings : NetworkSegmenterSettings {
  /// Where it runs, in LibTorch's words: "cpu", "cuda", "cuda:1". Debian's LibTorch has the CPU.
  std::string device = "cpu";
  /// One name per output, in their order; empty: the names of a Dict or NamedTuple, else output0,
  /// output1... The decoders sparseinst, mask_rcnn and yolo_seg_headless go by names.
  std::vector<std::string> output_names;
};

/// A TorchScript file run by LibTorch: a module, traced or scripted, whose forward() takes one
/// image, 1 x 3 x H x W floats, and returns a tensor, or a list, tuple, NamedTuple or Dict of
/// them, nested or not. Outputs are converted to 32-bit floats.
class TorchScriptRuntime : public NetworkRuntime {
 public:
  /// Throws Error if the file is missing, broken or no TorchScript, or the device is not there.
  TorchScriptRuntime(const std::filesystem::path& model, const TorchScriptSettings& settings)
      : model_(model), names_(settings.output_names) {
    std::error_code none;
    if (!std::filesystem::is_regular_file(model, none))
      throw Error(name() + ": expected a model file, found none; check the path");
    check_beginning();
    try {
      device_ = torch::Device(settings.device);
      torch::zeros({1}, device_);  // fails where there is none
    } catch (const std::exception& e) {
      throw Error("TorchScriptSettings.device: expected a device of this LibTorch (\"cpu\"...), " +
                  ("found \"" + settings.device + "\" (") + reason(e) + ")");
    }
    torch::jit::ExtraFilesMap files{{"config.txt", ""}};
    try {
      module_ = torch::jit::load(model.string(), device_, files);
      module_.eval();
    } catch (const std::exception& e) {
      throw Error(name() + ": LibTorch " TORCH_VERSION " cannot read this file (" + reason(e) +
                  "). It must be TorchScript (torch.jit.trace or torch.jit.script, then save(); "
                  "YOLO: export format=torchscript), whole, and of no newer version");
    }
    const auto forward = module_.find_method("forward");
    if (!forward) throw Error(name() + ": expected a module with forward(), found none");
    int arguments = -1;  // without the module itself
    for (const c10::Argument& a : forward->function().getSchema().arguments())
      arguments += !a.default_value();
    if (arguments != 1)
      throw Error(name() + ": expected a forward() that takes one image, found one that takes " +
                  std::to_string(arguments) + " arguments; wrap it in a module that takes one");
    read_input_size(files["config.txt"]);
  }

  std::string name() const override { return "torchscript model " + model_.string(); }
  cv::Size input_size() const override { return input_size_; }

  std::vector<TensorView> run(const std::vector<float>& input, const cv::Size& size) override {
    outputs_.clear();
    try {
      const c10::InferenceMode no_gradients;
      // A copy, as a network may work in its input.
      const torch::Tensor image =
          torch::from_blob(const_cast<float*>(input.data()), {1, 3, size.height, size.width})
              .clone()
              .to(device_);
      collect(module_.forward({image}), "");
    } catch (const Error&) {
      throw;
    } catch (const std::exception& e) {
      throw Error(name() + ": LibTorch " TORCH_VERSION " cannot run it on 1x3x" +
                  std::to_string(size.height) + "x" + std::to_string(size.width) + " (" +
                  reason(e) + "). A traced network may take only the size that it was traced " +
                  "with: set NetworkSegmenterSettings.input_size");
    }
    if (!names_.empty() && names_.size() != outputs_.size())
      throw Error(name() + ": TorchScriptSettings.output_names: expected one for each of its " +
                  std::to_string(outputs_.size()) + " outputs, found " +
                  std::to_string(names_.size()));
    std::vector<TensorView> views;
    for (std::size_t i = 0; i < outputs_.size(); ++i) {
      const torch::Tensor& t = outputs_[i].tensor;
      std::string called = outputs_[i].name;
      if (called.empty()) called = "output" + std::to_string(i);
      if (!names_.empty()) called = names_[i];
      views.push_back(
          {called, std::vector<int>(t.sizes().begin(), t.sizes().end()), t.data_ptr<float>()});
    }
    return views;
  }

 private:
  struct Output {
    std::string name;  // empty: it has none
    torch::Tensor tensor;
  };

  // LibTorch's messages span pages: the line that counts.
  static std::string reason(const std::exception& e) {
    const auto* own = dynamic_cast<const c10::Error*>(&e);
    std::string text = own ? own->what_without_backtrace() : e.what();
    const std::string mark = "RuntimeError: ";
    const std::size_t at = text.rfind(mark);
    if (at != std::string::npos) text.erase(0, at + mark.size());
    text.erase(std::min(text.size(), text.find('\n')));
    return text;
  }

  // Says of the usual mix-ups what the file is.
  void check_beginning() const {
    std::string start(8, '\0');
    std::ifstream in(model_, std::ios::binary);
    in.read(&start[0], static_cast<std::streamsize>(start.size()));
    start.resize(static_cast<std::size_t>(in.gcount()));
    if (start.compare(0, 2, "PK") == 0) return;  // a ZIP archive, as it must be
    const char* const found = start.empty()         ? "an empty file"
                              : start == "version " ? "a pointer of Git LFS, not the file itself"
                              : start[0] == '\x80'  ? "a pickle of Python (torch.save)"
                              : start[0] == '\x08'  ? "perhaps an ONNX file (see opencv_dnn)"
                                                    : "another format";
    throw Error(name() + ": expected a TorchScript file, found " + found +
                "; export the model by torch.jit.trace or torch.jit.script and save()");
  }

  // Ultralytics' exporter writes the size that was traced beside the network: "imgsz": [H, W].
  void read_input_size(const std::string& config) {
    const std::size_t at = config.find("\"imgsz\"");
    int height = 0, width = 0;
    if (at != std::string::npos &&
        std::sscanf(config.c_str() + at, "\"imgsz\" : [ %d , %d", &height, &width) == 2 &&
        height > 0 && height <= 8192 && width > 0 && width <= 8192)
      input_size_ = {width, height};
  }

  void collect(const c10::IValue& value, const std::string& called) {
    if (value.isTensor()) {
      outputs_.push_back({called, value.toTensor().to(torch::kCPU, torch::kFloat).contiguous()});
    } else if (value.isTuple()) {
      const auto& tuple = value.toTupleRef();
      const auto type = tuple.type();
      const c10::FunctionSchema* const fields = type->schema().get();
      for (std::size_t i = 0; i < tuple.elements().size(); ++i)
        collect(tuple.elements()[i], fields ? fields->arguments()[i].name() : std::string());
    } else if (value.isList()) {
      for (const c10::IValue& one : value.toListRef()) collect(one, "");
    } else if (value.isGenericDict()) {
      for (const auto& item : value.toGenericDict())
        collect(item.value(), item.key().isString() ? item.key().toStringRef() : std::string());
    } else if (!value.isNone()) {
      throw Error(name() + ": expected tensors from forward(), found a value of type " +
                  value.type()->str() + "; export a network that returns tensors only");
    }
  }

  std::filesystem::path model_;
  std::vector<std::string> names_;
  torch::Device device_{torch::kCPU};
  torch::jit::Module module_;
  cv::Size input_size_;
  std::vector<Output> outputs_;
};

/// A network that LibTorch runs, as a Segmenter:
///
///     stillpoint::TorchScriptSegmenter segmenter("yolov8n-seg.torchscript");
///
/// The decoder is recognised from the network's outputs (see choose_decoder). Construction reads
/// the file and runs the network once. Throws Error that says what is wrong with the file, the
/// network or the settings.
class TorchScriptSegmenter : public NetworkSegmenter {
 public:
  using Settings = TorchScriptSettings;

  explicit TorchScriptSegmenter(const std::filesystem::path& model, const Settings& settings = {})
      : NetworkSegmenter(std::make_unique<TorchScriptRuntime>(model, settings), settings) {}
};

}  // namespace stillpoint
