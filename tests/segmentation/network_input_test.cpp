// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/segmentation/decode/network_input.hpp"

#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "../io/temporary_folder.hpp"
#include "stillpoint/segmentation/network_segmenter.hpp"

namespace {

using namespace stillpoint;

TEST(CompleteInputSize, KeepsWhatIsFixedAndTheProportionsOfTheImage) {
  EXPECT_EQ(complete_input_size({300, 200}, {640, 480}), cv::Size(300, 200));
  EXPECT_EQ(complete_input_size({640, 0}, {640, 480}), cv::Size(640, 480));
  EXPECT_EQ(complete_input_size({640, 0}, {1280, 720}), cv::Size(640, 384));
  EXPECT_EQ(complete_input_size({0, 480}, {640, 480}), cv::Size(640, 480));
  EXPECT_EQ(complete_input_size({0, 480}, {1280, 720}), cv::Size(864, 480));
  EXPECT_EQ(complete_input_size({0, 480}, {480, 640}), cv::Size(384, 480));
  EXPECT_EQ(complete_input_size({640, 0}, {1, 1000}), cv::Size(640, 2560)) << "four times";
  EXPECT_EQ(complete_input_size({640, 0}, {1000, 1}), cv::Size(640, 32));
  EXPECT_EQ(complete_input_size({0, 0}, {640, 480}), cv::Size(640, 480));
  EXPECT_EQ(complete_input_size({0, 0}, {1280, 720}), cv::Size(640, 384));
  EXPECT_EQ(complete_input_size({0, 0}, {80, 60}), cv::Size(96, 64));
  EXPECT_EQ(complete_input_size({0, 0}, {1, 1}), cv::Size(32, 32));
}

/// Boxes of 80 classes for any input; notes the sizes that it is run with.
class OpenRuntime : public NetworkRuntime {
 public:
  OpenRuntime(const cv::Size& size, std::vector<cv::Size>& runs) : size_(size), runs_(runs) {}
  std::string name() const override { return "open"; }
  cv::Size input_size() const override { return size_; }
  std::vector<TensorView> run(const std::vector<float>& input, const cv::Size& size) override {
    EXPECT_EQ(input.size(), 3 * static_cast<std::size_t>(size.area()));
    runs_.push_back(size);
    int cells = 0;
    for (const int stride : {8, 16, 32}) cells += (size.width / stride) * (size.height / stride);
    output_.assign(static_cast<std::size_t>(84 * cells), 0.0f);
    return {{"output0", {1, 84, cells}, output_.data()}};
  }

 private:
  cv::Size size_;
  std::vector<cv::Size>& runs_;
  std::vector<float> output_;
};

std::vector<cv::Size> runs_of(const cv::Size& model,
                              const NetworkSegmenterSettings& settings = {}) {
  std::vector<cv::Size> runs;
  NetworkSegmenter segmenter(std::make_unique<OpenRuntime>(model, runs), settings);
  RgbdFrame frame;
  frame.color = cv::Mat(480, 640, CV_8UC3, cv::Scalar::all(90));
  EXPECT_TRUE(segmenter.segment(frame).available);
  return runs;
}

TEST(NetworkSegmenter, TriesAndRunsAModelAtTheLengthThatIsFixed) {
  using Sizes = std::vector<cv::Size>;
  EXPECT_EQ(runs_of({640, 0}), (Sizes{{640, 640}, {640, 480}}));
  EXPECT_EQ(runs_of({0, 480}), (Sizes{{480, 480}, {640, 480}}));
  EXPECT_EQ(runs_of({0, 0}), (Sizes{{320, 320}, {640, 480}}));
  EXPECT_EQ(runs_of({320, 256}), (Sizes{{320, 256}, {320, 256}}));
  NetworkSegmenterSettings settings;
  settings.input_size = {640, 320};
  EXPECT_EQ(runs_of({640, 0}, settings), (Sizes{{640, 320}, {640, 320}}));
  settings.input_size = {640, 0};
  EXPECT_ERROR(runs_of({0, 0}, settings), "expected both width and height", "640x0", "height");
  settings.input_size = {320, 320};
  EXPECT_ERROR(runs_of({640, 0}, settings), "640x?", "320x320");
}

}  // namespace
