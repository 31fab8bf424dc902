// SPDX-License-Identifier: BSD-2-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stillpoint/backends/opencv_dnn/segmenter.hpp>
#include <stillpoint/evaluation/mask_metrics.hpp>
#include <stillpoint/front_end.hpp>
#include <stillpoint/io/image_file.hpp>
#include <stillpoint/testing/segmenter_conformance.hpp>
#include <thread>

#include "../../tests/io/temporary_folder.hpp"

namespace {

namespace fs = std::filesystem;
using stillpoint::Instance;
using stillpoint::OpenCvDnnSegmenter;
using stillpoint::OpenCvDnnSettings;
using stillpoint::RgbdFrame;
using stillpoint::Segmentation;

RgbdFrame frame_of(const cv::Mat& color, double timestamp = 1) {
  RgbdFrame frame;
  frame.color = color;
  frame.timestamp = timestamp;
  return frame;
}

RgbdFrame plain_frame(int width = 80, int height = 60) {
  return frame_of(cv::Mat(height, width, CV_8UC3, cv::Scalar(10, 120, 240)));
}

/// Graphs that test_graphs.py wrote while building.
class DnnGraphs : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!fs::exists(fs::path(STILLPOINT_TEST_GRAPHS) / "yolo.onnx"))
      GTEST_SKIP() << "no graphs: python3-onnx was not there when the tests were built";
  }
  static fs::path graph(const std::string& name) {
    return fs::path(STILLPOINT_TEST_GRAPHS) / (name + ".onnx");
  }
};

/// One expected instance per line, then the rows of its mask.
std::vector<Instance> read_expected(const fs::path& path, const std::vector<std::string>& names) {
  std::ifstream in(path);
  std::vector<Instance> expected;
  int class_id = 0, has_mask = 0;
  Instance s;
  while (in >> class_id >> s.score >> s.box.x >> s.box.y >> s.box.width >> s.box.height >>
         has_mask) {
    s.class_name = names.at(static_cast<std::size_t>(class_id));
    s.mask = cv::Mat();
    if (has_mask) {
      s.mask = cv::Mat::zeros(s.box.size(), CV_8UC1);
      for (int y = 0; y < s.box.height; ++y) {
        std::string row;
        in >> row;
        for (int x = 0; x < s.box.width; ++x)
          s.mask.at<uchar>(y, x) = row.at(static_cast<std::size_t>(x)) == '1' ? 255 : 0;
      }
    }
    expected.push_back(s);
  }
  return expected;
}

class DecodesItsNetwork : public DnnGraphs, public ::testing::WithParamInterface<const char*> {};

TEST_P(DecodesItsNetwork, BitByBit) {
  const fs::path model = graph(GetParam());
  OpenCvDnnSegmenter segmenter(model);
  EXPECT_EQ(segmenter.decoder().find(std::string(GetParam()).substr(0, 4)), 0u);
  const auto expected =
      read_expected(fs::path(model).replace_extension(".txt"), segmenter.classes());
  ASSERT_GE(expected.size(), 3u);
  const RgbdFrame frame = plain_frame();
  const Segmentation found = segmenter.segment(frame);
  EXPECT_TRUE(found.available);
  EXPECT_EQ(found.timestamp, frame.timestamp);
  EXPECT_NO_THROW(check_segmentation(found, frame.color.size()));
  ASSERT_EQ(found.instances.size(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i) {
    SCOPED_TRACE(i);
    const Instance &a = found.instances[i], &b = expected[i];
    EXPECT_EQ(a.class_name, b.class_name);
    EXPECT_NEAR(a.score, b.score, 1e-5);
    EXPECT_EQ(a.box, b.box);
    ASSERT_EQ(a.mask.size(), b.mask.size());
    if (b.mask.empty()) continue;
    EXPECT_EQ(cv::countNonZero(a.mask != b.mask), 0);
  }
}

INSTANTIATE_TEST_SUITE_P(OpenCvDnn, DecodesItsNetwork,
                         ::testing::Values("sparseinst", "mask_rcnn", "yolo_seg", "yolo",
                                           "yolo_objectness", "yolo_seg_headless", "fastestdet"),
                         [](const auto& tested) { return std::string(tested.param); });

TEST_F(DnnGraphs, FeedsEachNetworkItsChannelsAndScale) {
  // The graphs' score of class k is the mean of channel k as they see it.
  const auto scores = [&](const char* name, const cv::Mat& color) {
    OpenCvDnnSettings settings;
    settings.decoding.min_score = 0.01f;
    OpenCvDnnSegmenter segmenter(graph(name), settings);
    const auto found = segmenter.segment(frame_of(color)).instances;
    std::vector<float> out;
    for (const char* c : {"person", "bicycle", "car"}) {
      out.push_back(0);
      for (const Instance& s : found)
        if (s.class_name == c) out.back() = s.score;
    }
    return out;
  };
  const cv::Mat red(64, 64, CV_8UC3, cv::Scalar(0, 0, 204)),
      blue(64, 64, CV_8UC3, cv::Scalar(51, 0, 0));
  EXPECT_NEAR(scores("channels_yolo", red)[0], 0.8, 1e-4) << "RGB, 0 to 1";
  EXPECT_NEAR(scores("channels_yolo", blue)[2], 0.2, 1e-4);
  EXPECT_NEAR(scores("channels_sparseinst", red)[2], 0.8, 1e-4) << "BGR, 0 to 255";
  EXPECT_NEAR(scores("channels_sparseinst", blue)[0], 0.2, 1e-4);
  EXPECT_NEAR(scores("channels_fastestdet", red)[2], std::pow(0.8, 0.4), 1e-4) << "BGR, 0 to 1";
  const cv::Mat grey(64, 64, CV_8UC1, cv::Scalar(102));
  EXPECT_NEAR(scores("channels_yolo", grey)[0], 0.4, 1e-4);
  // Letterboxed: half of the input is 114.
  const cv::Mat wide(32, 64, CV_8UC3, cv::Scalar(0, 0, 204));
  EXPECT_NEAR(scores("channels_yolo", wide)[0], 0.4 + 0.5 * 114 / 255, 1e-4);
}

TEST_F(DnnGraphs, TakesADecoderByName) {
  OpenCvDnnSettings settings;
  settings.decoder = "yolo";
  EXPECT_EQ(OpenCvDnnSegmenter(graph("yolo"), settings).decoder(), "yolo");
  settings.decoder = "mask_rcnn";
  EXPECT_ERROR(OpenCvDnnSegmenter(graph("yolo"), settings), "yolo.onnx", "of the kind mask_rcnn",
               "found output0 1x84x84 for an input of 64x64", "detection_out_final");
  settings.decoder = "detr";
  EXPECT_ERROR(OpenCvDnnSegmenter(graph("yolo"), settings), "no decoder \"detr\"", "sparseinst");
}

TEST_F(DnnGraphs, SaysWhatItFoundWhenNoDecoderFits) {
  EXPECT_ERROR(OpenCvDnnSegmenter(graph("unknown")), "unknown.onnx", "found logits 1x1000",
               "sparseinst: scores 1xNxC",
               "yolo_seg:", "fastestdet:", "mask_rcnn:", "yolo_seg_headless:");
}

TEST_F(DnnGraphs, SaysTheWayOutOfAGraphThatOpenCvCannotRun) {
  EXPECT_ERROR(OpenCvDnnSegmenter(graph("unknown_operation")), "cannot read this graph", "Einsum",
               CV_VERSION, "mask_files");
  if (CV_VERSION_MAJOR == 4 && CV_VERSION_MINOR < 7)
    EXPECT_ERROR(OpenCvDnnSegmenter(graph("unrunnable")), "cannot run this graph", CV_VERSION,
                 "need 4.7", "headless");
}

TEST_F(DnnGraphs, RefusesModelsThatTakeNoColorPicture) {
  EXPECT_ERROR(OpenCvDnnSegmenter(graph("gray")), "1x3xHxW", "found images 1x1x64x64");
  EXPECT_ERROR(OpenCvDnnSegmenter(graph("two_inputs")), "one input", "a 1x3x64x64, b 1x3x64x64");
}

TEST_F(DnnGraphs, RefusesBrokenFiles) {
  TemporaryFolder folder;
  std::ifstream in(graph("yolo"), std::ios::binary);
  const std::string whole((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  const fs::path path = folder / "broken.onnx";
  const auto load = [&](const std::string& bytes) {
    std::ofstream(path, std::ios::binary) << bytes;
    OpenCvDnnSegmenter segmenter(path);
  };
  EXPECT_NO_THROW(load(whole));
  for (const std::size_t length :
       {std::size_t{0}, std::size_t{1}, std::size_t{7}, whole.size() / 2, whole.size() - 1})
    EXPECT_ERROR(load(whole.substr(0, length)), "broken.onnx");
  EXPECT_ERROR(load(whole.substr(0, whole.size() / 2)), "ends too early", "fetch the file again");
  EXPECT_ERROR(load("<!DOCTYPE html><html>Not found</html>"), "broken.onnx", "ONNX");
  EXPECT_ERROR(load("version https://git-lfs.github.com/spec/v1\n"), "Git LFS");
  EXPECT_ERROR(OpenCvDnnSegmenter(folder / "none.onnx"), "none.onnx", "check the path");
  EXPECT_ERROR(OpenCvDnnSegmenter(folder.path()), "model file");
  // Any byte wrong: read or refused, never a crash.
  for (std::size_t i = 0; i < 300; i += 3) {
    std::string bytes = whole.substr(0, 2000);
    bytes[i] = static_cast<char>(bytes[i] ^ (1 << (i % 8)));
    EXPECT_ANY_THROW(load(bytes));
  }
}

TEST_F(DnnGraphs, GiveOpenCvItsLogBackWhenTwoThreadsAreDone) {
  namespace logging = cv::utils::logging;
  const auto before = logging::setLogLevel(logging::LOG_LEVEL_WARNING);
  const auto work = [] {
    OpenCvDnnSegmenter segmenter(graph("yolo"));
    for (int i = 0; i < 200; ++i) segmenter.segment(plain_frame());
  };
  std::thread other(work);
  work();
  other.join();
  EXPECT_EQ(logging::setLogLevel(before), logging::LOG_LEVEL_WARNING);
}

TEST_F(DnnGraphs, NanScoresAreAnError) {
  EXPECT_ERROR(OpenCvDnnSegmenter(graph("nan")).segment(plain_frame()), "output0", "1 NaN",
               "32-bit");
}

TEST_F(DnnGraphs, GoesOnWithPredictionsWhenScoresAreNan) {
  OpenCvDnnSegmenter segmenter(graph("nan"));
  stillpoint::FrontEnd front_end(stillpoint::FrontEndSettings::network_only(), {}, &segmenter);
  front_end.compute_mask(plain_frame());
  EXPECT_TRUE(front_end.stats().status & stillpoint::kSegmenterFailed);
  EXPECT_NE(front_end.stats().segmenter_error.find("NaN"), std::string::npos);
}

TEST_F(DnnGraphs, TakesThousandsOfObjects) {
  OpenCvDnnSettings settings;
  settings.decoding.max_instances = 1000;
  OpenCvDnnSegmenter all(graph("many"), settings);
  const RgbdFrame frame = plain_frame(512, 512);
  const Segmentation found = all.segment(frame);
  EXPECT_EQ(found.instances.size(), 1000u);
  EXPECT_NO_THROW(check_segmentation(found, frame.color.size()));
  const Segmentation best = OpenCvDnnSegmenter(graph("many")).segment(frame);
  ASSERT_EQ(best.instances.size(), 100u) << "the default's most";
  EXPECT_EQ(best.instances[0].score, found.instances[0].score);
  for (std::size_t i = 1; i < found.instances.size(); ++i)
    ASSERT_GE(found.instances[i - 1].score, found.instances[i].score);
  stillpoint::FrontEnd front_end(stillpoint::FrontEndSettings::network_only(), {}, &all);
  EXPECT_NO_THROW(front_end.compute_mask(frame));
  EXPECT_EQ(front_end.stats().instances, 1000);
}

TEST_F(DnnGraphs, DropsBoxesThatAreNone) {
  const RgbdFrame frame = plain_frame();
  const Segmentation found = OpenCvDnnSegmenter(graph("wild_boxes")).segment(frame);
  EXPECT_NO_THROW(check_segmentation(found, frame.color.size()));
  ASSERT_EQ(found.instances.size(), 1u) << "the one that covers everything";
  EXPECT_EQ(found.instances[0].box, cv::Rect(0, 0, 80, 60));
}

TEST_F(DnnGraphs, WantsOneNamePerClass) {
  OpenCvDnnSettings settings;
  EXPECT_ERROR(OpenCvDnnSegmenter(graph("three_classes")), "3 classes", "found none",
               "class_names");
  settings.class_names = {"person", "robot"};
  EXPECT_ERROR(OpenCvDnnSegmenter(graph("three_classes"), settings), "3 classes", "found 2");
  settings.class_names.push_back("forklift");
  EXPECT_EQ(OpenCvDnnSegmenter(graph("three_classes"), settings).classes().back(), "forklift");
}

TEST_F(DnnGraphs, KnowsTheInputSizeOfItsModel) {
  OpenCvDnnSettings settings;
  settings.input_size = {64, 64};
  EXPECT_NO_THROW(OpenCvDnnSegmenter(graph("yolo"), settings));
  settings.input_size = {96, 64};
  EXPECT_ERROR(OpenCvDnnSegmenter(graph("yolo"), settings), "made for, 64x64", "96x64");
  // This one takes any size, but its outputs are those for 320 x 320.
  OpenCvDnnSegmenter open(graph("open"));
  EXPECT_TRUE(open.segment(plain_frame(320, 300)).available);
  EXPECT_ERROR(open.segment(plain_frame(640, 480)), "expected outputs as on the first run",
               "found output0 1x84x2100");
}

TEST_F(DnnGraphs, KeepsTheFixedLengthOfAModelThatIsOpenInOne) {
  for (const char* name : {"open_height", "open_width", "open_both"}) {
    SCOPED_TRACE(name);
    OpenCvDnnSegmenter segmenter(graph(name));
    EXPECT_EQ(segmenter.decoder(), "fastestdet");
    for (const cv::Size size :
         {cv::Size(640, 480), cv::Size(1280, 720), cv::Size(480, 640), cv::Size(100, 1000)}) {
      const RgbdFrame frame = plain_frame(size.width, size.height);
      const Segmentation found = segmenter.segment(frame);
      EXPECT_NO_THROW(check_segmentation(found, frame.color.size()));
      EXPECT_GE(found.instances.size(), 1u) << size;
    }
  }
  OpenCvDnnSettings settings;
  settings.input_size = {640, 320};
  EXPECT_NO_THROW(OpenCvDnnSegmenter(graph("open_height"), settings));
  EXPECT_ERROR(OpenCvDnnSegmenter(graph("open_width"), settings), "made for, ?x480", "640x320");
  settings.input_size = {320, 320};
  EXPECT_ERROR(OpenCvDnnSegmenter(graph("open_height"), settings), "made for, 640x?", "320x320");
}

TEST(OpenCvDnn, ChecksItsSettings) {
  const auto check = [](auto change) {
    OpenCvDnnSettings settings;
    change(settings);
    settings.check();
  };
  EXPECT_ERROR(check([](auto& s) { s.decoding.min_score = 1.5f; }), "min_score");
  EXPECT_ERROR(check([](auto& s) { s.decoding.mask_threshold = std::nanf(""); }), "mask_threshold");
  EXPECT_ERROR(check([](auto& s) { s.decoding.max_overlap = -1; }), "max_overlap");
  EXPECT_ERROR(check([](auto& s) { s.decoding.max_instances = 0; }), "max_instances");
  EXPECT_ERROR(check([](auto& s) { s.input_size = {-1, 0}; }), "input_size");
  EXPECT_ERROR(check([](auto& s) {
                 s.input_size = {640, 0};
               }),
               "input_size: expected both", "found 640x0", "give the height");
  EXPECT_ERROR(check([](auto& s) { s.input_size = {0, 480}; }), "found 0x480", "give the width");
  EXPECT_NO_THROW(check([](auto& s) { s.input_size = {640, 480}; }));
}

/// Real weights and images; not part of the project.
class RealWeights : public ::testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    model_ = fs::path(STILLPOINT_SHARED_DATA) / "models" / GetParam();
    if (!fs::exists(model_)) GTEST_SKIP() << "no weights at " << model_;
  }
  fs::path model_;
};

TEST_P(RealWeights, FindBothPeopleInBothFrames) {
  OpenCvDnnSegmenter segmenter(model_);
  const fs::path folder = fs::path(STILLPOINT_SHARED_DATA) / "real/fr3_walking_xyz";
  // Where they are, by eye.
  const std::vector<std::pair<const char*, std::vector<cv::Rect>>> frames = {
      {"1341846313.592026.png", {{50, 120, 190, 360}, {477, 5, 163, 475}}},
      {"1341846313.922055.png", {{38, 121, 200, 359}, {461, 5, 179, 475}}}};
  for (const auto& [name, people] : frames) {
    const RgbdFrame frame = frame_of(stillpoint::read_color(folder / name));
    const Segmentation found = segmenter.segment(frame);
    EXPECT_NO_THROW(check_segmentation(found, frame.color.size()));
    for (const cv::Rect& person : people) {
      double best = 0;
      for (const Instance& s : found.instances)
        if (s.class_name == "person")
          best = std::max(best,
                          static_cast<double>((s.box & person).area()) / (s.box | person).area());
      EXPECT_GT(best, 0.75) << name << " " << person;
    }
  }
}

TEST_P(RealWeights, MaskThePersonBeforeAFixedCamera) {
  OpenCvDnnSegmenter segmenter(model_);
  const bool boxes = std::string(GetParam()) == "FastestDet.onnx";
  stillpoint::Camera camera;
  camera.fx = camera.fy = 525, camera.cx = 320, camera.cy = 240;
  stillpoint::FrontEnd front_end(stillpoint::FrontEndSettings::network_only(), camera, &segmenter);
  const fs::path folder = fs::path(STILLPOINT_SHARED_DATA) / "real/person_static_camera/data";
  stillpoint::MaskMetrics fused, raw;
  const int step = std::getenv("STILLPOINT_ALL_FRAMES") ? 1 : 12;
  for (int i = 0; i < 100; i += step) {
    char number[16];
    std::snprintf(number, sizeof number, "%010d", i);
    RgbdFrame frame = frame_of(stillpoint::read_color(folder / (std::string(number) + ".jpg")), i);
    frame.depth = stillpoint::read_depth(folder / (std::string(number) + "_depth.png"));
    frame.depth_units_per_m = 1000;
    cv::Mat truth = stillpoint::read_color(folder / (std::string(number) + "_mask.jpg"));
    cv::extractChannel(truth, truth, 0);
    truth = truth > 127;
    front_end.compute_mask(frame);
    const cv::Mat measured = stillpoint::measured_pixels(frame);
    fused.add(stillpoint::compare_masks(front_end.undilated_mask(), truth, measured));
    raw.add(stillpoint::compare_masks(front_end.raw_mask(), truth, measured));
  }
  std::printf("mean IoU %.4f, of the network alone %.4f\n", fused.mean_iou(), raw.mean_iou());
  EXPECT_GE(fused.mean_iou(), boxes ? 0.90 : 0.97);
}

INSTANTIATE_TEST_SUITE_P(OpenCvDnn, RealWeights,
                         ::testing::Values("FastestDet.onnx", "yolov8n-seg_headless_fp32.onnx"),
                         [](const auto& tested) {
                           return std::string(tested.param).substr(0, tested.index == 0 ? 10 : 7);
                         });

}  // namespace

namespace stillpoint::testing {

// Where there are no graphs, construction throws and the suite skips.
template <int kGraph>
struct MakeFromGraph {
  std::unique_ptr<Segmenter> operator()() const {
    const char* const names[] = {"sparseinst", "mask_rcnn", "yolo_seg_headless", "fastestdet"};
    return std::make_unique<OpenCvDnnSegmenter>(std::filesystem::path(STILLPOINT_TEST_GRAPHS) /
                                                (std::string(names[kGraph]) + ".onnx"));
  }
};

STILLPOINT_TEST_SEGMENTER(SparseInst, MakeFromGraph<0>);
STILLPOINT_TEST_SEGMENTER(MaskRcnn, MakeFromGraph<1>);
STILLPOINT_TEST_SEGMENTER(Yolo, MakeFromGraph<2>);
STILLPOINT_TEST_SEGMENTER(FastestDet, MakeFromGraph<3>);

struct MakeFastestDetWithWeights {
  std::unique_ptr<Segmenter> operator()() const {
    return std::make_unique<OpenCvDnnSegmenter>(std::filesystem::path(STILLPOINT_SHARED_DATA) /
                                                "models/FastestDet.onnx");
  }
};
STILLPOINT_TEST_SEGMENTER(RealWeights, MakeFastestDetWithWeights);

}  // namespace stillpoint::testing
