// SPDX-License-Identifier: BSD-2-Clause
#include <gtest/gtest.h>
#include <torch/csrc/jit/frontend/resolver.h>

#include <cmath>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <sstream>
#include <stillpoint/backends/torchscript.hpp>
#include <stillpoint/front_end.hpp>
#include <stillpoint/testing/segmenter_conformance.hpp>
#include <string>
#include <utility>
#include <vector>

#include "../../tests/io/temporary_folder.hpp"

// The modules are compiled here, from TorchScript's own language.
namespace {

namespace fs = std::filesystem;
using stillpoint::Instance;
using stillpoint::RgbdFrame;
using stillpoint::Segmentation;
using stillpoint::TorchScriptSegmenter;
using stillpoint::TorchScriptSettings;
using torch::indexing::Slice;

RgbdFrame frame_of(const cv::Mat& color) {
  RgbdFrame frame;
  frame.color = color;
  frame.timestamp = 1;
  return frame;
}

/// Exactly the networks' input, so that boxes are what the tensors say.
RgbdFrame plain_frame() { return frame_of(cv::Mat(64, 64, CV_8UC3, cv::Scalar(10, 120, 240))); }

using Tensors = std::vector<std::pair<std::string, torch::Tensor>>;

/// A module with these tensors as buffers.
torch::jit::Module module_of(const Tensors& buffers, const std::string& source,
                             const torch::jit::ResolverPtr& resolver = nullptr) {
  torch::jit::Module module("Network");
  for (const auto& [name, tensor] : buffers) module.register_buffer(name, tensor);
  module.define(source + "\n", resolver);
  return module;
}

/// Two people and a chair of YOLO detection for 64 x 64: 1 x 84 x 84.
torch::Tensor yolo_boxes() {
  torch::Tensor t = torch::zeros({1, 84, 84});
  const auto add = [&](int anchor, int cls, float score, float x, float y, float w, float h) {
    const float box[] = {x, y, w, h};
    for (int i = 0; i < 4; ++i) t.index_put_({0, i, anchor}, box[i]);
    t.index_put_({0, 4 + cls, anchor}, score);
  };
  add(3, 0, 0.9f, 20, 30, 16, 40);
  add(4, 0, 0.8f, 20, 31, 16, 40);  // the same once more
  add(70, 0, 0.7f, 50, 40, 20, 24);
  add(40, 56, 0.6f, 20, 30, 16, 40);
  return t;
}

/// SparseInst for 64 x 64: a person in columns 8 to 23, a chair in rows 48 to 63.
Tensors sparse_inst() {
  torch::Tensor scores = torch::zeros({1, 3, 80}), masks = torch::zeros({1, 3, 64, 64});
  scores.index_put_({0, 0, 0}, 0.9f);
  scores.index_put_({0, 1, 56}, 0.8f);
  masks.index_put_({0, 0, Slice(), Slice(8, 24)}, 1.0f);
  masks.index_put_({0, 1, Slice(48, 64), Slice()}, 1.0f);
  return {{"scores", scores}, {"masks", masks}};
}

void expect_person_and_chair(const Segmentation& found) {
  ASSERT_EQ(found.instances.size(), 2u);
  EXPECT_EQ(found.instances[0].class_name, "person");
  EXPECT_NEAR(found.instances[0].score, 0.9, 1e-6);
  EXPECT_EQ(found.instances[0].box, cv::Rect(8, 0, 16, 64));
  EXPECT_EQ(cv::countNonZero(found.instances[0].mask), 16 * 64);
  EXPECT_EQ(found.instances[1].class_name, "chair");
  EXPECT_EQ(found.instances[1].box, cv::Rect(0, 48, 64, 16));
}

class TorchScript : public ::testing::Test {
 protected:
  fs::path save(const torch::jit::Module& module, const std::string& name = "network.pt") const {
    module.save((folder_ / name).string());
    return folder_ / name;
  }
  fs::path network(const Tensors& buffers, const std::string& source) const {
    return save(module_of(buffers, source));
  }
  static TorchScriptSettings at_64() {
    TorchScriptSettings settings;
    settings.input_size = {64, 64};
    return settings;
  }
  TemporaryFolder folder_;
};

TEST_F(TorchScript, DecodesATensor) {
  const fs::path model =
      network({{"boxes", yolo_boxes()}}, "def forward(self, x): return self.boxes");
  TorchScriptSegmenter segmenter(model, at_64());
  EXPECT_EQ(segmenter.decoder(), "yolo");
  EXPECT_EQ(segmenter.classes().size(), 80u);
  const Segmentation found = segmenter.segment(plain_frame());
  EXPECT_TRUE(found.available);
  EXPECT_EQ(found.timestamp, 1);
  ASSERT_EQ(found.instances.size(), 3u);
  EXPECT_EQ(found.instances[0].class_name, "person");
  EXPECT_FLOAT_EQ(found.instances[0].score, 0.9f);
  EXPECT_EQ(found.instances[0].box, cv::Rect(12, 10, 16, 40));
  EXPECT_EQ(found.instances[1].box, cv::Rect(40, 28, 20, 24));
  EXPECT_EQ(found.instances[2].class_name, "chair");
}

TEST_F(TorchScript, TakesNamesFromADict) {
  const fs::path model = network(
      sparse_inst(), "def forward(self, x): return {'masks': self.masks, 'scores': self.scores}");
  TorchScriptSegmenter segmenter(model, at_64());
  EXPECT_EQ(segmenter.decoder(), "sparseinst");
  expect_person_and_chair(segmenter.segment(plain_frame()));
}

TEST_F(TorchScript, TakesNamesFromANamedTuple) {
  struct Names : torch::jit::NativeResolver {
    std::shared_ptr<torch::jit::SugaredValue> resolveValue(
        const std::string& name, torch::jit::GraphFunction& function,
        const torch::jit::SourceRange& where) override {
      if (name == "Outputs")
        return std::make_shared<torch::jit::NamedTupleConstructor>(c10::TupleType::createNamed(
            c10::QualifiedName("__torch__.Outputs"), std::vector<std::string>{"masks", "scores"},
            {c10::TensorType::get(), c10::TensorType::get()}));
      return NativeResolver::resolveValue(name, function, where);
    }
  };
  TorchScriptSegmenter segmenter(
      save(module_of(sparse_inst(), "def forward(self, x): return Outputs(self.masks, self.scores)",
                     std::make_shared<Names>())),
      at_64());
  EXPECT_EQ(segmenter.decoder(), "sparseinst");
  expect_person_and_chair(segmenter.segment(plain_frame()));
}

TEST_F(TorchScript, TakesNamesFromTheSettings) {
  const fs::path model =
      network(sparse_inst(), "def forward(self, x): return [self.masks], (self.scores, None)");
  EXPECT_ERROR(TorchScriptSegmenter(model, at_64()), "network.pt",
               "found output0 1x3x64x64, output1 1x3x80", "sparseinst: scores 1xNxC");
  TorchScriptSettings settings = at_64();
  settings.output_names = {"masks", "scores"};
  expect_person_and_chair(TorchScriptSegmenter(model, settings).segment(plain_frame()));
  settings.output_names.push_back("boxes");
  EXPECT_ERROR(TorchScriptSegmenter(model, settings), "output_names", "2 outputs", "found 3");
}

TEST_F(TorchScript, FeedsThePictureAndConvertsWhatComes) {
  // The score of class k is the mean of channel k; in 64-bit floats, and not one after the other.
  torch::Tensor boxes = yolo_boxes().index({0}).t().contiguous();
  boxes.index_put_({Slice(), Slice(4)}, 0);
  const fs::path model = network({{"boxes", boxes}}, R"(
def forward(self, x):
    scores = x.mean([2, 3])
    x.fill_(7)
    out = self.boxes.clone()
    out[3, 4:7] = scores[0]
    return out.double().t().unsqueeze(0)
)");
  TorchScriptSettings settings = at_64();
  settings.decoding.min_score = 0.01f;
  TorchScriptSegmenter segmenter(model, settings);
  for (int again = 0; again < 2; ++again) {
    const auto found =
        segmenter.segment(frame_of(cv::Mat(64, 64, CV_8UC3, cv::Scalar(51, 102, 204)))).instances;
    ASSERT_EQ(found.size(), 1u);
    EXPECT_EQ(found[0].class_name, "person") << "RGB: red first";
    EXPECT_NEAR(found[0].score, 0.8, 1e-5) << "0 to 1";
  }
  const auto blue =
      segmenter.segment(frame_of(cv::Mat(64, 64, CV_8UC3, cv::Scalar(204, 0, 0)))).instances;
  ASSERT_EQ(blue.size(), 1u);
  EXPECT_EQ(blue[0].class_name, "car");
}

TEST_F(TorchScript, ReadsTheSizeThatAnExporterLeft) {
  const torch::jit::Module module =
      module_of({{"boxes", yolo_boxes()}}, "def forward(self, x): return self.boxes");
  const fs::path model = save(module);
  EXPECT_ERROR(TorchScriptSegmenter{model}, "for an input of 320x320", "found output0 1x84x84");
  const auto with = [&](const std::string& config) {
    module.save(model.string(), {{"config.txt", config}});
    return TorchScriptSegmenter(model).segment(plain_frame()).instances.size();
  };
  EXPECT_EQ(with(R"({"stride": 32, "imgsz": [64, 64], "names": {"0": "person"}})"), 3u);
  for (const char* useless : {R"({"imgsz": [-64, 64]})", R"({"imgsz": "64"})", R"("imgsz)", "{}"})
    EXPECT_ERROR(with(useless), "320x320");
}

TEST_F(TorchScript, SaysWhyANetworkDoesNotRun) {
  EXPECT_ERROR(
      TorchScriptSegmenter(network({}, "def forward(self, x): return x.view([1, 3, 64, 64])")),
      "network.pt", "on 1x3x320x320", "shape '[1, 3, 64, 64]' is invalid", "input_size");
  EXPECT_ERROR(TorchScriptSegmenter(network({}, "def forward(self, x): return x.size(0)")),
               "expected tensors", "of type int");
  EXPECT_ERROR(TorchScriptSegmenter(network({},
                                            "def forward(self, x):\n"
                                            "    assert x.size(2) == 64, 'not\\nmine'\n"
                                            "    return x")),
               "not");
  EXPECT_ERROR(TorchScriptSegmenter(network({}, "def forward(self, x, y): return x")),
               "takes one image", "takes 2");
  EXPECT_ERROR(TorchScriptSegmenter(network({}, "def forward(self): return 1")), "takes 0");
  EXPECT_ERROR(TorchScriptSegmenter(network({}, "def run(self, x): return x")), "found none");
  EXPECT_ERROR(TorchScriptSegmenter(network({}, "def forward(self, x): return (x, x, x)")),
               "found output0 1x3x320x320, output1 1x3x320x320, output2 1x3x320x320", "yolo_seg:");
  EXPECT_ERROR(TorchScriptSegmenter(network({}, "def forward(self, x): return None")),
               "found none");
  EXPECT_NO_THROW(
      TorchScriptSegmenter(network({{"boxes", yolo_boxes()}},
                                   "def forward(self, x, scale: float=1.0): return self.boxes"),
                           at_64()))
      << "what has a default need not be given";
}

TEST_F(TorchScript, RefusesBrokenFiles) {
  const fs::path model =
      network({{"boxes", yolo_boxes()}}, "def forward(self, x): return self.boxes");
  std::ifstream in(model, std::ios::binary);
  const std::string whole((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  const auto load = [&](const std::string& bytes) {
    TorchScriptSegmenter segmenter(folder_.write("broken.pt", bytes), at_64());
    return segmenter.segment(plain_frame());
  };
  EXPECT_NO_THROW(load(whole));
  for (const std::size_t length :
       {std::size_t{2}, std::size_t{100}, whole.size() / 2, whole.size() - 100, whole.size() - 1})
    EXPECT_ERROR(load(whole.substr(0, length)), "broken.pt", "cannot read this file", "whole");
  EXPECT_ERROR(load(""), "an empty file");
  EXPECT_ERROR(load("version https://git-lfs.github.com/spec/v1\n"), "Git LFS");
  EXPECT_ERROR(load("\x80\x02}q"), "pickle");
  EXPECT_ERROR(load("\x08\x06\x12\x07pytorch"), "ONNX");
  EXPECT_ERROR(load("<!DOCTYPE html>"), "another format", "torch.jit.trace");
  EXPECT_ERROR(TorchScriptSegmenter(folder_ / "none.pt"), "none.pt", "check the path");
  EXPECT_ERROR(TorchScriptSegmenter(folder_.path()), "model file");
  // A byte wrong: read or refused, never a crash.
  for (std::size_t i = 0; i < whole.size(); i += 1 + whole.size() / 60) {
    std::string bytes = whole;
    bytes[i] = static_cast<char>(bytes[i] ^ 0x41);
    Segmentation found;
    try {
      found = load(bytes);
    } catch (const stillpoint::Error&) {
      continue;
    }
    EXPECT_NO_THROW(check_segmentation(found, {64, 64}));
  }
}

TEST_F(TorchScript, RefusesDevicesThatAreNotThere) {
  const fs::path model =
      network({{"boxes", yolo_boxes()}}, "def forward(self, x): return self.boxes");
  TorchScriptSettings settings = at_64();
  for (const char* device : {"gpu", "", "cuda:99", "vulkan"}) {
    settings.device = device;
    EXPECT_ERROR(TorchScriptSegmenter(model, settings), "device", device);
  }
}

TEST_F(TorchScript, NanScoresAreAnErrorThatTheFrontEndSurvives) {
  torch::Tensor boxes = yolo_boxes();
  boxes.index_put_({0, 7, 3}, std::nanf(""));
  TorchScriptSegmenter segmenter(
      network({{"boxes", boxes}}, "def forward(self, x): return self.boxes"), at_64());
  EXPECT_ERROR(segmenter.segment(plain_frame()), "output0", "1 NaN");
  stillpoint::FrontEnd front_end(stillpoint::FrontEndSettings::network_only(), {}, &segmenter);
  front_end.compute_mask(plain_frame());
  EXPECT_TRUE(front_end.stats().status & stillpoint::kSegmenterFailed);
}

TEST_F(TorchScript, WantsOneNamePerClass) {
  TorchScriptSettings settings = at_64();
  const fs::path model =
      network({{"boxes", yolo_boxes().index({Slice(), Slice(0, 7)}).contiguous()}},
              "def forward(self, x): return self.boxes");
  EXPECT_ERROR(TorchScriptSegmenter(model, settings), "3 classes", "class_names");
  settings.class_names = {"person", "robot", "forklift"};
  EXPECT_EQ(TorchScriptSegmenter(model, settings).segment(plain_frame()).instances.size(), 2u);
}

}  // namespace

namespace stillpoint::testing {

/// YOLO boxes and SparseInst masks whose scores follow the image.
template <bool kMasks>
struct MakeTorchScript {
  std::unique_ptr<Segmenter> operator()() const {
    const TemporaryFolder folder;
    const std::string path = (folder / "network.pt").string();
    if (kMasks)
      module_of(sparse_inst(),
                "def forward(self, x): return {'masks': self.masks * (x.mean() / 255), "
                "'scores': self.scores}")
          .save(path);
    else
      module_of({{"boxes", yolo_boxes()}},
                "def forward(self, x): return self.boxes * (0.5 + 0.5 * x.mean())")
          .save(path);
    TorchScriptSettings settings;
    settings.input_size = {64, 64};
    return std::make_unique<TorchScriptSegmenter>(path, settings);
  }
};
STILLPOINT_TEST_SEGMENTER(TorchScriptBoxes, MakeTorchScript<false>);
STILLPOINT_TEST_SEGMENTER(TorchScriptMasks, MakeTorchScript<true>);

}  // namespace stillpoint::testing
