// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <mutex>
#include <opencv2/core.hpp>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/dnn.hpp>
#include <string>
#include <vector>

#include "stillpoint/backends/opencv_dnn/onnx_header.hpp"
#include "stillpoint/core/error.hpp"
#include "stillpoint/segmentation/network_segmenter.hpp"

namespace stillpoint {

struct OpenCvDnnSettings : NetworkSegmenterSettings {
  /// The graph's text file, for formats that have one (Mask R-CNN of TensorFlow: .pbtxt).
  std::filesystem::path config;
  /// cv::dnn::Backend and cv::dnn::Target. The default runs on any CPU.
  int backend = cv::dnn::DNN_BACKEND_OPENCV;
  int target = cv::dnn::DNN_TARGET_CPU;
};

/// A model file run by OpenCV's DNN module.
class OpenCvDnnRuntime : public NetworkRuntime {
 public:
  /// Reads an .onnx file, or any other that cv::dnn::readNet() knows. Throws Error if the file is
  /// missing or broken, or this OpenCV does not know its operations.
  OpenCvDnnRuntime(const std::filesystem::path& model, const OpenCvDnnSettings& settings)
      : model_(model) {
    std::error_code none;
    if (!std::filesystem::is_regular_file(model, none))
      throw Error(name() + ": expected a model file, found none; check the path");
    if (!settings.config.empty() && !std::filesystem::is_regular_file(settings.config, none))
      throw Error(name() + ": expected its graph in " + settings.config.string() +
                  ", found no such file; check the path");
    if (model.extension() == ".onnx") read_header();
    try {
      // What OpenCV would print to stderr comes back in the exception.
      const Quiet quiet;
      net_ = cv::dnn::readNet(model.string(), settings.config.string());
      net_.setPreferableBackend(settings.backend);
      net_.setPreferableTarget(settings.target);
      output_names_ = net_.getUnconnectedOutLayersNames();
    } catch (const cv::Exception& e) {
      throw Error(cannot("read", e));
    }
    if (net_.empty() || output_names_.empty())
      throw Error(name() + ": expected a network, found an empty one");
  }

  std::string name() const override { return "opencv_dnn model " + model_.string(); }
  cv::Size input_size() const override { return input_size_; }

  std::vector<TensorView> run(const std::vector<float>& input, const cv::Size& size) override {
    const int shape[] = {1, 3, size.height, size.width};
    try {
      const Quiet quiet;
      // Copied by setInput(): the const_cast does not write.
      net_.setInput(cv::Mat(4, shape, CV_32FC1, const_cast<float*>(input.data())), input_name_);
      net_.forward(outputs_, output_names_);
    } catch (const cv::Exception& e) {
      throw Error(cannot("run", e));
    }
    std::vector<TensorView> views;
    for (std::size_t i = 0; i < outputs_.size(); ++i) {
      cv::Mat& out = outputs_[i];
      if (out.depth() != CV_32F || !out.isContinuous())
        throw Error(name() + ": output " + output_names_[i] + ": expected 32-bit floats, found " +
                    "another type; export the model with 32-bit floats");
      views.push_back({output_names_[i], std::vector<int>(out.size.p, out.size.p + out.dims),
                       out.ptr<float>()});
    }
    return views;
  }

 private:
  /// Silences OpenCV's log while it lives, in all threads: the first one takes the level, the last
  /// one gives it back.
  class Quiet {
   public:
    Quiet() {
      const std::lock_guard<std::mutex> guard(log().mutex);
      if (log().silencers++ == 0)
        log().level = cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
    }
    ~Quiet() {
      const std::lock_guard<std::mutex> guard(log().mutex);
      if (--log().silencers == 0) cv::utils::logging::setLogLevel(log().level);
    }
    Quiet(const Quiet&) = delete;
    Quiet& operator=(const Quiet&) = delete;

   private:
    struct Log {
      std::mutex mutex;
      int silencers = 0;
      cv::utils::logging::LogLevel level{};
    };
    static Log& log() {
      static Log of_all_threads;
      return of_all_threads;
    }
  };

  void read_header() {
    std::ifstream in(model_, std::ios::binary);
    const std::string bytes((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
    OnnxHeader header;
    try {
      if (bytes.compare(0, 8, "version ") == 0 && bytes.find("git-lfs") != std::string::npos)
        throw Error("it is a pointer of Git LFS, not the file itself");
      header = read_onnx_header(bytes.data(), bytes.size());
    } catch (const Error& e) {
      const std::string reason = e.what();
      throw Error(name() + ": expected a whole ONNX file, found " + std::to_string(bytes.size()) +
                  " bytes: " + reason.substr(reason.find(": ") + 2) + "; fetch the file again");
    }
    std::string found;
    for (const auto& input : header.inputs)
      found += (found.empty() ? "" : ", ") + input.name + " " + shape_of(input);
    const bool one = header.inputs.size() == 1;
    std::vector<std::int64_t> shape;
    if (one) shape = header.inputs[0].shape;
    if (!one ||
        (!shape.empty() && (shape.size() != 4 || shape[0] > 1 || (shape[1] != 3 && shape[1] != 0))))
      throw Error(name() + ": expected one input of 1x3xHxW (a color image), found " +
                  (found.empty() ? "none" : found) + "; export the model so");
    input_name_ = header.inputs[0].name;
    if (shape.size() == 4 && shape[2] <= 8192 && shape[3] <= 8192)
      input_size_ = {static_cast<int>(shape[3]), static_cast<int>(shape[2])};
  }

  static std::string shape_of(const OnnxHeader::Input& input) {
    std::string text;
    for (const std::int64_t n : input.shape)
      text += (text.empty() ? "" : "x") + (n > 0 ? std::to_string(n) : std::string("?"));
    return text;
  }

  std::string cannot(const char* what, const cv::Exception& e) const {
    std::string reason = e.err.empty() ? e.what() : e.err;
    // The message of a nested exception spans lines; its last assertion or reason is what counts.
    for (char& c : reason)
      if (c == '\n' || c == '\r') c = ' ';
    reason.erase(reason.find_last_not_of("> ") + 1);
    return name() + ": OpenCV " CV_VERSION " cannot " + what + " this graph (" + reason +
           "). Ways out: a newer OpenCV (the standard YOLOv8 and YOLO11 exports need 4.7); an "
           "export that ends before the operations it does not know (for YOLO the one that "
           "docs/write_a_segmenter.md names headless); or run the network elsewhere and read its "
           "masks with mask_files";
  }

  std::filesystem::path model_;
  cv::dnn::Net net_;
  std::string input_name_;
  std::vector<cv::String> output_names_;
  std::vector<cv::Mat> outputs_;
  cv::Size input_size_;
};

/// A network that OpenCV's DNN module runs, as a Segmenter:
///
///     stillpoint::OpenCvDnnSegmenter segmenter("yolov8n-seg_headless.onnx");
///
/// The decoder is recognised from the network's outputs (see choose_decoder). Construction reads
/// the file and runs the network once. Throws Error that says what is wrong with the file, the
/// graph or the settings.
class OpenCvDnnSegmenter : public NetworkSegmenter {
 public:
  using Settings = OpenCvDnnSettings;

  explicit OpenCvDnnSegmenter(const std::filesystem::path& model, const Settings& settings = {})
      : NetworkSegmenter(std::make_unique<OpenCvDnnRuntime>(model, settings), settings) {}
};

}  // namespace stillpoint
